"""Frames that arrive late, early, together or out of order."""

from collections.abc import Iterator
from dataclasses import astuple, replace
from fractions import Fraction
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stsem.classes import ClassSet
from stsem.log.plan import FramePlan
from stsem.metrics.scorecard import Scorecard
from stsem.replay.answer import AnswerRule, Prediction
from stsem.replay.offline import OfflineRun
from stsem.replay.queues import Mailbox, parse_queue
from stsem.replay.realtime import Machine, RealTimeRun
from stsem.replay.record import Record
from stsem.replay.schedule import Slot, horizon_ns, schedule
from stsem.result import FrameResult, Outcome
from stsem.sim.costs import ConstantCosts
from stsem.stages.select import EveryPolicy

from .conftest import MS, PERIOD_NS, START_NS, CopyKeyframe, NumberSegmenter, loaded, numbered_truth

DELAYS = st.lists(st.integers(0, 700), min_size=1, max_size=20)
COSTS = st.fixed_dictionaries({"segment": st.integers(0, 300), "propagate": st.integers(0, 60)})
QUEUES = st.sampled_from(["latest", "fifo:2", "lossless"])


def slots_of(delays_ms: list[int], missing: frozenset[int] = frozenset()) -> tuple[Slot, ...]:
    """10 Hz stamps, each frame arriving the given milliseconds later."""
    plans = [
        FramePlan(i, START_NS + i * PERIOD_NS, START_NS + i * PERIOD_NS + delay * MS, None, None, None)
        for i, delay in enumerate(delays_ms)
    ]
    slots = schedule(plans, Fraction(1), frozenset(), frozenset())
    return tuple(replace(slot, missing=("depth",)) if slot.index in missing else slot for slot in slots)


class Live:
    """One real-time run over made-up slots; with `at_once` the clock stands still until every frame is known."""

    def __init__(
        self, slots: tuple[Slot, ...], costs: dict[str, int], queue: str, *, every: int | None, at_once: bool = False
    ) -> None:
        prediction = None if every is None else Prediction(EveryPolicy(every), CopyKeyframe(), None)
        self.rule = AnswerRule(NumberSegmenter(), prediction)
        self.record = Record(slots, Scorecard(classes_for(slots)), frozenset())
        machine = Machine(2, 2, ConstantCosts({k: ms * MS for k, ms in costs.items()}), Mailbox(*parse_queue(queue)))
        self.run = RealTimeRun(slots, self.rule, machine, self.record)
        if at_once:
            self.run._marks = [0] * len(slots)
        for slot in slots:
            self.run.push(loaded(slot, numbered_truth(slot)))
        self.run.finish(horizon_ns(slots, PERIOD_NS, Fraction(1)))
        self.results: list[FrameResult] = sorted(self.record.results, key=lambda r: r.index)

    @property
    def facts(self) -> Iterator[tuple[Any, ...]]:
        """Everything that came of it, without pixels."""
        yield from (astuple(result) for result in self.results)
        yield from (astuple(span) for span in self.run.spans)
        assert self.record.scorecard is not None
        found = self.record.scorecard.compute()
        yield tuple(None if part is None else part.matrix.tolist() for part in (found.own, found.streaming))


def classes_for(slots: tuple[Slot, ...]) -> ClassSet:
    return ClassSet(tuple(f"frame {i}" for i in range(max(len(slots), 2))))


@settings(max_examples=80, deadline=None)
@given(delays=DELAYS, costs=COSTS, queue=QUEUES, every=st.one_of(st.none(), st.integers(1, 5)))
def test_reading_ahead_changes_nothing(delays: list[int], costs: dict[str, int], queue: str, every: int | None) -> None:
    """Pushed frame by frame, the clock goes as far as is safe; had all been known from the start, nothing differs."""
    slots = slots_of(delays)
    stream = Live(slots, costs, queue, every=every)
    known = Live(slots, costs, queue, every=every, at_once=True)
    assert list(stream.facts) == list(known.facts)


@settings(max_examples=40, deadline=None)
@given(count=st.integers(1, 20), costs=COSTS, every=st.one_of(st.none(), st.integers(1, 5)))
def test_with_time_enough_the_clock_changes_nothing(count: int, costs: dict[str, int], every: int | None) -> None:
    """With every frame taken before the next one comes, the answers are those of the offline pass."""
    slots = tuple(replace(s, stamp_ns=10 * s.stamp_ns, arrival_ns=10 * s.stamp_ns) for s in slots_of([0] * count))
    live = Live(slots, costs, "latest", every=every)
    record = Record(slots, None, frozenset())
    prediction = None if every is None else Prediction(EveryPolicy(every), CopyKeyframe(), None)
    plain = OfflineRun(slots, AnswerRule(NumberSegmenter(), prediction), record, fuse=None, only_truth=False)
    for slot in slots:
        plain.push(loaded(slot))

    def answers(results: list[FrameResult]) -> list[tuple[Any, ...]]:
        kept = [r for r in results if r.index < count - 1]  # the last one may be pending: the horizon is one period
        return [(r.index, r.outcome, r.keyframe, r.reason, r.coverage) for r in kept]

    assert answers(live.results) == answers(record.results)


@settings(max_examples=40, deadline=None)
@given(delays=DELAYS, costs=COSTS, queue=QUEUES, missing=st.frozensets(st.integers(0, 19)))
def test_incomplete_frames(delays: list[int], costs: dict[str, int], queue: str, missing: frozenset[int]) -> None:
    """A frame that lacks a needed channel is never taken, and is judged streaming all the same."""
    live = Live(slots_of(delays, missing), costs, queue, every=2)
    found = {r.index for r in live.results if r.outcome is Outcome.INCOMPLETE}
    assert found == {i for i in missing if i < len(delays)}
    assert all(r.reason == "no depth" and r.taken_ns is None for r in live.results if r.index in found)
    assert not {span.frame for span in live.run.spans} & found
    assert live.record.scorecard is not None
    streaming = live.record.scorecard.compute().streaming
    assert streaming is not None
    assert streaming.frames == len(delays)


def test_an_old_frame_never_replaces_a_newer_answer() -> None:
    """Frame 0 arrives after frame 1 was answered: it is answered too, but a robot goes on acting on frame 1."""
    live = Live(slots_of([250, 0, 200]), {"segment": 20, "propagate": 1}, "latest", every=None)
    assert [r.answered_ns for r in live.results] == [270 * MS, 120 * MS, 420 * MS]
    assert live.record.scorecard is not None
    streaming = live.record.scorecard.compute().streaming
    assert streaming is not None
    # 1 arrives first and finds nothing, 0 at 250 finds 1, 2 at 400 still finds 1 although 0 was finished at 270.
    assert [(t, p) for t in range(3) for p in range(4) if streaming.matrix[t, p]] == [(0, 1), (1, 3), (2, 1)]


@pytest.mark.parametrize(("cost", "outcome"), [(100, Outcome.SEGMENTED), (101, Outcome.PENDING)])
def test_the_horizon(cost: int, outcome: Outcome) -> None:
    """What is finished one period after the last arrival counts; a moment later is pending."""
    live = Live(slots_of([5]), {"segment": cost}, "latest", every=None)
    assert live.results[0].outcome is outcome
