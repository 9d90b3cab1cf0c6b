"""The highest sustained rate, against what can be worked out by hand."""

from collections import deque
from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stsem.result import FrameResult, Outcome
from stsem.search.sustainable import HIGHEST, LOWEST, Attempt, Sustainable, search, sustained

MS = 1_000_000
PERIOD_NS = 100 * MS


def result(index: int, outcome: Outcome, latency_ns: int | None = None) -> FrameResult:
    answered = None if latency_ns is None else index * MS + latency_ns
    return FrameResult(index, index * MS, index * MS, index * MS, answered, outcome)


def answered(*latencies_ms: int) -> list[FrameResult]:
    return [result(i, Outcome.SEGMENTED, ms * MS) for i, ms in enumerate(latencies_ms)]


def ended(outcome: Outcome, count: int) -> list[FrameResult]:
    return [result(1000 + i, outcome) for i in range(count)]


def constant(cost_ns: int, *, drops: bool, frames: int = 1500) -> Attempt:
    """A server that takes `cost_ns` a frame, with a mailbox of one (newest wins) or with a queue without end."""

    def attempt(rate: Fraction) -> list[FrameResult]:
        free, results = 0, []
        waiting: deque[tuple[int, int]] = deque()
        for i in range(frames):
            now = int(i * PERIOD_NS / rate)
            while waiting and free <= now:
                index, arrival = waiting.popleft()
                free = max(free, arrival) + cost_ns
                results.append(FrameResult(index, arrival, arrival, arrival, free, Outcome.SEGMENTED))
            if drops and waiting:
                index, arrival = waiting.pop()
                results.append(FrameResult(index, arrival, arrival, None, None, Outcome.DROPPED_BUSY))
            waiting.append((i, now))
        end = int((frames - 1) * PERIOD_NS / rate) + PERIOD_NS
        for index, arrival in waiting:
            free = max(free, arrival) + cost_ns
            done = free <= end
            outcome = Outcome.SEGMENTED if done else Outcome.PENDING
            results.append(FrameResult(index, arrival, arrival, arrival, free if done else None, outcome))
        return results

    return attempt


def test_p95_without_interpolation() -> None:
    """Of 20 latencies the 19th counts: one may be late, two may not."""
    assert sustained(answered(*[100] * 19, 500), 100 * MS)
    assert not sustained(answered(*[100] * 18, 500, 500), 100 * MS)


def test_the_deadline_itself_is_in_time() -> None:
    """A nanosecond more is not."""
    assert sustained(answered(100), 100 * MS)
    assert not sustained(answered(100), 100 * MS - 1)


def test_one_per_cent_may_drop() -> None:
    """One frame of a hundred; frames that could not be offered are no part of the hundred."""
    assert sustained(answered(*[1] * 99) + ended(Outcome.DROPPED_BUSY, 1), MS)
    assert not sustained(answered(*[1] * 98) + ended(Outcome.DROPPED_BUSY, 1), MS)
    broken = ended(Outcome.UNDECODABLE, 50) + ended(Outcome.INCOMPLETE, 50)
    assert not sustained(answered(*[1] * 98) + ended(Outcome.DROPPED_BUSY, 1) + broken, MS)


def test_a_pending_frame_is_late() -> None:
    """A backlog is not sustained because nothing was dropped."""
    assert not sustained(answered(*[1] * 10) + ended(Outcome.PENDING, 90), MS)
    assert sustained(answered(*[1] * 19) + ended(Outcome.PENDING, 1), MS)


def test_nothing_answered_is_not_sustained() -> None:
    """Nor is an empty log."""
    assert not sustained([], MS)
    assert not sustained(ended(Outcome.UNDECODABLE, 5), MS)
    assert not sustained(ended(Outcome.NO_SOURCE, 5), MS)


@pytest.mark.parametrize("drops", [True, False])
@pytest.mark.parametrize("cost_ms", [7, 40, 90, 99])
def test_constant_cost(cost_ms: int, drops: bool) -> None:
    """Cost c sustains 1/c, to the 1 % that may drop and the step of the search."""
    found = search(constant(cost_ms * MS, drops=drops), capture_hz=10.0, deadline_ns=PERIOD_NS)
    assert not found.on_bound
    assert found.hz == pytest.approx(1000 / cost_ms, rel=0.02)
    assert found.rate is not None
    assert found.hz == float(found.rate) * 10.0


def test_bounds() -> None:
    """Slower than anything tried, and faster."""
    assert search(constant(101 * MS, drops=True), capture_hz=10.0, deadline_ns=PERIOD_NS) == Sustainable(
        None, None, on_bound=False
    )
    found = search(constant(1, drops=True), capture_hz=10.0, deadline_ns=PERIOD_NS)
    assert found == Sustainable(HIGHEST, 640.0, on_bound=True)


@settings(max_examples=50, deadline=None)
@given(limit=st.fractions(LOWEST, HIGHEST))
def test_any_threshold_is_found(limit: Fraction) -> None:
    """For anything that holds up to a rate and not beyond, what is found holds, and a little more does not."""

    def attempt(rate: Fraction) -> list[FrameResult]:
        return answered(1 if rate <= limit else 3)

    found = search(attempt, capture_hz=1.0, deadline_ns=2 * MS)
    assert found.rate is not None
    assert found.rate <= limit
    assert limit <= found.rate * Fraction(1003, 1000) + Fraction(1, 4096)
