"""Made-up rooms: four walls, floor and ceiling with points that can be told apart; rooms may look exactly alike."""

import numpy as np
import numpy.typing as npt

from stsem.camera import Camera
from stsem.pose import Pose, inverse
from stsem.slam.landmarks import Landmarks
from stsem.slam.planes import plane_grid
from stsem.slam.rotations import exponential
from stsem.slam.verify import View

CAMERA = Camera(160, 120, 100.0, 100.0, 79.5, 59.5)
SIZE_M = np.array([5.0, 4.0, 2.6])
F64 = npt.NDArray[np.float64]


def facing(x: float, y: float, yaw_deg: float) -> Pose:
    """T_WC (4, 4) of a level camera 1.2 m above the floor."""
    yaw = np.radians(yaw_deg)
    T = np.eye(4)
    forward = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    right = np.array([np.sin(yaw), -np.cos(yaw), 0.0])
    T[:3, 0], T[:3, 1], T[:3, 2], T[:3, 3] = right, np.cross(forward, right), forward, (x, y, 1.2)
    return T


def bent(T: Pose, metres: float, degrees: float) -> Pose:
    """A pose that drifted along x and about z of the world."""
    drift = np.eye(4)
    drift[:3, :3], drift[0, 3] = exponential(np.array([0, 0, np.radians(degrees)])), metres
    return np.asarray(drift @ T)


class Room:
    """A box from `corner` on; the same `look` gives the same points with the same descriptors, from the corner on."""

    def __init__(self, corner: tuple[float, float], look: int) -> None:
        rng = np.random.default_rng(look)
        self._corner = np.array([*corner, 0.0])
        points = rng.uniform(0, 1, (2400, 3)) * SIZE_M
        wall = rng.integers(0, 6, len(points))
        points[np.arange(len(points)), wall % 3] = np.where(wall < 3, 0.0, SIZE_M[wall % 3])
        self._points = points + self._corner
        self._descriptors = rng.integers(0, 256, (len(points), 32), np.uint8)

    def view(self, T_WC: Pose, seed: int, *, noise: float = 0.002) -> View:
        """What a camera in the room keeps: points with a few wrong bits, depth with noise (relative)."""
        rng = np.random.default_rng(seed)
        p = (self._points - T_WC[:3, 3]) @ T_WC[:3, :3]
        ahead = np.maximum(p[:, 2], 0.05)
        xy = np.column_stack([100 * p[:, 0] / ahead + CAMERA.cx, 100 * p[:, 1] / ahead + CAMERA.cy])
        seen = np.flatnonzero((p[:, 2] > 0.3) & ((xy > 1) & (xy < [158, 118])).all(axis=1))
        seen = rng.permutation(seen)[:250]
        wrong = rng.random((len(seen), 256)) < 0.05
        descriptors = self._descriptors[seen] ^ np.packbits(wrong, axis=1)
        measured = p[seen] * (1 + rng.normal(0, noise, (len(seen), 1)))
        pixels = xy[seen] + rng.normal(0, 0.3, (len(seen), 2))
        landmarks = Landmarks(pixels.astype(np.float32), descriptors, measured.astype(np.float32))
        return View(landmarks, plane_grid(self._depth(T_WC, rng, noise), CAMERA), CAMERA)

    def _depth(self, T_WC: Pose, rng: np.random.Generator, noise: float) -> npt.NDArray[np.float32]:
        v, u = np.mgrid[:120, :160]
        rays = np.stack([(u - CAMERA.cx) / 100, (v - CAMERA.cy) / 100, np.ones(u.shape)], axis=-1) @ T_WC[:3, :3].T
        place = T_WC[:3, 3] - self._corner
        with np.errstate(divide="ignore"):
            walls = np.where(rays > 0, (SIZE_M - place) / rays, -place / rays)
        return np.asarray(walls.min(axis=-1) * (1 + rng.normal(0, noise, u.shape)), np.float32)


def nothing() -> View:
    """A view without points and depth."""
    empty = Landmarks(np.empty((0, 2), np.float32), np.empty((0, 32), np.uint8), np.empty((0, 3), np.float32))
    return View(empty, plane_grid(np.full((120, 160), np.nan, np.float32), CAMERA), CAMERA)


def off_by(found: Pose, wanted: Pose) -> tuple[float, float]:
    """Metres and degrees between two poses."""
    off = inverse(wanted) @ found
    cosine = np.clip((np.trace(off[:3, :3]) - 1) / 2, -1, 1)
    return float(np.linalg.norm(off[:3, 3])), float(np.degrees(np.arccos(cosine)))
