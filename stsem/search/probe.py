"""Replays for their timing alone: the same decisions, the same costs, no labels."""

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from stsem.frame import Frame, Segmentation
from stsem.geometry.features import Features, extract
from stsem.geometry.homography import Homography
from stsem.log.log import Loaded, Log
from stsem.log.plan import NEEDS
from stsem.replay.answer import AnswerRule, Prediction
from stsem.replay.build import policy_of, registering
from stsem.replay.config import RunConfig
from stsem.replay.judging import NewestAnswer
from stsem.replay.lanes import CostsOf, needs_pose
from stsem.replay.modes import Mode
from stsem.replay.queues import Mailbox, parse_queue
from stsem.replay.realtime import Machine, RealTimeRun
from stsem.replay.schedule import Slot, horizon_ns, schedule
from stsem.result import FrameResult
from stsem.stages.keyframe import Keyframe
from stsem.stages.propagate import PROPAGATIONS
from stsem.stages.propagation.method import Memoryless, Needs, Predicted
from stsem.stages.register import Anchor, Registration, between
from stsem.stages.track import Tracker

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


class _NoLabels(Memoryless):
    """Segments and propagates at no expense.

    Args:
        needs: of the method that it stands for.
        usable: log indices that can be segmented; None for all.
    """

    def __init__(self, needs: Needs, usable: frozenset[int] | None) -> None:
        self.needs, self._usable = needs, usable

    def can_segment(self, index: int) -> bool:
        return self._usable is None or index in self._usable

    def segment(self, frame: Frame) -> Segmentation:
        return _NOTHING

    def predict(self, source: Keyframe, frame: Frame, registration: Registration | None) -> Predicted:
        return Predicted(_NOTHING, source.index)

    def expected_coverage(self, frame: Frame, registration: Registration) -> float | None:
        return None


@dataclass
class _RememberedRegister:
    """Registration by features kept from one decoding pass; each pair of frames is estimated once."""

    seed: int
    features: dict[int, Features]
    pairs: dict[tuple[int, int], Homography | None] = field(default_factory=dict)

    def __call__(self, frame: Frame, anchors: Sequence[Anchor]) -> Registration:
        own = self.features.get(frame.index)
        if own is None:
            return Registration()
        return Registration(own, {anchor.index: self._between(anchor, frame.index, own) for anchor in anchors})

    def _between(self, anchor: Anchor, index: int, features: Features) -> Homography | None:
        pair = anchor.index, index
        if pair not in self.pairs:
            self.pairs[pair] = between(anchor, index, features, self.seed)
        return self.pairs[pair]


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
        needs: roles whose messages a frame waits for (`needed_roles`).
        fused: whether a map stands beside the path.
        usable: log indices that can be segmented (the oracle needs truth); None for all.
        tracker: has tracked every frame of the log, in the same order; None where the log gives the poses.
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
        tracker: Tracker | None = None,
        patience_ns: int = 0,
    ) -> None:
        self._log, self._config, self._costs_of, self._usable = log, config, costs_of, usable
        self._patience_ns = patience_ns
        self._needs, self._fused, self._tracker = needs, fused, tracker
        self._method = PROPAGATIONS[config.propagation].needs
        predicts = any(not mode.segments_every_frame for mode in config.modes)
        asked = registering(policy_of(config), _NoLabels(self._method, usable), config.seed)
        self._frames, features = self._decoded(predicts and asked is not None and asked.points)
        self._register = None if asked is None else _RememberedRegister(config.seed, features)

    def attempt(self, mode: Mode, rate: Fraction) -> list[FrameResult]:
        """Every frame's result when `mode` replays the log at `rate`."""
        slots = schedule(self._log.plans, rate, frozenset(), self._needs)
        labels = _NoLabels(self._method, self._usable)
        policy = policy_of(self._config)
        prediction = None if mode.segments_every_frame else Prediction(policy, labels, self._register)
        capacity, newest_wins = parse_queue(self._config.queue)
        machine = Machine(
            cores=self._config.cores,
            network_cores=mode.cores(self._config.cores, tracks=self._tracker is not None),
            costs=self._costs_of(mode),
            mailbox=Mailbox(capacity, newest_wins),
            fuse=_NoMap(self._fusable()) if self._fused else None,
            count_decode=self._config.count_decode,
            tracker=self._tracker,
            pose_on_path=needs_pose(mode, self._config, self._tracker),
            in_background=mode.in_background,
        )
        results = _Results()
        run = RealTimeRun(slots, AnswerRule(labels, prediction), machine, results)
        for loaded in self._frames:
            run.push(loaded)
        run.finish(max(horizon_ns(slots, self._log.period_ns, rate), horizon_ns(slots, self._patience_ns, Fraction(1))))
        return results.ended_frames

    def _fusable(self) -> frozenset[int]:
        """Frames with depth and a pose."""
        if self._tracker is None:
            return frozenset(plan.index for plan in self._log.plans if not plan.missing(NEEDS))
        deep = [plan.index for plan in self._log.plans if not plan.missing(frozenset({"depth"}))]
        return frozenset(i for i in deep if (found := self._tracker.of(i)) is not None and found.T_WC is not None)

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
