"""`stsem inspect` as plain data: the summaries of a log, and the findings."""

from dataclasses import asdict, dataclass

import numpy as np

from stsem.log.doctor.checks import examine
from stsem.log.doctor.finding import Examined, Finding
from stsem.log.doctor.seen import look
from stsem.log.doctor.summaries import (
    CameraSummary,
    DepthSummary,
    FilesSummary,
    FramesSummary,
    PoseSummary,
    TruthSummary,
    camera_summary,
    depth_summary,
    files_summary,
    frames_summary,
    pose_summary,
    truth_summary,
)
from stsem.log.info import ChannelInfo
from stsem.log.log import Log


@dataclass(frozen=True)
class Inspection:
    """Everything `stsem inspect` shows.

    Args:
        log: the files as a whole.
        channels: in order of topic.
        used: role -> topic; None where there is none.
        reasons: role -> why this topic.
        frames, camera, depth, truth, pose: the summaries; None where the log has no such thing.
        clock_offsets_ns: topic -> what is taken out of its log times.
        damage, damage_text: for programs, and for people.
        findings: what looks wrong, and what to do.
        notes: what is worth knowing and needs nothing done.
    """

    log: FilesSummary
    channels: tuple[ChannelInfo, ...]
    used: dict[str, str | None]
    reasons: dict[str, str]
    frames: FramesSummary
    camera: CameraSummary | None
    depth: DepthSummary | None
    truth: TruthSummary | None
    pose: PoseSummary | None
    clock_offsets_ns: dict[str, int]
    damage: dict[str, object]
    damage_text: str
    findings: tuple[Finding, ...]
    notes: tuple[str, ...]

    def as_dict(self) -> dict[str, object]:
        """JSON-able."""
        return asdict(self)


def inspect_log(log: Log, *, full: bool = False) -> Inspection:
    """Look at a log; pixels are looked at in at most SAMPLED_FRAMES frames, evenly spread, unless `full`."""
    seen = look(log, full=full)
    info, path = log.info, log.trajectory
    examined = Examined(
        info=info,
        stamps_ns=np.array([plan.stamp_ns for plan in log.plans], np.int64),
        path=path,
        frames=frames_summary(log, seen),
        camera=camera_summary(info, log.camera) if log.camera else None,
        depth=depth_summary(info, seen) if info.choice.depth else None,
        truth=truth_summary(log.classes, seen) if log.classes else None,
        pose=pose_summary(info, path) if path is not None else None,
    )
    findings, notes = examine(examined)
    return Inspection(
        log=files_summary(info),
        channels=info.channels,
        used=asdict(info.choice),
        reasons=info.reasons,
        frames=examined.frames,
        camera=examined.camera,
        depth=examined.depth,
        truth=examined.truth,
        pose=examined.pose,
        clock_offsets_ns=info.clock_offsets_ns,
        damage=info.damage.as_dict(),
        damage_text=str(info.damage),
        findings=findings,
        notes=notes,
    )
