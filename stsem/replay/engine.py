"""One pass over a log drives every run of every mode: each frame is read, decoded and segmented once."""

from collections.abc import Callable
from dataclasses import dataclass

from stsem.classes import Labels
from stsem.frame import Image
from stsem.inference.threads import set_threads
from stsem.log.log import Log
from stsem.mapping.cloud import LabelledCloud
from stsem.replay.answer import AnswerRule
from stsem.replay.build import NETWORK_THREADS, Model, build_rule
from stsem.replay.config import RunConfig
from stsem.replay.modes import Mode
from stsem.replay.offline import OfflineRun
from stsem.replay.queues import Mailbox, parse_queue
from stsem.replay.realtime import Machine, RealTimeRun
from stsem.replay.record import Record, scorecard_for
from stsem.replay.schedule import Slot, horizon_ns, schedule
from stsem.result import Span
from stsem.sim.costs import CostSource
from stsem.stages.fuse import Fuse
from stsem.stages.segment import Segmenter

WATCHED_FRAMES = 4
"""Frames kept for the strip of pictures."""

CostsOf = Callable[[Mode], CostSource]
"""Cost source of a mode."""


@dataclass(eq=False)
class ModeRun:
    """One mode over one log: with a clock, without, or both.

    Args:
        mode: which.
        real_time, offline: what was kept of the two passes; None if one did not run.
        cloud: the labelled points; None without a map.
        rule: of the real-time pass, or of the offline one if there is no other.
        spans: jobs of the real-time run.
    """

    mode: Mode
    cloud: LabelledCloud | None = None
    real_time: Record | None = None
    offline: Record | None = None
    rule: AnswerRule | None = None
    spans: tuple[Span, ...] = ()


@dataclass(frozen=True, eq=False)
class Picture:
    """A watched frame: image (H, W, 3) uint8 RGB and truth (h, w) uint8, if any."""

    index: int
    image: Image
    truth: Labels | None


@dataclass(frozen=True, eq=False)
class Replayed:
    """What one pass produced."""

    slots: tuple[Slot, ...]
    runs: tuple[ModeRun, ...]
    pictures: tuple[Picture, ...]
    measured: bool


class _Lane:
    """The runs of one mode, fed together."""

    def __init__(self, run: ModeRun, clocked: RealTimeRun | None, plain: OfflineRun | None) -> None:
        self.run, self.clocked, self.plain = run, clocked, plain


def replay_log(
    log: Log, config: RunConfig, model: Model, costs_of: CostsOf | None, progress: Callable[[int, int], None]
) -> Replayed:
    """Replay `log` once through every mode of `config`.

    Args:
        log: opened.
        config: what to do.
        model: what segments.
        costs_of: where durations come from; None without a clock.
        progress: called with (frames done, frames).
    """
    set_threads(1)
    fused = can_map(log, config)
    roles = frozenset({"depth", "pose"}) if fused else frozenset()
    slots = schedule(log.plans, config.exact_rate, frozenset(), roles)
    watched = _watched(slots)
    segmenter = model.segmenter(NETWORK_THREADS)
    lanes = [_lane(mode, slots, config, model, segmenter, costs_of, watched, fused) for mode in config.modes]
    pictures = []
    needs_previous = model.network is not None and model.network.has_difference
    for loaded in log.frames([s.index for s in slots], depth=fused, previous=needs_previous, truth=not model.reason):
        if loaded.index in watched and loaded.frame is not None:
            pictures.append(Picture(loaded.index, loaded.frame.image, loaded.truth))
        for lane in lanes:
            if lane.clocked is not None:
                lane.clocked.push(loaded)
            if lane.plain is not None:
                lane.plain.push(loaded)
        progress(loaded.index - slots[0].index + 1, len(slots))
    end = horizon_ns(slots, log.period_ns, config.exact_rate)
    return Replayed(slots, tuple(_finished(lane, end) for lane in lanes), tuple(pictures), not model.reason)


def can_map(log: Log, config: RunConfig) -> bool:
    """Whether a map is wanted, and the log has what it needs."""
    choice = log.info.choice
    straight = log.camera is not None and not log.camera.is_distorted
    return config.map and choice.depth is not None and choice.pose is not None and straight


def _lane(
    mode: Mode,
    slots: tuple[Slot, ...],
    config: RunConfig,
    model: Model,
    segmenter: Segmenter,
    costs_of: CostsOf | None,
    watched: frozenset[int],
    fused: bool,
) -> _Lane:
    def record() -> Record:
        scores = None if model.reason or model.classes is None else scorecard_for(model.classes, model.translation)
        return Record(slots, scores, watched)

    run = ModeRun(mode, cloud=LabelledCloud() if fused else None)
    clocked, plain = None, None
    if costs_of is not None:
        run.real_time, rule = record(), build_rule(mode, segmenter, config)
        clocked = RealTimeRun(slots, rule, _machine(mode, config, costs_of(mode), run.cloud), run.real_time)
        run.rule = rule
    if config.clock == "offline" or (config.offline and not model.reason):
        run.offline, rule = record(), build_rule(mode, segmenter, config)
        fuse = Fuse(run.cloud) if run.cloud is not None and clocked is None else None
        only_truth = mode.segments_every_frame and config.clock != "offline"
        plain = OfflineRun(slots, rule, run.offline, fuse=fuse, only_truth=only_truth)
        run.rule = run.rule or rule
    return _Lane(run, clocked, plain)


def _machine(mode: Mode, config: RunConfig, costs: CostSource, cloud: LabelledCloud | None) -> Machine:
    capacity, newest_wins = parse_queue(config.queue)
    return Machine(
        cores=config.cores, network_cores=min(mode.network_cores, config.cores), costs=costs,
        mailbox=Mailbox(capacity, newest_wins), fuse=None if cloud is None else Fuse(cloud),
        count_decode=config.count_decode,
    )  # fmt: skip


def _finished(lane: _Lane, horizon: int) -> ModeRun:
    if lane.clocked is not None:
        lane.clocked.finish(horizon)
        lane.run.spans = lane.clocked.spans
    for record in (lane.run.real_time, lane.run.offline):
        if record is not None:
            record.results.sort(key=lambda result: result.index)
    return lane.run


def _watched(slots: tuple[Slot, ...]) -> frozenset[int]:
    """Evenly spread over the frames with truth, or over all when none has."""
    choice = [slot.index for slot in slots if slot.has_truth] or [slot.index for slot in slots]
    count = min(WATCHED_FRAMES, len(choice))
    return frozenset(choice[(2 * i + 1) * len(choice) // (2 * count)] for i in range(count))
