"""A labelled scene that can be bent: points hang on the keyframes of SLAM, and go where a closed loop moves those.

The cloud of `LabelledCloud` is in the world for good. Here each part keeps its points in the axes of the keyframe that
it was measured against (its anchor); the world is made from them with the poses known in the end. A part need not be
of the frame of its anchor: backproject it with T_KC, its camera in the anchor, in the place of T_WC.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stsem.mapping.cloud import LabelledCloud, LabelledPoints
from stsem.pose import Pose


@dataclass(frozen=True)
class Part:
    """What one frame added.

    Args:
        anchor: number of the keyframe that the points hang on.
        rows: of the points of that anchor.
    """

    anchor: int
    rows: slice


class AnchoredCloud:
    """Parts in the order they came.

    Args:
        cell_m: edge of a cell of the world's map, metres. What hangs on one anchor is thinned to cells of half that
            edge: it still fills the map's cells wherever it is moved, and a camera that stays adds nothing.
        max_points: of the world's map, and of each anchor.
    """

    def __init__(self, cell_m: float = 0.05, max_points: int = 4_000_000) -> None:
        self._cell_m, self._max_points = cell_m, max_points
        self._parts: list[Part] = []
        self._anchors: dict[int, LabelledCloud] = {}

    def __len__(self) -> int:
        return len(self._parts)

    def add(self, anchor: int, points: LabelledPoints) -> int:
        """Keep what one frame adds, in the axes of the anchor; returns how many points that are."""
        kept = self._anchors.setdefault(anchor, LabelledCloud(self._cell_m / 2, self._max_points))
        before = len(kept)
        added = kept.add(points)
        self._parts.append(Part(anchor, slice(before, before + added)))
        return added

    def cloud(self, poses: Sequence[Pose]) -> LabelledCloud:
        """The map with the anchors at `poses` (T_WC of every keyframe of SLAM); parts merge in the order they came.

        Raises:
            ValueError: a part hangs on a keyframe that has no pose.
        """
        last = max(self._anchors, default=-1)
        if last >= len(poses):
            raise ValueError(f"points hang on keyframe {last}, but {len(poses)} poses came")
        whole = LabelledCloud(self._cell_m, self._max_points)
        whole.left_out = sum(kept.left_out for kept in self._anchors.values())
        points = {anchor: kept.points for anchor, kept in self._anchors.items()}
        for part in self._parts:
            whole.add(moved(points[part.anchor].part(part.rows), poses[part.anchor]))
        return whole


def moved(points: LabelledPoints, T: Pose) -> LabelledPoints:
    """The points in the frame that T (4, 4) leads to; without BLAS, whose rounding depends on its threads."""
    x, y, z = points.xyz.T
    xyz = np.empty((3, len(points)))
    for axis in range(3):
        xyz[axis] = T[axis, 0] * x + T[axis, 1] * y + T[axis, 2] * z + T[axis, 3]
    return LabelledPoints(xyz.T, points.rgb, points.labels)
