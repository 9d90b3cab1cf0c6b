"""Depth of one camera as another camera beside it would have seen it (forward projection with a z-buffer)."""

import math

import numpy as np
import numpy.typing as npt

from stsem.camera import Camera
from stsem.frame import Depth
from stsem.pose import Pose

Float32 = npt.NDArray[np.float32]
Int32 = npt.NDArray[np.int32]
Int64 = npt.NDArray[np.int64]

SEAM = 1.1
"""Footprints are a tenth wider than the spacing of pixels, so that slanted surfaces stay closed."""
MAX_FOOTPRINT = 32
NEAREST_M = 1e-3


class DepthRegistration:
    """The way from the pixels of a depth camera to those of a colour camera, prepared once.

    A depth pixel covers in colour the whole pixels within its footprint, its own width scaled by f and z, so that
    depth of lower resolution leaves no holes; where several cover a pixel the nearest to the colour camera wins.

    Args:
        depth_camera, color_camera: without distortion.
        T_color_depth: (4, 4), depth camera to colour camera, metres, optical axes.

    Raises:
        ValueError: a camera has distortion.
    """

    def __init__(self, depth_camera: Camera, color_camera: Camera, T_color_depth: Pose) -> None:
        if depth_camera.is_distorted or color_camera.is_distorted:
            raise ValueError("depth is registered between cameras without distortion; undo it first")
        self._size, self._color = (depth_camera.height, depth_camera.width), color_camera
        x = ((np.arange(depth_camera.width) - depth_camera.cx) / depth_camera.fx)[None, :]
        y = ((np.arange(depth_camera.height) - depth_camera.cy) / depth_camera.fy)[:, None]
        K = color_camera.K
        # Homogeneous colour pixel of the point at depth z: K (R ray z + t).
        rows = K @ T_color_depth[:3, :3]
        self._rays = [(a * x + b * y + c).astype(np.float32).reshape(-1) for a, b, c in rows]
        self._origin: Float32 = (K @ T_color_depth[:3, 3]).astype(np.float32)
        self._scales = np.abs([color_camera.fx / depth_camera.fx, color_camera.fy / depth_camera.fy]).astype(np.float32)
        growth = max(color_camera.width / depth_camera.width, color_camera.height / depth_camera.height)
        self._largest = np.float32(min(2 * math.ceil(growth) + 1, MAX_FOOTPRINT))

    def __call__(self, depth: Depth) -> Depth:
        """(H, W) float32 metres along z in the colour camera, NaN unknown, from (h, w) of the depth camera.

        Raises:
            ValueError: depth of another size than its camera's.
        """
        if depth.shape != self._size:
            raise ValueError(f"depth is {depth.shape}, but its camera is {self._size}")
        z = depth.reshape(-1)
        w = self._rays[2] * z + self._origin[2]
        seen = np.flatnonzero((z > 0) & (w > NEAREST_M) & (w < np.inf))  # false for NaN
        z, w = z[seen], w[seen]
        width, height = self._color.width, self._color.height
        left, columns = self._covered(0, seen, z, w, width)
        top, rows = self._covered(1, seen, z, w, height)
        nearest = np.full(height * width, np.inf, np.float32)
        _splat(nearest, width, (top * width + left, columns, rows), w)
        nearest[np.isinf(nearest)] = np.nan
        return nearest.reshape(height, width)

    def _covered(self, axis: int, seen: Int64, z: Float32, w: Float32, end: int) -> tuple[Int32, Int32]:
        """(first, count) of the columns (axis 0) or rows (1) below `end` in each footprint; a count may be below 1."""
        inverse = 1 / w
        centre = (self._rays[axis][seen] * z + self._origin[axis]) * inverse
        half = np.clip(z * inverse * (self._scales[axis] * SEAM / 2), np.float32(0.5), self._largest / 2)
        low = np.ceil(np.clip(centre - half, -0.5, end)).astype(np.int32)
        high = np.ceil(np.clip(centre + half, -0.5, end)).astype(np.int32)
        return low, high - low


def register_depth(depth: Depth, depth_camera: Camera, color_camera: Camera, T_color_depth: Pose) -> Depth:
    """`DepthRegistration` used once: (h, w) depth of `depth_camera` to (H, W) depth of `color_camera`."""
    return DepthRegistration(depth_camera, color_camera, T_color_depth)(depth)


def _splat(nearest: Float32, width: int, footprints: tuple[Int32, Int32, Int32], z: Float32) -> None:
    """Lower `nearest` (H * W) to `z` in all pixels of the footprints (first pixel, columns, rows)."""
    first, columns, rows = footprints
    for dy in range(int(rows.max(initial=0))):
        tall = np.flatnonzero(rows > dy)
        across = columns[tall]
        for dx in range(int(across.max(initial=0))):
            wide = tall[across > dx]
            np.minimum.at(nearest, first[wide] + (dy * width + dx), z[wide])
