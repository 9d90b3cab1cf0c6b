"""The state machine on the simulated clock, against schedules worked out by hand."""

from collections import Counter
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stsem.result import Outcome
from stsem.sim.trace import schedule_text

from .conftest import MS, Bench, make_slots


def test_ten_frames_by_hand(bench: type[Bench]) -> None:
    """Frame i arrives at 100 i + 10 ms. Register 30, segment 250 on both cores, propagate 20; a keyframe every 4.

    Frame 0 is registered 10-40 and segmented 40-290; meanwhile 1 (110) is replaced by 2 (210). Frame 2 is registered
    290-320 and propagated 320-340; frame 3 (310) waited, 340-370-390. Frame 4 (410): 4 - 0 >= 4, a keyframe, 440-690;
    5 (510) is replaced by 6 (610). Frame 6: 690-720-740; 7 (710): 740-770-790. Frame 8 (810): keyframe, 840-1090;
    9 (910) waits until 1010, one period after the last arrival: both are pending.
    """
    played = bench(
        make_slots(10), keyframes=4, register=True, queue="latest",
        costs={"register": 30 * MS, "segment": 250 * MS, "propagate": 20 * MS},
    ).play()  # fmt: skip
    expected = """\
        start ms           end ms        waited ms  cores frame stage
       10.000000        40.000000         0.000000  0         0 register
       40.000000       290.000000         0.000000  0+1       0 segment
      290.000000       320.000000         0.000000  0         2 register
      320.000000       340.000000         0.000000  0         2 propagate
      340.000000       370.000000         0.000000  0         3 register
      370.000000       390.000000         0.000000  0         3 propagate
      410.000000       440.000000         0.000000  0         4 register
      440.000000       690.000000         0.000000  0+1       4 segment
      690.000000       720.000000         0.000000  0         6 register
      720.000000       740.000000         0.000000  0         6 propagate
      740.000000       770.000000         0.000000  0         7 register
      770.000000       790.000000         0.000000  0         7 propagate
      810.000000       840.000000         0.000000  0         8 register
      840.000000      1090.000000         0.000000  0+1       8 segment
"""
    assert schedule_text(played.run.spans) == expected
    assert [(r.index, str(r.outcome), r.keyframe, r.answered_ns) for r in played.record.results] == [
        (0, "segmented", 0, 290 * MS), (1, "dropped_busy", None, None), (2, "propagated", 0, 340 * MS),
        (3, "propagated", 0, 390 * MS), (4, "segmented", 4, 690 * MS), (5, "dropped_busy", None, None),
        (6, "propagated", 4, 740 * MS), (7, "propagated", 4, 790 * MS), (8, "pending", None, None),
        (9, "pending", None, None),
    ]  # fmt: skip


def test_ten_times_slower_than_real_time(bench: type[Bench]) -> None:
    """The network takes ten periods: it ends exactly when a frame arrives, and takes the one that waited before it.

    The horizon, one period after the last arrival, is 3010 ms: frame 19 makes it, frame 29 starts there and is pending.
    """
    played = bench(make_slots(30), keyframes=None, register=False, queue="latest", costs={"segment": 1000 * MS}).play()
    assert [(s.frame, s.start_ns // MS, s.end_ns // MS) for s in played.run.spans] == [
        (0, 10, 1010), (9, 1010, 2010), (19, 2010, 3010), (29, 3010, 4010),
    ]  # fmt: skip
    outcomes = Counter(r.outcome for r in played.record.results)
    assert outcomes == {Outcome.SEGMENTED: 3, Outcome.DROPPED_BUSY: 26, Outcome.PENDING: 1}
    assert [r.index for r in played.record.results] == list(range(30))


def test_streaming_judges_what_was_there(bench: type[Bench]) -> None:
    """With 150 ms of network at 100 ms a frame, each arrival finds the newest finished answer, never its own."""
    played = bench(make_slots(4), keyframes=None, register=False, queue="latest", costs={"segment": 150 * MS}).play()
    assert played.record.scorecard is not None
    streaming = played.record.scorecard.compute().streaming
    assert streaming is not None
    # Answers: frame 0 at 160, frame 1 at 310. Frames 0 and 1 arrive before any; 2 (210) sees 0; 3 (310) sees 1.
    assert streaming.misses == 2
    matrix = streaming.matrix
    assert [(t, p) for t in range(4) for p in range(5) if matrix[t, p]] == [(0, 4), (1, 4), (2, 0), (3, 1)]


@pytest.mark.parametrize(
    ("queue", "taken"),
    [("latest", [0, 2, 4]), ("fifo:2", [0, 1, 2]), ("lossless", [0, 1, 2])],
)
def test_queue_rules(bench: type[Bench], queue: str, taken: list[int]) -> None:
    """250 ms of network: `latest` skips to the newest, `fifo:2` and `lossless` keep the oldest.

    At 510 ms frame 2 is finished and frame 5 arrives; a finish comes first, so 4 is taken.
    """
    played = bench(make_slots(8), keyframes=None, register=False, queue=queue, costs={"segment": 250 * MS}).play()
    assert [s.frame for s in played.run.spans][:3] == taken
    dropped = sum(r.outcome is Outcome.DROPPED_BUSY for r in played.record.results)
    assert (dropped > 0) == (queue != "lossless")


def test_undecodable_frames_never_reach_the_queue(bench: type[Bench]) -> None:
    """They have an outcome, they are judged streaming, and nobody works for them."""
    costs = {"segment": 50 * MS}
    played = bench(make_slots(4), keyframes=None, register=False, queue="latest", costs=costs).play(frozenset({1}))
    assert [str(r.outcome) for r in played.record.results] == ["segmented", "undecodable", "segmented", "segmented"]
    assert played.record.scorecard is not None
    streaming = played.record.scorecard.compute().streaming
    assert streaming is not None
    assert streaming.frames == 4


@settings(max_examples=60, deadline=None)
@given(
    count=st.integers(1, 25), keyframes=st.one_of(st.none(), st.integers(1, 6)), register=st.booleans(),
    queue=st.sampled_from(["latest", "fifo:1", "fifo:3", "lossless"]),
    costs=st.fixed_dictionaries({name: st.integers(0, 400) for name in ("register", "segment", "propagate")}),
    broken=st.frozensets(st.integers(0, 24), max_size=5),
)  # fmt: skip
def test_every_frame_ends_once(
    count: int, keyframes: int | None, register: bool, queue: str, costs: dict[str, int], broken: frozenset[int]
) -> None:
    """Whatever the costs and the queue: one outcome per frame, answers after arrivals, one frame at a time."""
    prices: dict[str, Any] = {name: cost * MS for name, cost in costs.items()}
    played = Bench(make_slots(count), keyframes=keyframes, register=register, queue=queue, costs=prices).play(broken)
    results = played.record.results
    assert [r.index for r in results] == list(range(count))
    assert {r.index for r in results if r.outcome is Outcome.UNDECODABLE} == {i for i in broken if i < count}
    answered = [r for r in results if r.answered_ns is not None]
    assert all(r.arrival_ns <= r.taken_ns <= r.answered_ns for r in answered)  # type: ignore[operator]
    taken = sorted((r.taken_ns, r.answered_ns) for r in answered)
    assert all(later[0] >= earlier[1] for earlier, later in pairwise(taken))  # type: ignore[operator]
