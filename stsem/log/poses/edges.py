"""From the logged samples of one transform to an edge that can be looked up; what is wrong with them is said."""

from dataclasses import dataclass

import numpy as np

from stsem.log.clocks import find_resets
from stsem.log.remark import Remark
from stsem.log.tracks import Float64, Int64, Samples
from stsem.pose import Trajectory, rotation

MIN_QUATERNION = 1e-9
UNIT_TOLERANCE = 0.01
MAX_METRES = 1e9
"""Farther off there is no robot, and products of such numbers overflow."""


@dataclass(frozen=True)
class Edge:
    """T_parent_child over time.

    Args:
        trajectory: its samples; a static edge has one, which holds always.
        log_ns: (n,) log times of the samples.
        static: whether it holds always.
        name: "parent -> child", or the topic of stamped poses.
    """

    trajectory: Trajectory
    log_ns: Int64
    static: bool = False
    name: str = ""


@dataclass(frozen=True)
class Cleaned:
    """The samples that are transforms, in order of log time.

    Args:
        stamps_ns, log_ns: (n,).
        poses: (n, 4, 4).
        warnings: one sentence for each kind of trouble.
    """

    stamps_ns: Int64
    log_ns: Int64
    poses: Float64
    warnings: tuple[str, ...]

    def distinct(self) -> int:
        """How many different transforms there are among them, up to how often they change."""
        changed = (self.poses[1:] != self.poses[:-1]).any(axis=(1, 2))
        return int(changed.sum()) + (len(self.poses) > 0)


def clean(samples: Samples, what: str) -> Cleaned:
    """The samples without those that are no transforms; `what` names them in warnings, as in "poses of /odom"."""
    stamps, logs, t, q = samples.arrays()
    with np.errstate(over="ignore", invalid="ignore"):
        norm = np.linalg.norm(q, axis=1)
        good = (np.abs(t) < MAX_METRES).all(axis=1) & np.isfinite(norm) & (norm >= MIN_QUATERNION)
    rows = np.flatnonzero(good)
    rows = rows[np.argsort(logs[rows], kind="stable")]
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3, :3] = rotation(q[rows] / norm[rows, None])
    poses[:, :3, 3] = t[rows]
    return Cleaned(stamps[rows], logs[rows], poses, _value_warnings(norm[rows], len(stamps) - len(rows), what))


def _value_warnings(norm: Float64, left_out: int, what: str) -> tuple[str, ...]:
    warnings: list[str] = []
    if left_out:
        sentence = f"{left_out} {what} are not finite or have a zero quaternion: left out."
        warnings.append(Remark("pose-values", sentence))
    off = np.abs(norm - 1)
    if far := int((off > UNIT_TOLERANCE).sum()):
        length = float(norm[off.argmax()])
        sentence = f"{far} {what} have quaternions that are not of unit length (up to {length:.3g}): normalised."
        warnings.append(Remark("pose-values", sentence))
    return tuple(warnings)


def moving_edge(cleaned: Cleaned, name: str, what: str) -> tuple[Edge | None, list[str]]:
    """(edge with strictly ascending stamps, warnings); of equal stamps the one logged first counts."""
    warnings = list(cleaned.warnings)
    if not len(cleaned.stamps_ns):
        return None, warnings
    unique, first, group = np.unique(cleaned.stamps_ns, return_index=True, return_inverse=True)
    poses = cleaned.poses[first]
    if len(unique) < len(group):
        other = int((cleaned.poses != poses[group]).any(axis=(1, 2)).sum())
        if other:
            sentence = f"{other} {what} have the stamp of an earlier one and another value: left out."
            warnings.append(Remark("pose-values", sentence))
    if resets := find_resets(cleaned.stamps_ns, cleaned.log_ns):
        sentence = (
            f"The stamps of the {what} go back by {resets[0].back_ns / 1e9:.3f} s at log time {resets[0].log_ns} ns: "
            "their clock was set back, and poses of two times are mixed up."
        )
        warnings.append(Remark("clock-reset", sentence))
    return Edge(Trajectory(unique, poses), cleaned.log_ns[first], name=name), warnings


def static_edge(cleaned: Cleaned, name: str) -> Edge | None:
    """An edge that holds always: the transform that was logged last."""
    if not len(cleaned.stamps_ns):
        return None
    return Edge(Trajectory(cleaned.stamps_ns[-1:], cleaned.poses[-1:]), cleaned.log_ns[-1:], static=True, name=name)
