"""One pass over a log drives every run of every mode: each frame is read, decoded and segmented once."""

from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial

from stsem import hostclock
from stsem.classes import Labels
from stsem.frame import Frame, Image
from stsem.inference.threads import set_threads
from stsem.log.log import Loaded, Log
from stsem.replay.build import NETWORK_THREADS, Model, needed_roles
from stsem.replay.config import RunConfig
from stsem.replay.hosttimes import StageTime, StageTimes
from stsem.replay.lanes import CostsOf, Lane, ModeRun, Setup
from stsem.replay.modes import Mode
from stsem.replay.posing import LOG_POSES, Posing, can_map, hidden, log_poses, posing
from stsem.replay.schedule import Slot, horizon_ns, schedule
from stsem.result import FrameResult
from stsem.stages.track import SlamTracker

PICTURES = 4
"""Frames kept for the strip of pictures."""

WatchMode = Callable[[Mode, FrameResult, Frame], None]
"""Called with every answered frame of every mode, labels included."""


@dataclass(frozen=True, eq=False)
class Picture:
    """A frame to look at: image (H, W, 3) uint8 RGB and truth (h, w) uint8, if any."""

    index: int
    image: Image
    truth: Labels | None


@dataclass(frozen=True, eq=False)
class Replayed:
    """What one pass produced.

    Args:
        slots: every frame on the simulated clock.
        runs: one per mode.
        pictures: a few frames.
        stage_times: stage -> what it cost on this host.
        wall_ns: wall-clock duration of the pass.
        without_depth: frames whose depth the network takes and does not have; None for a network that takes none.
        posing: where the poses came from.
    """

    slots: Sequence[Slot]
    runs: tuple[ModeRun, ...]
    pictures: tuple[Picture, ...]
    stage_times: Mapping[str, StageTime]
    wall_ns: int
    without_depth: int | None = None
    posing: Posing = LOG_POSES


def replay_log(
    log: Log,
    config: RunConfig,
    model: Model,
    costs_of: CostsOf | None,
    progress: Callable[[int, int], None],
    watch: WatchMode | None = None,
) -> Replayed:
    """Replay `log` once through every mode of `config`.

    Args:
        log: opened.
        config: what to do.
        model: what segments.
        costs_of: where durations come from; None without a clock.
        progress: called with (frames done, frames).
        watch: called with every answered frame; None when nobody looks.
    """
    began = hostclock.wall_ns()
    set_threads(1)
    fused, times = can_map(log, config), StageTimes()
    slots = schedule(log.plans, config.exact_rate, frozenset(), needed_roles(model, config, fused=fused))
    segmenter = model.segmenter(min(NETWORK_THREADS, config.cores), times)
    frames_at = partial(_frames, log, config, model, fused)
    setup = Setup(
        config,
        model,
        segmenter,
        costs_of,
        slots,
        _pictured(slots),
        fused,
        times,
        lambda index: next(frames_at([index])),
        log_poses(log),
        _trackers(log, config, times) if posing(log, config).tracks else None,
    )
    lanes = [Lane(setup, mode, _watch_of(mode, watch)) for mode in config.modes]
    pictures, without_depth = _feed(frames_at, setup, lanes, progress)
    end = horizon_ns(slots, log.period_ns, config.exact_rate)
    runs = tuple(lane.finish(end) for lane in lanes)
    counted = without_depth if model.network is not None and model.network.has_depth else None
    return Replayed(slots, runs, pictures, times.stages, hostclock.wall_ns() - began, counted, posing(log, config))


def _frames(
    log: Log, config: RunConfig, model: Model, fused: bool, indices: Iterable[int]
) -> Generator[Loaded, None, None]:
    """The frames at `indices` with what this replay looks at."""
    previous = model.network is not None and model.network.has_difference
    depth = "depth" in needed_roles(model, config, fused=fused)
    frames = log.frames(indices, depth=depth, previous=previous, truth=not model.reason)
    return hidden(frames) if config.pose == "slam" else frames


def _trackers(log: Log, config: RunConfig, times: StageTimes) -> Callable[[], SlamTracker]:
    """One tracker for all runs; with measured durations one for each, which works when its jobs do."""
    if log.camera is None:
        raise ValueError("SLAM needs a camera")
    measured = config.costs == "measured" and config.clock == "real-time"
    make = partial(SlamTracker, log.camera, config.seed, at_once=not measured, measure=partial(times.measure, "track"))
    shared = make()
    return make if measured else lambda: shared


def _feed(
    frames_at: Callable[[Iterable[int]], Generator[Loaded, None, None]],
    setup: Setup,
    lanes: list[Lane],
    progress: Callable[[int, int], None],
) -> tuple[tuple[Picture, ...], int]:
    """Every frame of the log into every lane; returns pictures, and how many decoded frames came without depth."""
    pictures, without_depth = [], 0
    with closing(frames_at(slot.index for slot in setup.slots)) as frames:
        for done, loaded in enumerate(frames, start=1):
            if loaded.index in setup.pictured and loaded.frame is not None:
                pictures.append(Picture(loaded.index, loaded.frame.image, loaded.truth))
            without_depth += loaded.frame is not None and loaded.frame.depth is None
            for lane in lanes:
                lane.push(loaded)
            progress(done, len(setup.slots))
    return tuple(pictures), without_depth


def _watch_of(mode: Mode, watch: WatchMode | None) -> Callable[[FrameResult, Frame], None] | None:
    return None if watch is None else lambda result, frame: watch(mode, result, frame)


def _pictured(slots: Sequence[Slot]) -> frozenset[int]:
    """Evenly spread over the frames with truth, or over all when none has."""
    choice = [slot.index for slot in slots if slot.has_truth] or [slot.index for slot in slots]
    count = min(PICTURES, len(choice))
    return frozenset(choice[(2 * i + 1) * len(choice) // (2 * count)] for i in range(count))
