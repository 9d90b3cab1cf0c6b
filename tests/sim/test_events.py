"""The clock: one total order, and no way back."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stsem.sim.events import EventQueue, Priority


def test_the_order_is_time_then_priority_then_call() -> None:
    queue, seen = EventQueue(), []
    for name, time_ns, priority in [
        ("start", 5, Priority.START),
        ("other", 5, Priority.OTHER),
        ("arrival a", 5, Priority.ARRIVAL),
        ("late finish", 6, Priority.FINISH),
        ("finish", 5, Priority.FINISH),
        ("arrival b", 5, Priority.ARRIVAL),
    ]:
        queue.schedule(time_ns, priority, lambda name=name: seen.append((queue.now_ns, name)))
    queue.run()
    assert seen == [
        (5, "finish"),
        (5, "arrival a"),
        (5, "arrival b"),
        (5, "other"),
        (5, "start"),
        (6, "late finish"),
    ]


def test_an_event_may_schedule_into_its_own_instant() -> None:
    queue, seen = EventQueue(), []

    def arrive() -> None:
        queue.schedule(queue.now_ns, Priority.FINISH, lambda: seen.append("finish of the same instant"))

    queue.schedule(3, Priority.ARRIVAL, arrive)
    queue.schedule(3, Priority.OTHER, lambda: seen.append("other"))
    queue.run()
    assert seen == ["finish of the same instant", "other"]


def test_the_past_cannot_be_changed() -> None:
    queue = EventQueue(start_ns=10)
    with pytest.raises(ValueError, match="the past cannot be changed"):
        queue.schedule(9, Priority.ARRIVAL, lambda: None)
    with pytest.raises(ValueError, match="it is 10 ns already"):
        queue.run_until(9)


@pytest.mark.parametrize("time_ns", [1.0, np.int64(1), True])
def test_only_ints_are_times(time_ns: object) -> None:
    with pytest.raises(TypeError, match="simulated times are ints"):
        EventQueue().schedule(time_ns, Priority.ARRIVAL, lambda: None)  # type: ignore[arg-type]


def test_run_until_includes_its_end_and_stands_there() -> None:
    queue, seen = EventQueue(), []
    for time_ns in (1, 5, 6):
        queue.schedule(time_ns, Priority.ARRIVAL, lambda: seen.append(queue.now_ns))
    queue.run_until(5)
    assert (seen, queue.now_ns, len(queue)) == ([1, 5], 5, 1)
    queue.run_until(8)
    assert (seen, queue.now_ns, len(queue)) == ([1, 5, 6], 8, 0)
    assert not queue.step()


@settings(max_examples=100, derandomize=True)
@given(st.lists(st.tuples(st.integers(0, 5), st.sampled_from(Priority)), max_size=30))
def test_any_set_of_events_comes_out_sorted(events: list[tuple[int, Priority]]) -> None:
    queue, seen = EventQueue(), []
    for i, (time_ns, priority) in enumerate(events):
        queue.schedule(time_ns, priority, lambda key=(time_ns, priority, i): seen.append(key))
    queue.run()
    assert seen == sorted((time_ns, priority, i) for i, (time_ns, priority) in enumerate(events))
