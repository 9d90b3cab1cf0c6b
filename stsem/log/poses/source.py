"""The camera's pose over time: a chain of edges, each looked up at the stamp and composed, as tf2 does it.

Everything is interpolated (linear, slerp) between samples at most MAX_GAP_NS apart, never extrapolated, and never over
a jump.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np
import numpy.typing as npt

from stsem.log.poses.edges import Edge
from stsem.log.tracks import Int64
from stsem.pose import Pose, Trajectory

MAX_GAP_NS = 150_000_000
BLOCK = 1 << 12
"""Stamps looked up at once: interpolation needs a kilobyte for each."""


@dataclass(frozen=True)
class PoseLookup:
    """A pose and the log time of the latest message that it needs."""

    T_WC: Pose
    log_ns: int


@dataclass(frozen=True)
class PoseTimes:
    """For each of n stamps whether its pose is known, and the log time of the latest message that it needs; (n,)."""

    known: npt.NDArray[np.bool_]
    log_ns: Int64


@dataclass(frozen=True)
class PoseSource:
    """The camera's pose as a chain of edges from the world to the camera's optical frame; one edge for stamped poses.

    Args:
        topic: of the channel that the moving edges come from.
        frames: names of the frames along the chain, the world first.
        edges: T_{frames[i]}_{frames[i+1]}.
        by_chain: whether it is a chain of transforms.
    """

    topic: str
    frames: tuple[str, ...]
    edges: tuple[Edge, ...]
    by_chain: bool

    @property
    def moving(self) -> tuple[Edge, ...]:
        """The edges that are not static."""
        return tuple(edge for edge in self.edges if not edge.static)

    def at(self, stamp_ns: int) -> PoseLookup | None:
        """T_WC at `stamp_ns`; None when an edge has no two samples close enough around it."""
        stamps = np.array([stamp_ns], np.int64)
        times = self.times(stamps)
        return PoseLookup(self.poses(stamps)[0], int(times.log_ns[0])) if times.known[0] else None

    def times(self, stamps_ns: Int64) -> PoseTimes:
        """Where the pose is known, and when it is there, for `stamps_ns` (n,)."""
        known, latest = np.ones(len(stamps_ns), np.bool_), np.full(len(stamps_ns), np.iinfo(np.int64).min)
        for edge in self.moving:
            found = edge.trajectory.brackets(stamps_ns, MAX_GAP_NS)
            known &= found.known
            # the earlier sample may be the one that came last
            latest = np.maximum(latest, np.maximum(edge.log_ns[found.earlier], edge.log_ns[found.later]))
        return PoseTimes(known, latest)

    def poses(self, stamps_ns: Int64) -> Pose:
        """(n, 4, 4) T_WC at `stamps_ns` (n,), all of which must be known."""
        return compose(self.edges, stamps_ns)

    def stamps_ns(self) -> Int64:
        """Ascending union of the stamps of the moving edges."""
        return np.unique(np.concatenate([edge.trajectory.stamps_ns for edge in self.moving]))

    def trajectory(self) -> Trajectory:
        """T_WC at every stamp of `stamps_ns` at which the whole chain is known."""
        stamps = self.stamps_ns()
        stamps = stamps[self.times(stamps).known]
        broken = np.zeros(max(len(stamps) - 1, 0), np.bool_)
        for edge in self.moving:
            if edge.trajectory.broken is not None and len(broken):
                before = edge.trajectory.stamps_ns[:-1][edge.trajectory.broken]
                steps = np.searchsorted(stamps, before, side="right") - 1
                broken[steps[(steps >= 0) & (steps < len(broken))]] = True
        return Trajectory(stamps, self.poses(stamps), broken if broken.any() else None)

    def offset_ns(self) -> int:
        """Smallest (log time - stamp) of a moving edge; of several, that of the edge on which it is nearest to 0.

        An edge whose publisher dates its transforms ahead or late (localisation does) says nothing about the clock.
        """
        return min((int((edge.log_ns - edge.trajectory.stamps_ns).min()) for edge in self.moving), key=abs)


def compose(edges: Sequence[Edge], stamps_ns: Int64) -> Pose:
    """(n, 4, 4) product of the edges at `stamps_ns` (n,); where an edge is not known, of the sample nearby."""
    if all(edge.static for edge in edges):
        return np.broadcast_to(_product(edges, stamps_ns[:0]), (len(stamps_ns), 4, 4))
    result = np.empty((len(stamps_ns), 4, 4))
    for start in range(0, len(stamps_ns), BLOCK):
        block = slice(start, start + BLOCK)
        result[block] = _product(edges, stamps_ns[block])
    return result


def _product(edges: Sequence[Edge], stamps_ns: Int64) -> Pose:
    factors = []
    for edge in edges:
        if edge.static:
            factors.append(edge.trajectory.poses[0])
            continue
        found = edge.trajectory.brackets(stamps_ns, MAX_GAP_NS)
        earlier = np.where(found.known, found.earlier, found.later)
        factors.append(edge.trajectory.between(stamps_ns, earlier, found.later))
    return reduce(np.matmul, factors, np.eye(4))
