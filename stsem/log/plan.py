"""Which messages make up a frame, and when it arrives: told by stamps and log times, before any pixel is decoded."""

from dataclasses import dataclass

import numpy as np

from stsem.errors import UsageError
from stsem.log.tracks import Int64, References

MAX_DEPTH_OFFSET_NS = 20_000_000
UNKNOWN_PERIOD_NS = 100_000_000
MAX_CANDIDATES = 16
MAX_WINDOW_S = 1e10
"""More than any two stamps can be apart; a larger number would be no integer of any use."""
NEEDS = frozenset({"depth", "pose"})


@dataclass(frozen=True, slots=True)
class FramePlan:
    """One colour frame and its partners. Log times are those of the recorder with the channel's clock offset taken out.

    Args:
        index: position among the colour frames of the window, by (stamp, log time, position in the file), from 0.
        stamp_ns: capture stamp of the colour image.
        color_log_ns: its log time.
        depth_log_ns: of its depth image; None without.
        pose_log_ns: of the last to be logged of the samples that its pose is made of; None without a pose.
        truth_log_ns: of its label image; None without.
    """

    index: int
    stamp_ns: int
    color_log_ns: int
    depth_log_ns: int | None
    pose_log_ns: int | None
    truth_log_ns: int | None

    def missing(self, needs: frozenset[str]) -> tuple[str, ...]:
        """Those of `needs` ("depth", "pose") that this frame does not have."""
        have = {"depth": self.depth_log_ns, "pose": self.pose_log_ns}
        return tuple(need for need in sorted(needs) if have[need] is None)

    def arrival_ns(self, needs: frozenset[str]) -> int:
        """Largest log time of the colour image and of what is there of `needs` (DESIGN 3, "Frames and arrival")."""
        times = {"depth": self.depth_log_ns, "pose": self.pose_log_ns}
        return max([self.color_log_ns, *(t for need in needs if (t := times[need]) is not None)])

    @property
    def has_truth(self) -> bool:
        """Whether there is a label image for this frame."""
        return self.truth_log_ns is not None


@dataclass(frozen=True)
class Partners:
    """Row numbers of the partners of each colour frame of the log; -1 for none. (n,) int64 each."""

    depth: Int64
    truth: Int64


def median_period_ns(references: References) -> int | None:
    """Median distance of the stamps; None below two messages."""
    return int(np.median(np.diff(references.stamp_ns))) if len(references) > 1 else None


def pair_depth(color: References, depth: References) -> Int64:
    """Row in `depth` for each colour frame: nearest stamp within min(20 ms, half a depth period), used once."""
    return pair(color.stamp_ns, depth.stamp_ns, depth_limit_ns(color, depth))


def depth_limit_ns(_: References, depth: References) -> int:
    """How far a depth image may be from its colour image: 20 ms, or half a depth period where that is less."""
    period = median_period_ns(depth)
    return MAX_DEPTH_OFFSET_NS if period is None else min(MAX_DEPTH_OFFSET_NS, period // 2)


def pair_truth(color: References, truth: References) -> tuple[Int64, int]:
    """(row in `truth` for each colour frame, how many are not of exactly its stamp).

    Equal stamps meet first; what is left over on both sides meets within half a colour period, each label image once.
    """
    partners = pair(color.stamp_ns, truth.stamp_ns, 0)
    free_color = np.flatnonzero(partners < 0)
    free_truth = np.setdiff1d(np.arange(len(truth)), partners)
    near = pair(color.stamp_ns[free_color], truth.stamp_ns[free_truth], truth_limit_ns(color, truth))
    found = near >= 0
    partners[free_color[found]] = free_truth[near[found]]
    return partners, int(found.sum())


def truth_limit_ns(color: References, _: References) -> int:
    """How far a label image may be from its colour image: half a colour period."""
    return (median_period_ns(color) or UNKNOWN_PERIOD_NS) // 2


def pair(wanted: Int64, offered: Int64, limit_ns: int) -> Int64:
    """(n,) row in `offered` for each of `wanted`, both ascending, at most `limit_ns` away; -1 for none.

    The closest pairs meet first (at equal distance the earlier), and each of `offered` is used once. Of more than
    MAX_CANDIDATES equal stamps the rest is not looked at.
    """
    partners = np.full(len(wanted), -1, np.int64)
    if not len(offered):
        return partners
    middle = np.searchsorted(offered, wanted)
    low = np.maximum(np.searchsorted(offered, wanted - limit_ns), middle - MAX_CANDIDATES)
    high = np.minimum(np.searchsorted(offered, wanted + limit_ns, side="right"), middle + MAX_CANDIDATES)
    counts = high - low
    owner = np.repeat(np.arange(len(wanted)), counts)
    rows = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts) + low[owner]
    distance = np.abs(offered[rows] - wanted[owner])
    used = np.zeros(len(offered), np.bool_)
    for k in np.lexsort((rows, owner, distance)):
        if partners[owner[k]] < 0 and not used[rows[k]]:
            partners[owner[k]], used[rows[k]] = rows[k], True
    return partners


def window(stamps_ns: Int64, start_s: float | None, end_s: float | None) -> slice:
    """Rows of `stamps_ns` within [start, end) seconds from the first; poses and depth outside still serve.

    Raises:
        UsageError: the window is empty.
    """
    first = int(stamps_ns[0])

    def row(seconds: float) -> int:
        return int(np.searchsorted(stamps_ns, first + round(min(max(seconds, 0.0), MAX_WINDOW_S) * 1e9)))

    low = 0 if start_s is None else row(start_s)
    high = len(stamps_ns) if end_s is None else row(end_s)
    if low >= high:
        length = (int(stamps_ns[-1]) - first) / 1e9
        raise UsageError(
            f"No colour frame lies between --start {start_s or 0:g} and --end {length if end_s is None else end_s:g}; "
            f"the log's colour frames go from 0 to {length:.3f} s."
        )
    return slice(low, high)
