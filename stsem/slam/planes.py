"""Depth as a coarse grid of small planes, which a moving camera is aligned to (after Newcombe et al. 2011).

All is done in inverse depth: there a plane is linear in the pixels, so that means and differences over a window are
exact on it, and the noise of a structured-light or stereo camera is the same at every distance.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from stsem.camera import Camera
from stsem.frame import Depth
from stsem.pose import Pose, inverse

F32 = npt.NDArray[np.float32]

COLUMNS = 160
"""Cells across the image: blocks of 4 pixels at 640, whose mean has a quarter of the noise."""
NEAREST_M, FARTHEST_M = 0.2, 10.0
BLOCK_SPREAD = 0.04
"""Relative standard deviation of inverse depth within a block above which it holds an edge."""
WINDOW_SPREAD = 0.075
"""Relative range of inverse depth in a window of 3x3 cells above which it holds an edge."""
AGREEMENT = 0.04
"""Relative difference of inverse depth up to which two views saw the same surface."""


@dataclass(frozen=True, eq=False)
class PlaneGrid:
    """Planes n.X = d of the surface in each cell, in the frame of the camera.

    Args:
        camera: pinhole camera whose pixels are the cells.
        inverse_depth: (h, w) float32, 1/m at the middle of the cell; 0 unknown.
        weight: (h, w) float32, how many views agreed on it.
        planes: (h * w, 5) float32: n (3), d in metres, inverse depth; all 0 where no plane is known.
    """

    camera: Camera
    inverse_depth: F32
    weight: F32
    planes: F32

    def points(self, step: int = 1) -> F32:
        """(n, 3) points in the middle of every `step`-th cell across and down that has a plane, metres."""
        w = self.planes[:, 4].reshape(self.inverse_depth.shape)[::step, ::step]
        known = w > 0
        z = 1 / w[known]
        x, y = _rays(self.camera)
        across, down = np.broadcast_to(x[None, ::step], w.shape), np.broadcast_to(y[::step, None], w.shape)
        return _columns(*(np.asarray(part, np.float32) for part in (across[known] * z, down[known] * z, z)))

    def cells(self, xyz: F32) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
        """(rows of `xyz` (n, 3) that fall into the grid, the cells they fall into), both (m,)."""
        camera = self.camera
        with np.errstate(divide="ignore", invalid="ignore"):
            u = xyz[:, 0] / xyz[:, 2] * np.float32(camera.fx) + np.float32(camera.cx + 0.5)
            v = xyz[:, 1] / xyz[:, 2] * np.float32(camera.fy) + np.float32(camera.cy + 0.5)
        inside = (xyz[:, 2] > NEAREST_M) & (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
        rows = np.flatnonzero(inside)
        return rows, v[rows].astype(np.intp) * camera.width + u[rows].astype(np.intp)

    def blended(self, other: "PlaneGrid", T_self_other: Pose, *, max_weight: float, memory: float) -> "PlaneGrid":
        """This grid with what another view saw of the same surfaces averaged in.

        Args:
            other: the other view.
            T_self_other: (4, 4), the other camera in this one.
            max_weight: a cell's weight never exceeds it, so that late views still count.
            memory: a cell of the other view counts at most as this many views.
        """
        known = np.flatnonzero(self.planes[:, 4] > 0)
        x, y = _rays(self.camera)
        ray_x, ray_y = x[known % self.camera.width], y[known // self.camera.width]
        mine = self.planes[known, 4]
        xyz = _columns(ray_x / mine, ray_y / mine, 1 / mine)
        back = inverse(T_self_other).astype(np.float32)
        rows, cells = other.cells(transformed(xyz, back))
        n, d = _moved_planes(other.planes[cells], T_self_other)
        known, mine = known[rows], mine[rows]
        with np.errstate(divide="ignore", invalid="ignore"):
            theirs = (n[:, 0] * ray_x[rows] + n[:, 1] * ray_y[rows] + n[:, 2]) / d
        same = np.flatnonzero((d > 1e-3) & (np.abs(theirs - mine) < AGREEMENT * mine))
        known, mine, theirs = known[same], mine[same], theirs[same]
        share = np.minimum(other.weight.reshape(-1)[cells[same]], np.float32(memory))
        w, weight = self.inverse_depth.copy(), self.weight.copy()
        before = weight.reshape(-1)[known]
        w.reshape(-1)[known] = mine + (theirs - mine) * share / (before + share)
        weight.reshape(-1)[known] = np.minimum(before + share, np.float32(max_weight))
        return PlaneGrid(self.camera, w, weight, _planes(w, self.camera))


def plane_grid(depth: Depth, camera: Camera) -> PlaneGrid:
    """The planes that one depth image shows.

    Args:
        depth: (H, W) float32 metres along z, NaN unknown.
        camera: of the depth's pixels, without distortion.
    """
    block = max(1, min(round(camera.width / COLUMNS), camera.height))
    width, height = camera.width // block, camera.height // block
    with np.errstate(divide="ignore"):
        raw = 1 / depth[: height * block, : width * block]
    valid = (raw > 1 / FARTHEST_M) & (raw < 1 / NEAREST_M)  # false for NaN
    w: F32 = np.where(valid, raw, np.float32(0)).astype(np.float32, copy=False)
    share, first, second = (_block_means(part, width, height) for part in (valid.astype(np.float32), w, w * w))
    some = np.maximum(share, np.float32(1e-6))
    mean = first / some
    good = (share >= 0.5) & (second / some - mean * mean < (BLOCK_SPREAD * mean) ** 2)
    inverse_depth = np.where(good, mean, np.float32(0))
    cx, cy = (camera.cx + 0.5) / block - 0.5, (camera.cy + 0.5) / block - 0.5
    coarse = Camera(width, height, camera.fx / block, camera.fy / block, cx, cy)
    return PlaneGrid(coarse, inverse_depth, good.astype(np.float32), _planes(inverse_depth, coarse))


def transformed(xyz: F32, T: npt.NDArray[np.float32]) -> F32:
    """T (4, 4) applied to points (n, 3), without BLAS: the same bytes for any number of threads."""
    x, y, z = xyz[:, 0], xyz[:, 1], xyz[:, 2]
    return _columns(*(x * T[k, 0] + y * T[k, 1] + z * T[k, 2] + T[k, 3] for k in range(3)))


def _planes(w: F32, camera: Camera) -> F32:
    """A plane is 1/z = a x + b y + c with a, b, c = n / d in coordinates x, y of the ray (x, y, 1)."""
    window = np.ones((3, 3), np.uint8)
    low, high = np.asarray(cv2.erode(w, window)), np.asarray(cv2.dilate(w, window))
    flat = (low > 0) & (high - low < WINDOW_SPREAD * w)
    flat[[0, -1]] = flat[:, [0, -1]] = False
    x, y = _rays(camera)
    a = np.asarray(cv2.Sobel(w, cv2.CV_32F, 1, 0, scale=camera.fx / 8), np.float32)
    b = np.asarray(cv2.Sobel(w, cv2.CV_32F, 0, 1, scale=camera.fy / 8), np.float32)
    c = w - x[None] * a - y[:, None] * b
    length = np.sqrt(a * a + b * b + c * c)
    scale = np.divide(1, length, out=np.zeros_like(length), where=flat)
    planes = np.stack([a * scale, b * scale, c * scale, scale, w * flat], axis=2)
    return np.ascontiguousarray(planes.reshape(-1, 5), np.float32)


def _rays(camera: Camera) -> tuple[F32, F32]:
    """x (w,) of the columns and y (h,) of the rows, at z = 1."""
    x = (np.arange(camera.width) - camera.cx) / camera.fx
    y = (np.arange(camera.height) - camera.cy) / camera.fy
    return x.astype(np.float32), y.astype(np.float32)


def _block_means(image: F32, width: int, height: int) -> F32:
    return np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA), np.float32)


def _columns(x: F32, y: F32, z: F32) -> F32:
    """(n, 3) with each column in one piece of memory: arithmetic on columns is several times as fast."""
    return np.stack([x, y, z]).T


def _moved_planes(planes: F32, T: Pose) -> tuple[F32, F32]:
    """Normals (n, 3) and distances (n,) of planes (n, 5) seen from the frame that `T` leads to."""
    turn = np.eye(4, dtype=np.float32)
    turn[:3, :3] = T[:3, :3]
    n = transformed(planes[:, :3], turn)
    t = T[:3, 3].astype(np.float32)
    distance: F32 = planes[:, 3] + n[:, 0] * t[0] + n[:, 1] * t[1] + n[:, 2] * t[2]
    return n, distance
