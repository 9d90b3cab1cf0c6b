"""Trajectory errors as evo and the TUM RGB-D benchmark define them (Sturm et al. 2012)."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, TypeVar

import numpy as np
import numpy.typing as npt

from stsem.pose import Pose, Trajectory, inverse

_T = TypeVar("_T")

Poses = npt.NDArray[np.float64]
"""(n, 4, 4) float64, T_WC."""

MIN_POSES = 3

MAX_DIFFERENCE_NS = 20_000_000
"""Stamps of an estimated and a true pose farther apart do not match (the TUM RGB-D benchmark's 20 ms)."""


@dataclass(frozen=True)
class Errors:
    """Statistics of n errors, in the unit stated where they are returned; `std` is that of the population."""

    rmse: float
    mean: float
    median: float
    std: float
    min: float
    max: float
    n: int


@dataclass(frozen=True)
class RelativeErrors:
    """Relative pose errors: translation in metres, rotation in degrees."""

    translation_m: Errors
    rotation_deg: Errors


def umeyama(source: npt.NDArray[np.float64], target: npt.NDArray[np.float64]) -> Pose:
    """The rigid T (4, 4) that minimises sum |target - T source|^2 (Umeyama 1991, equations 34-43 with c = 1).

    Args:
        source, target: (n, 3) positions, matched by row.

    Raises:
        ValueError: fewer than 3 points, or points on one line: the rotation is not determined.
    """
    if source.shape != target.shape or source.ndim != 2 or source.shape[1] != 3 or len(source) < MIN_POSES:
        raise ValueError(
            f"an alignment needs two (n, 3) sets of n >= {MIN_POSES} points: {source.shape}, {target.shape}"
        )
    mean_source, mean_target = source.mean(axis=0), target.mean(axis=0)  # eq. 34, 35
    covariance = (target - mean_target).T @ (source - mean_source) / len(source)  # eq. 38
    U, singular, Vt = np.linalg.svd(covariance)  # between eq. 38 and 39
    if np.count_nonzero(singular > 1e-12 * singular[0]) < 2:
        raise ValueError("an alignment needs points that do not lie on one line")
    S = np.diag([1.0, 1.0, np.sign(np.linalg.det(U) * np.linalg.det(Vt))])  # eq. 43
    T = np.eye(4)
    T[:3, :3] = U @ S @ Vt  # eq. 40
    T[:3, 3] = mean_target - T[:3, :3] @ mean_source  # eq. 41
    return T


def associate(
    first_ns: npt.NDArray[np.int64], second_ns: npt.NDArray[np.int64], max_difference_ns: int = 10_000_000
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Indices into two ascending stamp lists that match: nearest stamps at most `max_difference_ns` apart.

    The shorter list looks for partners in the longer one and takes the earlier of two equally near ones; a partner can
    be taken twice (evo's rule).
    """
    if len(first_ns) > len(second_ns):
        back, forth = associate(second_ns, first_ns, max_difference_ns)
        return forth, back
    if len(first_ns) == 0:
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    after = np.clip(np.searchsorted(second_ns, first_ns), 1, max(1, len(second_ns) - 1))
    before = after - 1
    after = np.minimum(after, len(second_ns) - 1)
    later = np.abs(second_ns[after] - first_ns) < np.abs(first_ns - second_ns[before])
    nearest = np.where(later, after, before)
    kept = np.abs(second_ns[nearest] - first_ns) <= max_difference_ns
    return np.flatnonzero(kept), nearest[kept]


def absolute_errors(estimate: Poses, truth: Poses, *, align: bool = True) -> Errors:
    """ATE in metres: |p_truth - T p_estimate| over matched poses (n, 4, 4); T by `umeyama` if `align`.

    Raises:
        ValueError: the poses cannot be aligned, see `umeyama`; or there is none.
    """
    found, wanted = estimate[:, :3, 3], truth[:, :3, 3]
    if align:
        T = umeyama(found, wanted)
        found = found @ T[:3, :3].T + T[:3, 3]
    return statistics(np.linalg.norm(found - wanted, axis=1))


def relative_errors(estimate: Poses, truth: Poses, delta: int = 1) -> RelativeErrors:
    """RPE over pairs (i, i + delta), i = 0, delta, 2 delta, ...: (Q_i^-1 Q_i+d)^-1 (P_i^-1 P_i+d) (Sturm 2012, eq. 1).

    Args:
        estimate, truth: (n, 4, 4) matched poses, P and Q.
        delta: frames between the two poses of a pair.

    Raises:
        ValueError: there is no pair.
    """
    starts = np.arange(0, len(truth) - delta, delta) if delta > 0 else np.zeros(0, np.int64)
    if len(starts) == 0:
        raise ValueError(f"{len(truth)} poses have no pair that is {delta} apart")
    return _errors_of_pairs(estimate, truth, starts, starts + delta)


def relative_errors_per_metre(estimate: Poses, truth: Poses, metres: float = 1.0) -> RelativeErrors:
    """RPE over all pairs that are `metres` apart along the true path, see `pairs_apart`.

    Equal to evo's with all pairs, taken from the reference.

    Raises:
        ValueError: there is no pair.
    """
    steps = np.linalg.norm(np.diff(truth[:, :3, 3], axis=0), axis=1)
    first, second = pairs_apart(np.concatenate([[0.0], np.cumsum(steps)]), metres)
    return _errors_of_pairs(estimate, truth, first, second)


def relative_errors_per_second(
    stamps_ns: npt.NDArray[np.int64], estimate: Poses, truth: Poses, seconds: float = 1.0
) -> RelativeErrors:
    """RPE over all pairs of poses that are `seconds` apart to within 5 % by their stamps (n,); see `pairs_apart`.

    Raises:
        ValueError: there is no pair.
    """
    since_first = (stamps_ns - stamps_ns[:1]).astype(np.float64)
    first, second = pairs_apart(since_first, seconds * 1e9, tolerance=0.05)
    return _errors_of_pairs(estimate, truth, first, second)


def pairs_apart(
    progress: npt.NDArray[np.float64], delta: float, tolerance: float = 0.1
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Rows (i, j), j > i, of all pairs that are `delta` apart in `progress` (n,), which never falls.

    For every i that j whose distance from i comes closest to `delta`, the first of equals; the pair counts if it is
    `delta` to within `tolerance` as a share of it (evo's rule for all pairs).
    """
    rows = np.arange(max(len(progress) - 1, 0))
    if len(rows) == 0:
        return rows, rows
    after = np.searchsorted(progress, progress[:-1] + delta).clip(rows + 1, len(rows))
    before = np.maximum(np.searchsorted(progress, progress[np.maximum(after - 1, rows + 1)]), rows + 1)
    off_before = np.abs(progress[before] - progress[:-1] - delta)
    off_after = np.abs(progress[after] - progress[:-1] - delta)
    nearest = np.where(off_before <= off_after, before, after)
    kept = np.minimum(off_before, off_after) <= tolerance * delta
    return rows[kept], nearest[kept]


def rotation_angle(pose: Pose) -> float:
    """Angle of the rotation in radians, 0..pi, by the atan2 of sine and cosine (exact near 0 and pi)."""
    R = pose[:3, :3]
    sine = float(np.linalg.norm([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])) / 2
    return float(np.arctan2(sine, (np.trace(R) - 1) / 2))


def statistics(errors: npt.NDArray[np.float64]) -> Errors:
    """Statistics of errors (n,).

    Raises:
        ValueError: there is none.
    """
    if len(errors) == 0:
        raise ValueError("there are no errors to summarise")
    return Errors(
        rmse=float(np.sqrt(np.mean(errors**2))), mean=float(errors.mean()), median=float(np.median(errors)),
        std=float(errors.std()), min=float(errors.min()), max=float(errors.max()), n=len(errors),
    )  # fmt: skip


@dataclass(frozen=True)
class TrajectoryAccuracy:
    """How good an estimated trajectory is; None where it cannot be told.

    Args:
        ate: absolute errors in metres, aligned without scale.
        per_metre, per_second: relative errors over 1 m of the true path, and over 1 s.
        matched: poses that have a true one.
    """

    ate: Errors | None
    per_metre: RelativeErrors | None
    per_second: RelativeErrors | None
    matched: int


def accuracy(
    estimate: Trajectory, truth: Trajectory, *, max_difference_ns: int = MAX_DIFFERENCE_NS
) -> TrajectoryAccuracy:
    """Judge an estimate against the truth, poses matched by `associate`.

    Args:
        estimate: a pose for each frame that was tracked, none for one that was not.
        truth: in any other world frame.
        max_difference_ns: stamps farther apart do not match.
    """
    rows, true_rows = associate(estimate.stamps_ns, truth.stamps_ns, max_difference_ns)
    found, wanted, stamps_ns = estimate.poses[rows], truth.poses[true_rows], estimate.stamps_ns[rows]
    return TrajectoryAccuracy(
        ate=_unless_refused(lambda: absolute_errors(found, wanted)),
        per_metre=_unless_refused(lambda: relative_errors_per_metre(found, wanted)),
        per_second=_unless_refused(lambda: relative_errors_per_second(stamps_ns, found, wanted)),
        matched=len(rows),
    )


class TrajectoryMeter:
    """Accumulates matched poses of an estimated and a true trajectory."""

    unit: ClassVar[str] = "m"
    higher_is_better: ClassVar[bool] = False

    def __init__(self) -> None:
        self._estimate: list[Pose] = []
        self._truth: list[Pose] = []

    def update(self, estimate: Pose, truth: Pose) -> None:
        """Add one pair of poses (4, 4), T_WC."""
        self._estimate.append(estimate)
        self._truth.append(truth)

    def compute(self) -> Errors | None:
        """ATE so far; None while the poses cannot be aligned."""
        found, wanted = (np.array(poses).reshape(-1, 4, 4) for poses in (self._estimate, self._truth))
        return _unless_refused(lambda: absolute_errors(found, wanted))


def _unless_refused(measure: Callable[[], _T]) -> _T | None:
    """What `measure` gives; None where it says that there is too little to measure."""
    try:
        return measure()
    except ValueError:
        return None


def _errors_of_pairs(
    estimate: Poses, truth: Poses, first: npt.NDArray[np.int64], second: npt.NDArray[np.int64]
) -> RelativeErrors:
    """Of pairs given by their rows (m,).

    Raises:
        ValueError: there is none.
    """
    true_motion = inverse(truth[first]) @ truth[second]
    errors = inverse(true_motion) @ (inverse(estimate[first]) @ estimate[second])
    return RelativeErrors(
        translation_m=statistics(np.linalg.norm(errors[:, :3, 3], axis=1)),
        rotation_deg=statistics(np.degrees([rotation_angle(error) for error in errors])),
    )
