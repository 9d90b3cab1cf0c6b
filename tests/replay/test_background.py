"""Keyframes segmented beside the answers: schedules by hand, by simpy, and what must hold whatever the costs."""

import weakref
from collections.abc import Generator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
import simpy
from hypothesis import given, settings
from hypothesis import strategies as st

from stsem.chance import generator
from stsem.frame import Frame, Segmentation
from stsem.log.log import Loaded
from stsem.replay.network import Background
from stsem.result import FrameResult, Outcome
from stsem.sim.trace import schedule_text

from .conftest import DELAY_NS, MS, PERIOD_NS, Bench, make_slots, numbered_truth

Row = tuple[int, str, int | None, str, int | None]
"""(frame, outcome, keyframe, reason, answered)."""


class Anything:
    """A map that takes everything, and keeps nothing."""

    def can_fuse(self, frame: Frame) -> bool:
        return True

    def __call__(self, frame: Frame, segmentation: Segmentation) -> None:
        """Nothing."""


def beside(bench: Bench) -> Background:
    """What was segmented in the background."""
    assert bench.run.background is not None
    return bench.run.background


def played(count: int, costs: dict[str, int], *, every: int, queue: str = "latest") -> Bench:
    """`count` frames at 10 Hz, a keyframe every so many, costs in nanoseconds."""
    slots = make_slots(count)
    return Bench(slots, keyframes=every, register=True, queue=queue, costs=costs, in_background=True).play()


def shown(results: list[FrameResult]) -> list[Row]:
    return [(r.index, str(r.outcome), r.keyframe, r.reason, r.answered_ns) for r in results]


def test_ten_frames_by_hand() -> None:
    """Frame i arrives at 100 i + 10 ms. Register 30, segment 350 on one core, propagate 20; a keyframe every 2.

    Frame 0 is chosen at 40 and segmented until 390; until then nothing is there to predict from, and frames 0 to 3 end
    at once. Frame 2 waited before the network and is segmented 390-740. Frame 4 waits there until 6, chosen at 640,
    takes its place. Frame 7 is registered when 2 is finished, and comes from it. At 1010, one period after the last
    arrival, the network works on 6, and 8 waits.
    """
    found = played(10, {"register": 30 * MS, "segment": 350 * MS, "propagate": 20 * MS}, every=2)
    expected = """\
        start ms           end ms        waited ms  cores frame stage
       10.000000        40.000000         0.000000  0         0 register
       40.000000       390.000000         0.000000  0         0 segment
      110.000000       140.000000         0.000000  1         1 register
      210.000000       240.000000         0.000000  1         2 register
      310.000000       340.000000         0.000000  1         3 register
      390.000000       740.000000         0.000000  0         2 segment
      410.000000       440.000000         0.000000  1         4 register
      440.000000       460.000000         0.000000  1         4 propagate
      510.000000       540.000000         0.000000  1         5 register
      540.000000       560.000000         0.000000  1         5 propagate
      610.000000       640.000000         0.000000  1         6 register
      640.000000       660.000000         0.000000  1         6 propagate
      710.000000       740.000000         0.000000  1         7 register
      740.000000      1090.000000         0.000000  0         6 segment
      740.000000       760.000000         0.000000  1         7 propagate
      810.000000       840.000000         0.000000  1         8 register
      840.000000       860.000000         0.000000  1         8 propagate
      910.000000       940.000000         0.000000  1         9 register
      940.000000       960.000000         0.000000  1         9 propagate
"""
    assert schedule_text(found.run.spans) == expected
    assert shown(list(found.record.results)) == [
        (0, "no_source", None, "first", None), (1, "no_source", None, "", None),
        (2, "no_source", None, "interval", None), (3, "no_source", None, "", None),
        (4, "propagated", 0, "interval", 460 * MS), (5, "propagated", 0, "", 560 * MS),
        (6, "propagated", 0, "interval", 660 * MS), (7, "propagated", 2, "", 760 * MS),
        (8, "propagated", 2, "interval", 860 * MS), (9, "propagated", 2, "", 960 * MS),
    ]  # fmt: skip
    background = beside(found)
    assert list(background.chosen) == [0, 2, 4, 6, 8]
    assert (background.finished, background.replaced, background.unfinished) == ([0, 2], [4], (6, 8))


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    count=st.integers(1, 30), every=st.integers(1, 6),
    costs=st.fixed_dictionaries({"register": st.integers(1, 50), "propagate": st.integers(1, 50)}),
    beside_ms=st.tuples(st.integers(1, 3000), st.integers(1, 300)),
    broken=st.frozensets(st.integers(0, 29), max_size=5),
)  # fmt: skip
def test_no_answer_waits_for_the_network(
    count: int, every: int, costs: dict[str, int], beside_ms: tuple[int, int], broken: frozenset[int]
) -> None:
    """However slow the network and the map: each answer takes what registering and predicting take, and comes from the
    newest keyframe; every choice ends once.
    """
    segment, fuse = beside_ms
    prices = {name: cost * MS for name, cost in {**costs, "segment": segment, "fuse": fuse}.items()}
    bench = Bench(
        make_slots(count), keyframes=every, register=True, queue="latest", costs=prices, in_background=True,
        fuse=Anything(),
    )  # fmt: skip
    found = bench.play(broken)
    results, background = list(found.record.results), beside(found)
    assert [r.index for r in results] == list(range(count))
    assert {r.outcome for r in results} <= {Outcome.PROPAGATED, Outcome.NO_SOURCE, Outcome.UNDECODABLE}
    finished_ns = {s.frame: s.end_ns for s in found.run.spans if s.stage == "segment"}
    for r in results:
        if r.outcome is Outcome.PROPAGATED:
            assert r.arrival_ns is not None
            assert r.answered_ns == r.arrival_ns + prices["register"] + prices["propagate"]
            predicting_ns = r.answered_ns - prices["propagate"]
            assert r.keyframe == max(index for index, end_ns in finished_ns.items() if end_ns <= predicting_ns)
    fates = [*background.finished, *background.replaced, *background.unfinished]
    assert sorted(fates) == sorted(background.chosen)
    assert {r.index: r.reason for r in results if r.index in background.chosen} == background.chosen


@dataclass
class SimpyRobot:
    """The mode in another library's words: an answer path, a network, and between them a place for one.

    Two cores are one each: the path does one job at a time, and so does the network.
    """

    count: int
    costs: dict[str, int]
    every: int
    rows: list[Row] = field(default_factory=list)
    finished: list[int] = field(default_factory=list)
    replaced: list[int] = field(default_factory=list)

    def play(self) -> "SimpyRobot":
        self.env = simpy.Environment()
        self.waiting: int | None = None
        self.post = self.env.event()
        self.arrived = simpy.Store(self.env)
        self.env.process(self.arrivals())
        self.env.process(self.path())
        self.env.process(self.network())
        self.env.run(until=(self.count * PERIOD_NS + DELAY_NS) + 1)
        return self

    def arrivals(self) -> Generator[simpy.Event, Any, None]:
        yield self.env.timeout(DELAY_NS)
        for index in range(self.count):
            if self.arrived.items:
                self.rows.append((self.arrived.items.pop(), "dropped_busy", None, "", None))
            yield self.arrived.put(index)
            yield self.env.timeout(PERIOD_NS)

    def path(self) -> Generator[simpy.Event, Any, None]:
        selected: int | None = None
        while True:
            index = yield self.arrived.get()
            yield self.env.timeout(self.costs["register"])
            reason = "first" if selected is None else "interval" if index - selected >= self.every else ""
            if reason:
                selected = index
                self.hand(index)
            if not self.finished:
                self.rows.append((index, "no_source", None, reason, None))
                continue
            source = self.finished[-1]
            yield self.env.timeout(self.costs["propagate"])
            self.rows.append((index, "propagated", source, reason, int(self.env.now)))

    def hand(self, index: int) -> None:
        if self.waiting is not None:
            self.replaced.append(self.waiting)
        self.waiting = index
        if not self.post.triggered:
            self.post.succeed()

    def network(self) -> Generator[simpy.Event, Any, None]:
        while True:
            if self.waiting is None:
                self.post = self.env.event()
                yield self.post
            index, self.waiting = self.waiting, None
            assert index is not None
            yield self.env.timeout(self.costs["segment"])
            self.finished.append(index)


def test_simpy_agrees() -> None:
    """Random costs, some of which let the answer path fall behind as well."""
    kinds: set[str] = set()
    for case in range(150):
        rng = generator(0, "async", case)
        # Odd multiples of coprime numbers: no two events meet, whose order the two libraries need not share.
        costs = {
            "register": 7 * int(rng.integers(1, 10_000_000)) + 1, "propagate": 11 * int(rng.integers(1, 7_000_000)) + 1,
            "segment": 13 * int(rng.integers(1, 60_000_000)) + 1,
        }  # fmt: skip
        count, every = int(rng.integers(1, 25)), int(rng.integers(1, 4))
        ours, theirs = played(count, costs, every=every), SimpyRobot(count, costs, every).play()
        ended = [row for row in shown(list(ours.record.results)) if row[1] != "pending"]
        assert ended == sorted(theirs.rows), f"case {case}: {count} frames, every {every}, {costs}"
        assert (beside(ours).finished, beside(ours).replaced) == (theirs.finished, theirs.replaced)
        kinds |= {row[1] for row in ended} | {"replaced" for _ in theirs.replaced}
    assert kinds == {"propagated", "no_source", "dropped_busy", "replaced"}


def test_waiting_keyframes_hold_two_images() -> None:
    """The network takes twenty periods, every frame is chosen: the one it works on and the newest keep their images."""
    slots, alive = make_slots(40), weakref.WeakSet[Any]()
    bench = Bench(
        slots, keyframes=1, register=False, queue="latest", costs={"segment": 2000 * MS, "propagate": 5 * MS},
        in_background=True,
    )  # fmt: skip
    most = 0
    for slot in slots:
        frame = Frame(slot.index, slot.log_stamp_ns, np.zeros((4, 4, 3), np.uint8))
        alive.add(frame)
        bench.run.push(Loaded(slot.index, frame, None, numbered_truth(slot)))
        del frame
        most = max(most, len(alive))
    assert most <= 4  # those two, the selected one, which is the newest, and the one that arrives
    assert len(beside(bench).replaced) >= 30


def test_what_cannot_be_segmented_is_a_defect() -> None:
    """A policy must not choose what the segmenter refuses: the sum of the fates would not hold."""
    background = Background(lambda frame, then, free: then(None), lambda frame: None)
    with pytest.raises(ValueError, match="frame 3 was chosen"):
        background.hand(Frame(3, 3, np.zeros((1, 1, 3), np.uint8)), "first")
