"""The labelled scene: points of keyframes moved into the world and merged (equation 3 of the paper).

Equation 3 takes the union of all clouds. Here it is thinned: of the points that fall into one cell of a grid the first
stays, in order of keyframes and of pixels. No label is ever revised.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stsem.camera import Camera
from stsem.classes import NO_LABEL, Labels
from stsem.frame import Depth, Image
from stsem.pose import Pose

CELL_BITS = 21
HALF_RANGE = 1 << (CELL_BITS - 1)


@dataclass(frozen=True, eq=False)
class LabelledPoints:
    """Points with a class.

    Args:
        xyz: (n, 3) float64, world coordinates, metres.
        rgb: (n, 3) uint8, colour seen by the camera.
        labels: (n,) uint8 class ids, never NO_LABEL.
    """

    xyz: npt.NDArray[np.float64]
    rgb: npt.NDArray[np.uint8]
    labels: Labels

    def __len__(self) -> int:
        return len(self.xyz)

    def take(self, rows: npt.NDArray[np.intp]) -> "LabelledPoints":
        """The points at `rows`, in that order."""
        return LabelledPoints(self.xyz[rows], self.rgb.take(rows, axis=0), self.labels[rows])

    def part(self, rows: slice) -> "LabelledPoints":
        """The points of `rows`, which shares their memory."""
        return LabelledPoints(self.xyz[rows], self.rgb[rows], self.labels[rows])


def backproject(
    depth: Depth, labels: Labels, image: Image, camera: Camera, T_WC: Pose, *, max_depth_m: float = 10.0
) -> LabelledPoints:
    """The labelled pixels of one frame as points of the world, row by row: X_W = T_WC z K^-1 (u, v, 1).

    The paper calls the matrix of equation 3 T_cw but describes it as camera to world; here it is T_WC.

    Args:
        depth: (H, W) float32 metres along z, NaN unknown.
        labels: (H, W) uint8; pixels with NO_LABEL make no point.
        image: (H, W, 3) uint8 RGB.
        camera: undistorted, of the size of these images.
        T_WC: (4, 4) world from camera.
        max_depth_m: farther points are left out: depth cameras are noise there.

    Raises:
        ValueError: sizes differ, or the camera is distorted.
    """
    size = (camera.height, camera.width)
    if not depth.shape == labels.shape == image.shape[:2] == size or camera.is_distorted:
        raise ValueError(
            f"depth {depth.shape}, labels {labels.shape}, image {image.shape} must have the size of an undistorted "
            f"camera, but it is {size}, distortion {camera.distortion}"
        )
    with np.errstate(invalid="ignore"):
        known = (depth > 0) & (depth <= max_depth_m) & (labels != NO_LABEL)
    rows = np.flatnonzero(known)
    z = depth.ravel()[rows].astype(np.float64)
    x = ((np.arange(camera.width) - camera.cx) / camera.fx)[None, :]
    y = ((np.arange(camera.height) - camera.cy) / camera.fy)[:, None]
    xyz = np.empty((3, len(rows)), np.float64)
    for axis in range(3):
        # Written out instead of a matrix product: BLAS may round differently with other thread counts.
        ray = T_WC[axis, 0] * x + (T_WC[axis, 1] * y + T_WC[axis, 2])
        np.multiply(ray.ravel()[rows], z, out=xyz[axis])
        xyz[axis] += T_WC[axis, 3]
    return LabelledPoints(xyz.T, image.reshape(-1, 3).take(rows, axis=0), labels.ravel()[rows])


class LabelledCloud:
    """A growing map with one point per cell.

    Args:
        cell_m: edge of a cell, metres.
        max_points: when the map is full, points in new cells are counted in `left_out` and forgotten.
    """

    def __init__(self, cell_m: float = 0.05, max_points: int = 4_000_000) -> None:
        if not cell_m > 0:
            raise ValueError(f"the edge of a cell must be positive, but {cell_m} came")
        self.cell_m = cell_m
        self.left_out = 0
        self._max_points = max_points
        self._origin: tuple[float, ...] | None = None
        self._keys = np.empty(0, np.int64)
        self._parts = [LabelledPoints(np.empty((0, 3)), np.empty((0, 3), np.uint8), np.empty(0, np.uint8))]

    def __len__(self) -> int:
        return len(self._keys)

    @property
    def points(self) -> LabelledPoints:
        """The map: keyframe after keyframe, the points of one in order of cells."""
        return LabelledPoints(
            np.concatenate([part.xyz for part in self._parts]),
            np.concatenate([part.rgb for part in self._parts]),
            np.concatenate([part.labels for part in self._parts]),
        )

    def add(self, points: LabelledPoints) -> int:
        """Merge the points of one keyframe; returns how many cells are new. Earlier points are never replaced.

        Points that are not finite, or more than a million cells from the first point ever, are counted in `left_out`.
        """
        keys, rows = self._first_per_cell(points)
        at = np.searchsorted(self._keys, keys)
        known = at < len(self)
        known[known] = self._keys[at[known]] == keys[known]
        new = np.flatnonzero(~known)
        room = self._max_points - len(self)
        self.left_out += max(0, len(new) - room)
        new = new[:room]
        if len(new):
            self._keys = np.insert(self._keys, at[new], keys[new])
            self._parts.append(points.take(rows[new]))
        return len(new)

    def _first_per_cell(self, points: LabelledPoints) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.intp]]:
        """Ascending keys of the cells hit, and the row of the first point in each."""
        cells = [np.floor(points.xyz[:, axis] / self.cell_m) for axis in range(3)]
        if self._origin is None:
            self._origin = _first_finite(cells)
        steps = [cell - first for cell, first in zip(cells, self._origin or (0.0, 0.0, 0.0), strict=True)]
        rows = np.flatnonzero(_within(steps[0]) & _within(steps[1]) & _within(steps[2]))
        self.left_out += len(points) - len(rows)
        x, y, z = (step[rows].astype(np.int64) + HALF_RANGE for step in steps)
        keys = (x << 2 * CELL_BITS) | (y << CELL_BITS) | z
        # Neighbouring pixels share cells: dropping runs first leaves a fraction to sort, and keeps who was first.
        starts = np.flatnonzero(np.diff(keys, prepend=~keys[:1]))
        unique, first = np.unique(keys[starts], return_index=True)
        return unique, rows[starts[first]]


def _first_finite(cells: list[npt.NDArray[np.float64]]) -> tuple[float, ...] | None:
    """The cell of the first point that has one."""
    rows = np.flatnonzero(np.isfinite(cells[0]) & np.isfinite(cells[1]) & np.isfinite(cells[2]))
    return tuple(float(cell[rows[0]]) for cell in cells) if len(rows) else None


def _within(steps: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    """Whether a key has room for the step; never for NaN."""
    return np.asarray((steps >= -HALF_RANGE) & (steps < HALF_RANGE))
