"""Steps of a pose that are no motion: a relocalisation, a glitch, a filter that was restarted."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from stsem.log.poses.edges import Edge
from stsem.log.poses.source import compose
from stsem.log.tracks import Float64, Int64
from stsem.pose import Trajectory

MIN_SPEED, MIN_DISTANCE = 5.0, 0.3
"""m/s and m: a jump exceeds both ..."""
MIN_TURN_RATE, MIN_TURN = 720.0, 20.0
"""... or both of these, deg/s and deg ..."""
TIMES_USUAL = 5.0
"""... and this many times the usual speed of the steps around it: a car on a road does not jump."""
AROUND = 5


@dataclass(frozen=True)
class Jump:
    """One jump of the pose.

    Args:
        stamp_ns: of the first sample behind it.
        metres, degrees: how far.
        edge: name of the edge that jumps.
    """

    stamp_ns: int
    metres: float
    degrees: float
    edge: str


def mark_jumps(edges: Sequence[Edge]) -> tuple[tuple[Edge, ...], tuple[Jump, ...]]:
    """(the chain with its jumps marked as broken, the jumps in order of time).

    How far an edge jumps is measured where the camera is: a correction of two degrees 100 m from the origin of its
    frame moves the frame by metres and the camera hardly at all.
    """
    marked: list[Edge] = []
    jumps: list[Jump] = []
    for k, edge in enumerate(edges):
        if edge.static or len(edge.trajectory) < 2:
            marked.append(edge)
            continue
        camera = compose(edges[k + 1 :], edge.trajectory.stamps_ns)[:, :3, 3]
        metres, degrees = _steps(edge.trajectory, camera)
        broken = _broken(edge.trajectory.stamps_ns, metres, degrees)
        rows = np.flatnonzero(broken)
        jumps += [
            Jump(int(edge.trajectory.stamps_ns[i + 1]), float(metres[i]), float(degrees[i]), edge.name) for i in rows
        ]
        if len(rows):
            edge = replace(edge, trajectory=replace(edge.trajectory, broken=broken))
        marked.append(edge)
    return tuple(marked), tuple(sorted(jumps, key=lambda jump: jump.stamp_ns))


def _steps(trajectory: Trajectory, point: Float64) -> tuple[Float64, Float64]:
    """((n - 1,) metres that `point` (n, 3), fixed in the child frame, moves per step; (n - 1,) degrees per step)."""
    before, after, p = trajectory.poses[:-1], trajectory.poses[1:], point[1:, :, None]
    moved = (after[:, :3, :3] - before[:, :3, :3]) @ p + after[:, :3, 3:] - before[:, :3, 3:]
    # |R_a - R_b|_F = 2 sqrt(2) |sin(angle / 2)|
    chord = np.linalg.norm(after[:, :3, :3] - before[:, :3, :3], axis=(1, 2)) / np.sqrt(8)
    return np.linalg.norm(moved[..., 0], axis=1), np.degrees(2 * np.arcsin(np.minimum(chord, 1)))


def _broken(stamps_ns: Int64, metres: Float64, degrees: Float64) -> npt.NDArray[np.bool_]:
    seconds = np.diff(stamps_ns) / 1e9
    far = _outliers(metres / seconds, MIN_SPEED) & (metres > MIN_DISTANCE)
    return far | (_outliers(degrees / seconds, MIN_TURN_RATE) & (degrees > MIN_TURN))


def _outliers(speed: Float64, least: float) -> npt.NDArray[np.bool_]:
    """Which of the steps are faster than `least` and than TIMES_USUAL times the median of those around them."""
    fast = np.flatnonzero(speed > least)
    around = fast[:, None] + np.array([k for k in range(-AROUND, AROUND + 1) if k])
    inside = (around >= 0) & (around < len(speed))
    usual = np.where(inside, speed[np.clip(around, 0, len(speed) - 1)], np.nan)
    result = np.zeros(len(speed), np.bool_)
    has_others = inside.any(axis=1)
    median = np.zeros(len(fast))
    median[has_others] = np.nanmedian(usual[has_others], axis=1)
    result[fast] = speed[fast] > TIMES_USUAL * median
    return result
