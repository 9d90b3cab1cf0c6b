"""The trajectories of a replay, and how good the one that SLAM found is."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from stsem.document.accuracy import Score
from stsem.document.trajectory import PoseSide, TrajectoryScore
from stsem.log.log import Log
from stsem.metrics.trajectory import MIN_POSES, RelativeErrors, TrajectoryAccuracy, accuracy, associate, umeyama
from stsem.pose import Trajectory
from stsem.replay.posing import Posing, log_poses
from stsem.stages.track import SlamTracker


@dataclass(frozen=True, eq=False)
class Trajectories:
    """Poses at the capture stamps of the frames.

    Args:
        log: of the log's own poses; None without any.
        slam: as SLAM knows them in the end; None where it did not run.
        used: the one that stages saw; None without any.
    """

    log: Trajectory | None
    slam: Trajectory | None
    used: Trajectory | None


def trajectories(log: Log, posing: Posing, tracker: SlamTracker | None) -> Trajectories:
    """Both sources; a frame without a pose is not in its trajectory."""
    own, found = log_poses(log), None if tracker is None else _of_slam(tracker)
    return Trajectories(own, found, found if posing.source == "slam" else own)


def side_by_side(found: Trajectories) -> dict[str, Trajectory]:
    """SLAM's trajectory and the log's, brought onto each other as for the ATE; empty where SLAM did not run.

    Where they cannot be aligned SLAM's stands alone.
    """
    if found.slam is None:
        return {}
    if found.log is None:
        return {"slam": found.slam}
    rows, true_rows = associate(found.slam.stamps_ns, found.log.stamps_ns, 0)
    try:
        T = umeyama(found.slam.poses[rows, :3, 3], found.log.poses[true_rows, :3, 3])
    except ValueError:
        return {"slam": found.slam}
    return {"log": found.log, "slam": Trajectory(found.slam.stamps_ns, T @ found.slam.poses)}


def score(
    log: Log, posing: Posing, tracker: SlamTracker | None, offline: Mapping[str, Score | None]
) -> TrajectoryScore | None:
    """The report's part on the poses used; None where no frame has any.

    Args:
        log, posing: of the replay.
        tracker: of the run.
        offline: source of poses -> offline score of the run with them, where predictions depend on poses.
    """
    found = trajectories(log, posing, tracker)
    if tracker is not None and found.slam is not None:
        return _of_tracking(tracker, found.slam, found.log, offline)
    if posing.source == "slam" or found.log is None or not log.plans:
        return None
    posed = sum(plan.pose_log_ns is not None for plan in log.plans)
    return TrajectoryScore(pose="log", tracked_share=posed / len(log.plans))


def why_not(log: Log, posing: Posing, scored: TrajectoryScore | None) -> dict[str, str]:
    """Keys of the trajectory's part that are null -> why."""
    if scored is None:
        return {"trajectory": posing.off or "the log has no poses"}
    if posing.source == "log":
        return {"trajectory.ate_rmse_m": "the log's poses are used as they are"}
    if log.trajectory is None:
        return {"trajectory.ate_rmse_m": "the log has no poses to compare with"}
    few = f"fewer than {MIN_POSES} poses have a counterpart in the log"
    reasons = {
        "ate_rmse_m": few if scored.n < MIN_POSES else "all poses lie on one line, along which no turn can be told",
        "rpe_translation_m": "no two compared poses are one second apart",
        "rpe_per_metre_translation_m": "no two compared poses are one metre apart",
    }
    return {f"trajectory.{key}": why for key, why in reasons.items() if getattr(scored, key) is None}


def _of_tracking(
    tracker: SlamTracker, slam: Trajectory, log: Trajectory | None, offline: Mapping[str, Score | None]
) -> TrajectoryScore:
    counts = tracker.counts
    sides = [_side("slam", slam, offline.get("slam"))]
    judged = None
    if log is not None and len(log):
        sides.insert(0, _side("log", log, offline.get("log")))
        judged = accuracy(slam, log, max_difference_ns=0)
    return TrajectoryScore(
        pose="slam", tracked_share=counts.tracked / counts.with_depth if counts.with_depth else None,
        lost=counts.lost, relocalised=counts.relocalised, keyframes=counts.keyframes, loops=counts.loops,
        sides=tuple(sides), **_errors(judged),
    )  # fmt: skip


def _side(pose: Literal["log", "slam"], path: Trajectory, offline: Score | None) -> PoseSide:
    scored: dict[str, Any] = {} if offline is None else {
        "offline_miou": offline.miou, "offline_pixel_accuracy": offline.pixel_accuracy, "n": offline.n,
    }  # fmt: skip
    return PoseSide(pose=pose, used=pose == "slam", poses=len(path), path_m=_length_m(path), **scored)


def _errors(found: TrajectoryAccuracy | None) -> dict[str, float | int]:
    """The keys of `TrajectoryScore` that were measured."""
    if found is None:
        return {}
    keys: dict[str, float | int] = {"n": found.matched}
    if found.ate is not None:
        keys |= {"ate_rmse_m": found.ate.rmse, "ate_median_m": found.ate.median, "ate_max_m": found.ate.max}
    return (
        keys | _relative("rpe", "n_second", found.per_second) | _relative("rpe_per_metre", "n_metre", found.per_metre)
    )


def _relative(name: str, pairs: str, found: RelativeErrors | None) -> dict[str, float | int]:
    if found is None:
        return {}
    return {
        f"{name}_translation_m": found.translation_m.rmse, f"{name}_rotation_deg": found.rotation_deg.rmse,
        pairs: found.translation_m.n,
    }  # fmt: skip


def _of_slam(tracker: SlamTracker) -> Trajectory:
    """Frames of one stamp count once, with the first of their poses."""
    placed = tracker.trajectory()
    stamps, first = np.unique(np.array([one.stamp_ns for one in placed], np.int64), return_index=True)
    poses = np.array([placed[row].T_WC for row in first], np.float64).reshape(-1, 4, 4)
    return Trajectory(stamps, poses)


def _length_m(trajectory: Trajectory) -> float:
    return float(np.linalg.norm(np.diff(trajectory.poses[:, :3, 3], axis=0), axis=1).sum())
