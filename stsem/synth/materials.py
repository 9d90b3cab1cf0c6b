"""Textures of a scene in one flat array with mip levels, and looking them up for many points at once."""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from stsem.synth.mesh import F32, I32
from stsem.synth.patterns import Picture

_LEVELS = 8
GAMMA = 2.2
"""Display gamma: linear = sRGB^2.2, near enough for pictures."""


@dataclass(frozen=True)
class Materials:
    """All materials of a scene.

    Args:
        texels: (n, 3) float32 linear albedo of all mip levels of all textures.
        offset, height, width: (m, levels) where a level starts, and its size in texels.
        per_metre: (m, 2) texels of level 0 per unit of u and v.
        tiled: (m,) whether the texture repeats (else it is clamped).
        emission: (m,) radiance added per unit of albedo.
    """

    texels: F32
    offset: I32
    height: I32
    width: I32
    per_metre: F32
    tiled: npt.NDArray[np.bool_]
    emission: F32

    def sample(self, material: I32, uv: F32, footprint: F32) -> F32:
        """(n, 3) linear albedo at `uv` (n, 2), bilinear in the mip level nearest to `footprint` (n,) level-0 texels."""
        level = np.clip(np.rint(np.log2(np.maximum(footprint, 1e-6))), 0, _LEVELS - 1).astype(np.int32)
        high, wide = self.height[material, level], self.width[material, level]
        shrink = np.exp2(-level).astype(np.float32)
        x = uv[:, 0] * self.per_metre[material, 0] * shrink - np.float32(0.5)
        y = uv[:, 1] * self.per_metre[material, 1] * shrink - np.float32(0.5)
        x0, y0 = np.floor(x), np.floor(y)
        fx, fy = (x - x0)[:, None], (y - y0)[:, None]
        tiled = self.tiled[material]
        left, right = _wrapped(x0.astype(np.int32), wide, tiled)
        top, low = _wrapped(y0.astype(np.int32), high, tiled)
        start = self.offset[material, level]
        upper, lower = start + top * wide, start + low * wide
        take = self.texels.take
        above = take(upper + left, 0) * (1 - fx) + take(upper + right, 0) * fx
        below = take(lower + left, 0) * (1 - fx) + take(lower + right, 0) * fx
        return np.asarray(above * (1 - fy) + below * fy, np.float32)


def _wrapped(index: I32, size: I32, tiled: npt.NDArray[np.bool_]) -> tuple[I32, I32]:
    """`index` and its successor, wrapped into [0, size) where tiled and clamped elsewhere."""
    first = np.where(tiled, index % size, np.clip(index, 0, size - 1))
    second = np.where(tiled, (index + 1) % size, np.clip(index + 1, 0, size - 1))
    return first.astype(np.int32), second.astype(np.int32)


class MaterialTable:
    """Collects the materials of a scene; an index names a material for ever."""

    def __init__(self) -> None:
        self._pictures: list[Picture] = []
        self._extent: list[float | None] = []
        self._emission: list[float] = []

    def tiled(self, picture: Picture, metres: float, emission: float = 0.0) -> int:
        """A repeating surface; the picture's width covers `metres`."""
        return self._add(picture, metres, emission)

    def fitted(self, picture: Picture, emission: float = 0.0) -> int:
        """A picture stretched once over the quad it is used on."""
        return self._add(picture, None, emission)

    def _add(self, picture: Picture, extent: float | None, emission: float) -> int:
        self._pictures.append(picture)
        self._extent.append(extent)
        self._emission.append(emission)
        return len(self._pictures) - 1

    def build(self) -> Materials:
        """Mip levels of everything, linear light, in one array."""
        n = len(self._pictures)
        offset, height, width = (np.zeros((n, _LEVELS), np.int32) for _ in range(3))
        rows: list[F32] = []
        total = 0
        for m, picture in enumerate(self._pictures):
            for level, image in enumerate(_pyramid(picture)):
                offset[m, level], height[m, level], width[m, level] = total, image.shape[0], image.shape[1]
                rows.append(image.reshape(-1, 3))
                total += len(rows[-1])
        per_metre = np.array(
            [(p.shape[1], p.shape[0]) if e is None else (p.shape[1] / e,) * 2
             for p, e in zip(self._pictures, self._extent, strict=True)], np.float32,
        )  # fmt: skip
        return Materials(
            np.concatenate(rows), offset, height, width, per_metre,
            np.array([e is not None for e in self._extent]), np.array(self._emission, np.float32),
        )  # fmt: skip


def _pyramid(picture: Picture) -> list[F32]:
    """Levels of half size each, averaged in linear light."""
    image = (np.clip(picture, 0, 1) ** GAMMA).astype(np.float32)
    levels = [image]
    for _ in range(_LEVELS - 1):
        size = (max(1, image.shape[1] // 2), max(1, image.shape[0] // 2))
        image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.float32)
        levels.append(image)
    return levels
