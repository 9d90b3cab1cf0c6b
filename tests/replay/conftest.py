"""A log that needs no file: frames of one colour, arriving on time."""

from collections.abc import Callable, Sequence
from fractions import Fraction

import numpy as np
import pytest

from stsem.classes import ClassSet, Labels
from stsem.frame import Frame, Segmentation
from stsem.log.log import Loaded
from stsem.log.plan import FramePlan
from stsem.metrics.scorecard import Scorecard
from stsem.replay.answer import AnswerRule, Prediction
from stsem.replay.queues import Mailbox, parse_queue
from stsem.replay.realtime import Machine, RealTimeRun
from stsem.replay.record import Record
from stsem.replay.schedule import Slot, horizon_ns, schedule
from stsem.sim.costs import ConstantCosts
from stsem.stages.fuse import Fuser
from stsem.stages.keyframe import Keyframe
from stsem.stages.propagation.method import Memoryless, Needs, Predicted
from stsem.stages.register import Anchor, Registration
from stsem.stages.select import EveryPolicy

MS = 1_000_000
PERIOD_NS = 100 * MS
DELAY_NS = 10 * MS
START_NS = 1_700_000_000 * 10**9


class NumberSegmenter:
    """Labels every pixel with the log index of the frame, so that answers say where they come from."""

    def can_segment(self, index: int) -> bool:
        """Always."""
        return True

    def segment(self, frame: Frame) -> Segmentation:
        """The index, everywhere."""
        return Segmentation(np.full((4, 4), frame.index, np.uint8))


class CopyKeyframe(Memoryless):
    """Hold, without images."""

    needs = Needs()

    def predict(self, source: Keyframe, frame: Frame, registration: Registration | None) -> Predicted:
        """The keyframe's labels."""
        return Predicted(source.segmentation, source.index)

    def expected_coverage(self, frame: Frame, registration: Registration) -> None:
        """Unknown."""


class NoFeatures:
    """A register stage that finds nothing and still costs time."""

    def __call__(self, frame: Frame, anchors: Sequence[Anchor]) -> Registration:
        """Nothing found."""
        return Registration()


def make_plans(count: int, *, truth: Callable[[int], bool] = lambda i: True) -> tuple[FramePlan, ...]:
    """`count` frames at 10 Hz, each logged 10 ms after its stamp."""
    stamps = [START_NS + i * PERIOD_NS for i in range(count)]
    return tuple(
        FramePlan(i, s, s + DELAY_NS, None, None, s + DELAY_NS if truth(i) else None) for i, s in enumerate(stamps)
    )


def make_slots(count: int, rate: Fraction = Fraction(1)) -> tuple[Slot, ...]:
    """The same on the simulated clock."""
    return schedule(make_plans(count), rate, frozenset(), frozenset())


def loaded(slot: Slot, truth: Labels | None = None) -> Loaded:
    """A frame of 4 x 4 pixels."""
    return Loaded(slot.index, Frame(slot.index, slot.log_stamp_ns, np.zeros((4, 4, 3), np.uint8)), None, truth)


def numbered_truth(slot: Slot) -> Labels:
    """Truth that only the frame's own segmentation meets."""
    return np.full((4, 4), slot.index, np.uint8)


class Bench:
    """Runs one mode over made-up frames and keeps everything."""

    def __init__(
        self, slots: tuple[Slot, ...], *, keyframes: int | None, register: bool, queue: str, costs: dict,
        in_background: bool = False, fuse: Fuser | None = None,
    ) -> None:  # fmt: skip
        prediction = None
        if keyframes is not None:
            prediction = Prediction(EveryPolicy(keyframes), CopyKeyframe(), NoFeatures() if register else None)
        classes = ClassSet(tuple(f"frame {i}" for i in range(max(len(slots), 2))))
        self.slots, self.record = slots, Record(slots, Scorecard(classes), frozenset())
        capacity, newest_wins = parse_queue(queue)
        machine = Machine(
            2, 1 if in_background else 2, ConstantCosts(costs), Mailbox(capacity, newest_wins), fuse,
            in_background=in_background,
        )  # fmt: skip
        self.run = RealTimeRun(slots, AnswerRule(NumberSegmenter(), prediction), machine, self.record)

    def play(self, broken: frozenset[int] = frozenset()) -> "Bench":
        """Push every frame; those in `broken` cannot be decoded."""
        for slot in self.slots:
            whole = loaded(slot, numbered_truth(slot))
            self.run.push(Loaded(slot.index, None, None, whole.truth) if slot.index in broken else whole)
        self.run.finish(horizon_ns(self.slots, PERIOD_NS, Fraction(1)))
        self.record.results.sort(key=lambda result: result.index)
        return self


@pytest.fixture
def bench() -> type[Bench]:
    """The class itself."""
    return Bench
