"""The plans of a log's frames in columns: a frame's plan is made when it is asked for."""

from collections.abc import Iterator, Sequence
from typing import overload

import numpy as np

from stsem.log.plan import FramePlan, Partners
from stsem.log.poses.source import PoseSource
from stsem.log.tracks import Int64, References
from stsem.packed import ABSENT, unpacked_time

BLOCK = 4096


class FramePlans(Sequence[FramePlan]):
    """Plans of frames 0 to n - 1.

    Args:
        stamp_ns: (n,) int64, capture stamps.
        logs_ns: (n,) int64 log times of colour, depth, pose and truth, ABSENT for None, as in `FramePlan`.
    """

    def __init__(self, stamp_ns: Int64, *logs_ns: Int64) -> None:
        self._columns = (stamp_ns, *logs_ns)

    def __len__(self) -> int:
        return len(self._columns[0])

    @overload
    def __getitem__(self, place: int) -> FramePlan: ...
    @overload
    def __getitem__(self, place: slice) -> list[FramePlan]: ...
    def __getitem__(self, place: int | slice) -> FramePlan | list[FramePlan]:
        chosen = range(len(self))[place]
        if not isinstance(chosen, int):
            return [self[index] for index in chosen]
        return _plan(chosen, *(int(column[chosen]) for column in self._columns))

    def __iter__(self) -> Iterator[FramePlan]:
        for start in range(0, len(self), BLOCK):
            block = (column[start : start + BLOCK].tolist() for column in self._columns)
            yield from map(_plan, range(start, len(self)), *block)


def _plan(index: int, stamp_ns: int, color_ns: int, depth_ns: int, pose_ns: int, truth_ns: int) -> FramePlan:
    return FramePlan(
        index, stamp_ns, color_ns, unpacked_time(depth_ns), unpacked_time(pose_ns), unpacked_time(truth_ns)
    )


def make_plans(
    color: References, depth: References | None, truth: References | None, partners: Partners,
    poses: PoseSource | None, rows: slice, offsets: Sequence[int],
) -> FramePlans:  # fmt: skip
    """Plans of the colour frames `rows`; `offsets` are the clock offsets of colour, depth, pose and labels."""
    color_offset, depth_offset, pose_offset, truth_offset = offsets
    return FramePlans(
        color.stamp_ns[rows],
        color.log_ns[rows] - color_offset,
        _logs(depth, partners.depth[rows], depth_offset),
        _pose_logs(poses, color.stamp_ns[rows], pose_offset),
        _logs(truth, partners.truth[rows], truth_offset),
    )


def _logs(references: References | None, rows: Int64, offset_ns: int) -> Int64:
    """(n,) log times of the partners in `rows`; ABSENT for row -1."""
    if references is None or not len(references):
        return np.full(len(rows), ABSENT)
    return np.where(rows >= 0, references.log_ns[rows] - offset_ns, ABSENT)


def _pose_logs(poses: PoseSource | None, stamps_ns: Int64, offset_ns: int) -> Int64:
    """(n,) log times of the latest message that each pose needs; ABSENT without a pose."""
    if poses is None:
        return np.full(len(stamps_ns), ABSENT)
    times = poses.times(stamps_ns)
    return np.where(times.known, times.log_ns - offset_ns, ABSENT)
