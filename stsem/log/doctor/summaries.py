"""The parts of an inspection: small tables of numbers, and how they come about."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from stsem.camera import Camera
from stsem.classes import NO_LABEL, ClassSet
from stsem.log.doctor.seen import Seen
from stsem.log.info import LogInfo
from stsem.log.log import Log
from stsem.log.plan import NEEDS
from stsem.log.remark import Remark
from stsem.plain import plain
from stsem.pose import Trajectory

PERCENTILES = (1, 5, 50, 95, 99)
DISTORTION = {"distortion-undone": "undone", "distortion-gone": "gone before"}
PIXELS = {"depth-registered": "projected onto those of color", "depth-assumed": "taken as those of color"}
"""Name of a remark -> what it means in two words."""


@dataclass(frozen=True)
class FilesSummary:
    """The log as a whole: its name, the names of its files, and the rest as in `LogInfo`."""

    name: str
    files: tuple[str, ...]
    sha256: str
    size_bytes: int
    duration_s: float
    profile: str
    library: str


@dataclass(frozen=True)
class FramesSummary:
    """The colour frames of the log: how many, with which partners, of what size.

    Args:
        looked_at: how many of them were decoded, or tried to.
        undecodable, dark, flat: of those looked at: not decodable, without light, of one colour only.
    """

    count: int
    with_depth: int
    with_pose: int
    with_truth: int
    width: int
    height: int
    period_ms: float
    looked_at: int
    undecodable: int
    dark: int
    flat: int


@dataclass(frozen=True)
class CameraSummary:
    """Pinhole intrinsics of the frames in pixels, the field of view in degrees, and what became of the distortion."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    across_deg: float
    down_deg: float
    distortion: str


@dataclass(frozen=True)
class DepthSummary:
    """The depth images that were looked at.

    Args:
        frames: how many.
        content: encoding or format of the channel.
        pixels: how they come to be those of color.
        unknown_share: share of pixels without depth.
        percentiles_m: per cent -> depth in metres, to the millimetre; p is sorted[ceil(p n) - 1]. Empty without depth.
    """

    frames: int
    content: str
    pixels: str
    unknown_share: float | None
    percentiles_m: dict[int, float]


@dataclass(frozen=True)
class ClassShare:
    """One class of the truth.

    Args:
        id, name: in the log's class table.
        pixels: of the frames that were looked at.
        share: of the labelled pixels (ignored ones left out); None when there are none.
    """

    id: int
    name: str
    pixels: int
    share: float | None


@dataclass(frozen=True)
class TruthSummary:
    """The label images that were looked at: their number, the share of ignored pixels, and the classes."""

    frames: int
    ignored_share: float | None
    classes: tuple[ClassShare, ...]


@dataclass(frozen=True)
class PoseSummary:
    """The camera's path.

    Args:
        frames: names along the chain that poses are composed of, the world first.
        samples: at which the whole chain is known.
        path_m: length of the path in metres, jumps left out.
        extent_m: longest side of the box around it.
        turn_deg: largest angle between the first pose and another.
        span_s, largest_gap_s: from the first to the last sample, and the longest time between two in a row.
    """

    frames: tuple[str, ...]
    samples: int
    path_m: float
    extent_m: float
    turn_deg: float
    span_s: float
    largest_gap_s: float


def files_summary(info: LogInfo) -> FilesSummary:
    """Of the log as a whole."""
    return FilesSummary(
        name=info.name, files=tuple(plain(source.name) for source in info.sources), sha256=info.sha256,
        size_bytes=info.size_bytes, duration_s=info.duration_s, profile=info.profile, library=info.library,
    )  # fmt: skip


def frames_summary(log: Log, seen: Seen) -> FramesSummary:
    """Of the colour frames."""
    missing = [plan.missing(NEEDS) for plan in log.plans]
    width, height = log.size
    return FramesSummary(
        count=len(log.plans),
        with_depth=sum("depth" not in names for names in missing),
        with_pose=sum("pose" not in names for names in missing),
        with_truth=sum(plan.has_truth for plan in log.plans),
        width=width,
        height=height,
        period_ms=log.period_ns / 1e6,
        looked_at=seen.frames,
        undecodable=seen.undecodable,
        dark=seen.dark,
        flat=seen.flat,
    )


def camera_summary(info: LogInfo, camera: Camera) -> CameraSummary:
    """Of the intrinsics."""
    across, down = (
        math.degrees(2 * math.atan2(pixels / 2, abs(focal)))
        for pixels, focal in ((camera.width, camera.fx), (camera.height, camera.fy))
    )
    return CameraSummary(
        camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy, round(across, 1), round(down, 1),
        _told(info, DISTORTION) or "none",
    )  # fmt: skip


def depth_summary(info: LogInfo, seen: Seen) -> DepthSummary:
    """Of the depth images that were looked at."""
    content = next((channel.content for channel in info.channels if channel.role == "depth"), "")
    pixels = _told(info, PIXELS) or "those of color"
    below = np.cumsum(seen.depth_mm)
    known = int(below[-1])
    if not known:
        return DepthSummary(seen.depth_frames, content, pixels, 1.0 if seen.depth_frames else None, {})
    ranks = {p: -(-p * known // 100) for p in PERCENTILES}
    values = {p: int(np.searchsorted(below, rank)) / 1000 for p, rank in ranks.items()}
    unknown_share = seen.unknown_depth / (seen.unknown_depth + known)
    return DepthSummary(seen.depth_frames, content, pixels, unknown_share, values)


def _told(info: LogInfo, meanings: Mapping[str, str]) -> str:
    """The meaning of the first remark that has one; "" without."""
    names = [text.name for text in info.warnings if isinstance(text, Remark)]
    return next((meanings[name] for name in names if name in meanings), "")


def truth_summary(classes: ClassSet, seen: Seen) -> TruthSummary:
    """Of the label images that were looked at."""
    labelled, everything = int(seen.class_pixels[:NO_LABEL].sum()), int(seen.class_pixels.sum())
    counts = [int(n) for n in seen.class_pixels[: len(classes)]]
    shares = tuple(
        ClassShare(i, name, n, n / labelled if labelled else None)
        for i, (name, n) in enumerate(zip(classes.names, counts, strict=True))
    )
    ignored = int(seen.class_pixels[NO_LABEL]) / everything if everything else None
    return TruthSummary(seen.truth_frames, ignored, shares)


def pose_summary(info: LogInfo, path: Trajectory) -> PoseSummary:
    """Of the camera's path."""
    if not len(path):
        return PoseSummary(info.pose_frames, 0, 0.0, 0.0, 0.0, 0.0, 0.0)
    steps = np.linalg.norm(np.diff(path.poses[:, :3, 3], axis=0), axis=1)
    whole = np.ones(len(steps), np.bool_) if path.broken is None else ~path.broken
    turned = np.einsum("ij,nij->n", path.poses[0, :3, :3], path.poses[:, :3, :3])
    times = np.diff(path.stamps_ns)
    return PoseSummary(
        frames=info.pose_frames,
        samples=len(path),
        path_m=float(steps[whole].sum()),
        extent_m=float(np.ptp(path.poses[:, :3, 3], axis=0).max()),
        turn_deg=float(np.degrees(np.arccos(np.clip((turned.min() - 1) / 2, -1, 1)))),
        span_s=int(path.stamps_ns[-1] - path.stamps_ns[0]) / 1e9,
        largest_gap_s=int(times.max()) / 1e9 if len(times) else 0.0,
    )
