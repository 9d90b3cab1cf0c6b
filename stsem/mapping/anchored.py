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


@dataclass(frozen=True, eq=False)
class Part:
    """The points of one frame.

    Args:
        anchor: number of the keyframe they hang on.
        points: in the axes of its camera, metres.
    """

    anchor: int
    points: LabelledPoints


class AnchoredCloud:
    """Parts in the order they came.

    Args:
        cell_m: edge of a cell of the world's map, metres. A part is thinned to cells of half that edge, so that what it
            keeps still fills the map's cells wherever it is moved.
        max_points: of the world's map.
    """

    def __init__(self, cell_m: float = 0.05, max_points: int = 4_000_000) -> None:
        self._cell_m, self._max_points = cell_m, max_points
        self._parts: list[Part] = []
        self._left_out = 0

    def __len__(self) -> int:
        return len(self._parts)

    def add(self, anchor: int, points: LabelledPoints) -> int:
        """Keep the points of one frame, in the axes of the anchor; returns how many are kept."""
        thinned = LabelledCloud(self._cell_m / 2, self._max_points)
        thinned.add(points)
        self._left_out += thinned.left_out
        self._parts.append(Part(anchor, thinned.points))
        return len(thinned)

    def cloud(self, poses: Sequence[Pose]) -> LabelledCloud:
        """The map with the anchors at `poses` (T_WC of every keyframe of SLAM); parts merge in the order they came.

        Raises:
            ValueError: a part hangs on a keyframe that has no pose.
        """
        last = max((part.anchor for part in self._parts), default=-1)
        if last >= len(poses):
            raise ValueError(f"points hang on keyframe {last}, but {len(poses)} poses came")
        whole = LabelledCloud(self._cell_m, self._max_points)
        whole.left_out = self._left_out
        for part in self._parts:
            whole.add(moved(part.points, poses[part.anchor]))
        return whole


def moved(points: LabelledPoints, T: Pose) -> LabelledPoints:
    """The points in the frame that T (4, 4) leads to; without BLAS, whose rounding depends on its threads."""
    x, y, z = points.xyz.T
    xyz = np.empty((3, len(points)))
    for axis in range(3):
        xyz[axis] = T[axis, 0] * x + T[axis, 1] * y + T[axis, 2] * z + T[axis, 3]
    return LabelledPoints(xyz.T, points.rgb, points.labels)
