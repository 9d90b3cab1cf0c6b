"""Where the poses of a replay come from: the log's own, or SLAM; and what SLAM lacks where it cannot run."""

from collections.abc import Generator
from contextlib import closing
from dataclasses import dataclass, replace

import numpy as np

from stsem.log.log import Loaded, Log
from stsem.log.poses.source import MAX_GAP_NS
from stsem.pose import Trajectory
from stsem.replay.config import PoseSource, RunConfig


@dataclass(frozen=True)
class Posing:
    """What a replay does about poses.

    Args:
        source: as asked for.
        off: what SLAM lacks in this log; "" when nothing, and for the log's own poses.
    """

    source: PoseSource
    off: str = ""

    @property
    def tracks(self) -> bool:
        """Whether SLAM runs: `track` is a stage, and no other stage sees a pose of the log."""
        return self.source == "slam" and not self.off

    @property
    def sentence(self) -> str:
        """What a reader must know where SLAM was asked for and cannot run; "" otherwise."""
        return f"SLAM is off, and frames have no pose: {self.off}." if self.off else ""


LOG_POSES = Posing("log")


def hidden(frames: Generator[Loaded, None, None]) -> Generator[Loaded, None, None]:
    """The same frames without the log's poses, so that no stage can see them."""
    with closing(frames):
        for loaded in frames:
            frame = None if loaded.frame is None else replace(loaded.frame, T_WC=None)
            yield replace(loaded, frame=frame)


def posing(log: Log, config: RunConfig) -> Posing:
    """Where the poses come from."""
    return Posing(config.pose, _lacking(log) if config.pose == "slam" else "")


def can_map(log: Log, config: RunConfig) -> bool:
    """Whether a map is wanted, and the log has what it needs."""
    source = posing(log, config)
    posed = source.tracks if config.pose == "slam" else log.info.choice.pose is not None
    return config.map and posed and log.info.choice.depth is not None and _is_straight(log)


def log_poses(log: Log) -> Trajectory | None:
    """The log's own poses, interpolated at the stamps of the frames that have one; None without any."""
    if log.trajectory is None:
        return None
    stamps = np.unique(np.fromiter((plan.stamp_ns for plan in log.plans), np.int64, len(log.plans)))
    found = log.trajectory.brackets(stamps, MAX_GAP_NS)
    known = stamps[found.known]
    return Trajectory(known, log.trajectory.between(known, found.earlier[found.known], found.later[found.known]))


def can_track(log: Log) -> bool:
    """Whether the log has what SLAM takes."""
    return not _lacking(log)


def _lacking(log: Log) -> str:
    if log.info.choice.depth is None:
        return "the log has no depth channel that can be used"
    if not _is_straight(log):
        return "the log states no intrinsics of a camera without distortion"
    return ""


def _is_straight(log: Log) -> bool:
    return log.camera is not None and not log.camera.is_distorted
