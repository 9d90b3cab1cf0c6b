"""Surfaces as quadrilaterals: the one primitive of rendered scenes, because texture and light map onto it linearly.

World frame: x along the corridor, y across it, z up, metres. Corners run counter-clockwise seen from outside, starting
at the lower left.
"""

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from stsem.synth.vocabulary import Label

F32 = npt.NDArray[np.float32]
F64 = npt.NDArray[np.float64]
I32 = npt.NDArray[np.int32]

_FIT = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)


@dataclass(frozen=True)
class Quads:
    """A bag of n quadrilaterals.

    Args:
        corners: (n, 4, 3) metres, world.
        normals: (n, 4, 3) unit normals at the corners (smooth over curved bodies).
        uv: (n, 4, 2) texture coordinates: metres for tiled materials, 0..1 for fitted ones; v grows downwards.
        material: (n,) index into the materials of the scene.
        label: (n,) class id.
    """

    corners: F32
    normals: F32
    uv: F32
    material: I32
    label: npt.NDArray[np.uint8]

    def __len__(self) -> int:
        return len(self.corners)

    def triangles(self) -> F32:
        """(2n, 3, 3): quad q becomes triangles 2q (corners 0 1 2) and 2q + 1 (corners 0 2 3)."""
        c = self.corners
        return np.ascontiguousarray(np.stack([c[:, [0, 1, 2]], c[:, [0, 2, 3]]], 1).reshape(-1, 3, 3))


@dataclass
class _Lists:
    corners: list[F64] = field(default_factory=list)
    normals: list[F64] = field(default_factory=list)
    uv: list[F64] = field(default_factory=list)
    material: list[int] = field(default_factory=list)
    label: list[int] = field(default_factory=list)


class Builder:
    """Collects quads in a local frame; `at` gives a builder of a moved frame that collects into the same bag.

    Args:
        origin: (3,) where the local frame's origin lies in the world.
        yaw: rotation of the local frame about z, radians.
    """

    def __init__(self, origin: tuple[float, float, float] = (0.0, 0.0, 0.0), yaw: float = 0.0) -> None:
        self._lists = _Lists()
        self._set(np.array(origin, np.float64), yaw)

    def _set(self, origin: F64, yaw: float) -> None:
        self.origin, self.yaw = origin, yaw
        c, s = np.cos(yaw), np.sin(yaw)
        self._rotation = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])

    def at(self, x: float, y: float, z: float = 0.0, yaw: float = 0.0) -> "Builder":
        """A builder whose frame stands at (x, y, z) of this frame, turned by `yaw` radians."""
        child = Builder()
        child._lists = self._lists
        child._set(self.world((x, y, z)), self.yaw + yaw)
        return child

    def world(self, point: tuple[float, float, float]) -> F64:
        """(3,) world coordinates of a point of the local frame."""
        moved = (self._rotation * np.array(point, np.float64)).sum(1) + self.origin
        return np.asarray(moved, np.float64)

    def quad(
        self, corners: npt.ArrayLike, material: int, label: Label, *, fit: bool = False,
        normals: npt.ArrayLike | None = None, shift: tuple[float, float] = (0.0, 0.0),
    ) -> None:  # fmt: skip
        """Add one quad; `fit` stretches the texture over it, else it repeats in metres, moved by `shift`."""
        local = np.asarray(corners, np.float64)
        flat = np.cross(local[1] - local[0], local[3] - local[0])
        smooth = np.asarray(normals, np.float64) if normals is not None else np.broadcast_to(flat, (4, 3))
        length = np.linalg.norm(smooth, axis=1, keepdims=True)
        size = (1.0, 1.0) if fit else (np.linalg.norm(local[1] - local[0]), np.linalg.norm(local[3] - local[0]))
        store = self._lists
        store.corners.append((self._rotation[None] * local[:, None, :]).sum(2) + self.origin)
        store.normals.append((self._rotation[None] * (smooth / np.maximum(length, 1e-12))[:, None, :]).sum(2))
        store.uv.append(_FIT * np.array(size) + np.array(shift))
        store.material.append(material)
        store.label.append(int(label))

    def build(self) -> Quads:
        """All quads collected so far, in the order they were added."""
        store, n = self._lists, len(self._lists.corners)
        return Quads(
            np.array(store.corners, np.float32).reshape(n, 4, 3), np.array(store.normals, np.float32).reshape(n, 4, 3),
            np.array(store.uv, np.float32).reshape(n, 4, 2), np.array(store.material, np.int32),
            np.array(store.label, np.uint8),
        )  # fmt: skip
