"""Replays for their timing alone: the same decisions, the same costs, no labels."""

from contextlib import closing
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from stsem.frame import Frame, Segmentation
from stsem.geometry.features import Features, extract
from stsem.geometry.homography import Homography, estimate
from stsem.log.log import Loaded, Log
from stsem.log.plan import NEEDS
from stsem.replay.answer import AnswerRule, Prediction
from stsem.replay.build import policy_of
from stsem.replay.config import RunConfig
from stsem.replay.lanes import CostsOf
from stsem.replay.modes import Mode
from stsem.replay.queues import Mailbox, parse_queue
from stsem.replay.realtime import Machine, NewestAnswer, RealTimeRun
from stsem.replay.schedule import Slot, horizon_ns, schedule
from stsem.result import FrameResult
from stsem.stages.keyframe import Keyframe
from stsem.stages.propagate import PROPAGATIONS
from stsem.stages.register import Registration, pair_seed

_NOTHING = Segmentation(np.zeros((1, 1), np.uint8))


@dataclass
class _Results:
    """Keeps outcomes, judges nothing."""

    ended_frames: list[FrameResult] = field(default_factory=list)

    def arrived(self, slot: Slot, loaded: Loaded, newest: NewestAnswer | None) -> None:
        """Nothing to judge."""

    def ended(self, result: FrameResult, loaded: Loaded) -> None:
        """Keep it."""
        self.ended_frames.append(result)


class _NoLabels:
    """Segments and propagates at no expense."""

    def __init__(self, needs_homography: bool, usable: frozenset[int] | None) -> None:
        self.needs_homography, self._usable = needs_homography, usable

    def can_segment(self, index: int) -> bool:
        return self._usable is None or index in self._usable

    def segment(self, frame: Frame) -> Segmentation:
        return _NOTHING

    def propagate(self, keyframe: Keyframe, frame: Frame, homography: Homography | None) -> Segmentation:
        return _NOTHING


@dataclass
class _RememberedRegister:
    """Registration by features kept from one decoding pass; each pair of frames is estimated once."""

    seed: int
    features: dict[int, Features]
    pairs: dict[tuple[int, int], Homography | None] = field(default_factory=dict)

    def __call__(self, frame: Frame, keyframe: Features | None, keyframe_index: int | None) -> Registration:
        own = self.features[frame.index]
        if keyframe is None or keyframe_index is None:
            return Registration(own, None)
        pair = keyframe_index, frame.index
        if pair not in self.pairs:
            self.pairs[pair] = estimate(keyframe, own, seed=pair_seed(self.seed, *pair))
        return Registration(own, self.pairs[pair])


@dataclass(frozen=True)
class _NoMap:
    """Takes core time where the real map would."""

    fusable: frozenset[int]

    def can_fuse(self, frame: Frame) -> bool:
        return frame.index in self.fusable

    def __call__(self, frame: Frame, segmentation: Segmentation) -> None:
        return


class Probe:
    """Attempts at one log with one configuration; decoding and registration happen once.

    Args:
        log, config: of the run.
        costs_of: cost source of a mode.
        needs: roles whose messages a frame waits for (`Model.needs`).
        fused: whether a map stands beside the path.
        usable: log indices that can be segmented (the oracle needs truth); None for all.
        patience_ns: how long the clock runs on after the last arrival, at least: with 0 as long as in the real run.
    """

    def __init__(
        self,
        log: Log,
        config: RunConfig,
        costs_of: CostsOf,
        *,
        needs: frozenset[str],
        fused: bool,
        usable: frozenset[int] | None,
        patience_ns: int = 0,
    ) -> None:
        self._log, self._config, self._costs_of, self._usable = log, config, costs_of, usable
        self._patience_ns = patience_ns
        self._needs, self._fused = needs, fused
        self._policy = policy_of(config)
        self._warps = PROPAGATIONS[config.propagation]().needs_homography
        predicts = any(not mode.segments_every_frame for mode in config.modes)
        looks = predicts and (self._policy.needs_homography or self._warps)
        self._frames, features = self._decoded(looks)
        self._register = _RememberedRegister(config.seed, features) if looks else None

    def attempt(self, mode: Mode, rate: Fraction) -> list[FrameResult]:
        """Every frame's result when `mode` replays the log at `rate`."""
        slots = schedule(self._log.plans, rate, frozenset(), self._needs)
        labels = _NoLabels(self._warps, self._usable)
        prediction = None if mode.segments_every_frame else Prediction(self._policy, labels, self._register)
        capacity, newest_wins = parse_queue(self._config.queue)
        fusable = frozenset(p.index for p in self._log.plans if self._fused and not p.missing(NEEDS))
        machine = Machine(
            cores=self._config.cores,
            network_cores=min(mode.network_cores, self._config.cores),
            costs=self._costs_of(mode),
            mailbox=Mailbox(capacity, newest_wins),
            fuse=_NoMap(fusable) if self._fused else None,
            count_decode=self._config.count_decode,
        )
        results = _Results()
        run = RealTimeRun(slots, AnswerRule(labels, prediction), machine, results)
        for loaded in self._frames:
            run.push(loaded)
        run.finish(max(horizon_ns(slots, self._log.period_ns, rate), horizon_ns(slots, self._patience_ns, Fraction(1))))
        return results.ended_frames

    def _decoded(self, looks: bool) -> tuple[list[Loaded], dict[int, Features]]:
        """Every frame without its pixels, and its features if anybody looks at them."""
        frames, features = [], {}
        indices = [plan.index for plan in self._log.plans]
        with closing(self._log.frames(indices, depth=False, previous=False, truth=False)) as supply:
            for loaded in supply:
                if loaded.frame is not None and looks:
                    features[loaded.index] = extract(loaded.frame.image)
                frames.append(_without_pixels(loaded))
        return frames, features


def _without_pixels(loaded: Loaded) -> Loaded:
    """The same frame with an image that takes no memory but has the right size."""
    if loaded.frame is None:
        return loaded
    blank = np.broadcast_to(np.uint8(0), loaded.frame.image.shape)
    return Loaded(loaded.index, Frame(loaded.index, loaded.frame.stamp_ns, blank), loaded.error, None)
