"""`stsem inspect`: what is in a log, what would be used, and what looks wrong, as plain data."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt

from stsem.classes import NO_LABEL, ClassSet, Labels
from stsem.frame import Depth
from stsem.log.info import ChannelInfo
from stsem.log.log import Log
from stsem.log.plan import NEEDS

SAMPLED_FRAMES = 50
DEPTH_BINS = 100_000
PERCENTILES = (1, 5, 50, 95, 99)
Counts = npt.NDArray[np.int64]


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
class DepthSummary:
    """The depth images that were looked at.

    Args:
        frames: how many.
        unknown_share: share of pixels without depth.
        percentiles_m: per cent -> depth in metres, to the millimetre; p is sorted[ceil(p n) - 1]. Empty without depth.
    """

    frames: int
    unknown_share: float | None
    percentiles_m: dict[int, float]


@dataclass(frozen=True)
class FramesSummary:
    """The colour frames of the window: how many, with which partners, of what size, and how many of the looked-at
    ones could not be decoded."""

    count: int
    with_depth: int
    with_pose: int
    with_truth: int
    width: int
    height: int
    period_ms: float
    looked_at: int
    undecodable: int


@dataclass(frozen=True)
class FileSummary:
    """The log as a whole: its name, the names of its files, and the rest as in `LogInfo`."""

    name: str
    files: tuple[str, ...]
    sha256: str
    size_bytes: int
    duration_s: float
    profile: str
    library: str


@dataclass(frozen=True)
class Inspection:
    """Everything `stsem inspect` shows; `as_dict` is the same as JSON-able data."""

    log: FileSummary
    channels: tuple[ChannelInfo, ...]
    used: dict[str, str | None]
    frames: FramesSummary
    truth: TruthSummary | None
    depth: DepthSummary | None
    camera: dict[str, object] | None
    clock_offsets_ns: dict[str, int]
    damage: dict[str, object]
    damage_text: str
    warnings: tuple[str, ...]

    def as_dict(self) -> dict[str, object]:
        """JSON-able."""
        return asdict(self)


def inspect_log(log: Log, *, full: bool = False) -> Inspection:
    """Look at a log; pixels are looked at in at most SAMPLED_FRAMES frames, evenly spread, unless `full`."""
    indices = range(len(log.plans)) if full else _spread(len(log.plans), SAMPLED_FRAMES)
    seen = _look(log, indices)
    info = log.info
    return Inspection(
        log=FileSummary(
            name=info.name, files=tuple(source.name for source in info.sources), sha256=info.sha256,
            size_bytes=info.size_bytes, duration_s=info.duration_s, profile=info.profile, library=info.library,
        ),
        channels=info.channels,
        used=asdict(info.choice),
        frames=_frames(log, seen),
        truth=_truth(log.classes, seen) if log.classes else None,
        depth=_depth(seen) if info.choice.depth else None,
        camera=asdict(log.camera) if log.camera else None,
        clock_offsets_ns=info.clock_offsets_ns,
        damage=info.damage.as_dict(),
        damage_text=str(info.damage),
        warnings=info.warnings,
    )  # fmt: skip


@dataclass
class _Seen:
    """Sums over the frames that were looked at."""

    class_pixels: Counts
    depth_mm: Counts
    frames: int = 0
    undecodable: int = 0
    truth_frames: int = 0
    depth_frames: int = 0
    unknown_depth: int = 0


def _look(log: Log, indices: Sequence[int]) -> _Seen:
    seen = _Seen(class_pixels=np.zeros(256, np.int64), depth_mm=np.zeros(DEPTH_BINS, np.int64))
    for loaded in log.frames(indices, depth=True, previous=False, truth=True):
        seen.frames += 1
        seen.undecodable += loaded.error is not None
        if loaded.truth is not None:
            _add_truth(seen, loaded.truth)
        if loaded.frame is not None and loaded.frame.depth is not None:
            _add_depth(seen, loaded.frame.depth)
    return seen


def _add_truth(seen: _Seen, truth: Labels) -> None:
    seen.truth_frames += 1
    seen.class_pixels += np.bincount(truth.ravel(), minlength=256)


def _add_depth(seen: _Seen, depth: Depth) -> None:
    seen.depth_frames += 1
    known = depth[np.isfinite(depth)]
    seen.unknown_depth += depth.size - known.size
    millimetres = np.minimum(np.rint(known * 1000), DEPTH_BINS - 1).astype(np.int64)
    seen.depth_mm += np.bincount(millimetres, minlength=DEPTH_BINS)


def _frames(log: Log, seen: _Seen) -> FramesSummary:
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
    )


def _truth(classes: ClassSet, seen: _Seen) -> TruthSummary:
    labelled, everything = int(seen.class_pixels[:NO_LABEL].sum()), int(seen.class_pixels.sum())
    counts = [int(n) for n in seen.class_pixels[: len(classes)]]
    shares = tuple(
        ClassShare(i, name, n, n / labelled if labelled else None)
        for i, (name, n) in enumerate(zip(classes.names, counts, strict=True))
    )
    ignored = int(seen.class_pixels[NO_LABEL]) / everything if everything else None
    return TruthSummary(seen.truth_frames, ignored, shares)


def _depth(seen: _Seen) -> DepthSummary:
    below = np.cumsum(seen.depth_mm)
    known = int(below[-1])
    if not known:
        return DepthSummary(seen.depth_frames, 1.0 if seen.depth_frames else None, {})
    ranks = {p: -(-p * known // 100) for p in PERCENTILES}
    values = {p: int(np.searchsorted(below, rank)) / 1000 for p, rank in ranks.items()}
    return DepthSummary(seen.depth_frames, seen.unknown_depth / (seen.unknown_depth + known), values)


def _spread(n: int, most: int) -> list[int]:
    """At most `most` of range(n), evenly spread, both ends among them."""
    if n <= most:
        return list(range(n))
    return [i * (n - 1) // (most - 1) for i in range(most)]
