"""The highest rate at which the pipeline keeps up, by bisection on the simulated clock (DESIGN 5)."""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction

from stsem.metrics.durations import percentile_ns
from stsem.result import FrameResult, Outcome

MAX_DROPPED_SHARE = Fraction(1, 100)
P95_PER_MILLE = 950
LOWEST, HIGHEST = Fraction(1, 64), Fraction(64)
STEPS = 12

Attempt = Callable[[Fraction], list[FrameResult]]
"""Replays the log at a rate and returns the result of every frame."""


@dataclass(frozen=True)
class Sustainable:
    """What the search found.

    Args:
        rate: highest sustained replay rate; None if not even the lowest tried is sustained.
        hz: the same in frames per second.
        on_bound: whether the highest rate tried was sustained, so that the true one may be higher.
    """

    rate: Fraction | None
    hz: float | None
    on_bound: bool


def search(attempt: Attempt, *, capture_hz: float, deadline_ns: int) -> Sustainable:
    """Bisect the replay rate between 1/64 and 64 in steps of a factor, 12 times.

    Args:
        attempt: replays at a rate.
        capture_hz: frames per second of the log at rate 1.
        deadline_ns: fixed, from arrival; it does not shrink as the rate grows.
    """
    low, high = LOWEST, HIGHEST
    if not sustained(attempt(low), deadline_ns):
        return Sustainable(None, None, on_bound=False)
    if sustained(attempt(high), deadline_ns):
        return Sustainable(high, float(high) * capture_hz, on_bound=True)
    for _ in range(STEPS):
        middle = Fraction(round(float(low * high) ** 0.5 * 4096), 4096)
        if sustained(attempt(middle), deadline_ns):
            low = middle
        else:
            high = middle
    return Sustainable(low, float(low) * capture_hz, on_bound=False)


def sustained(results: list[FrameResult], deadline_ns: int) -> bool:
    """Whether at most 1 % of the frames drop, and p95 from arrival (without interpolation) stays under the deadline.

    A frame that is still pending counts as late: a queue that drops nothing would hide a backlog otherwise. The attempt
    must wait for it for as long as the deadline.
    """
    dropped = sum(r.outcome is Outcome.DROPPED_BUSY for r in results)
    offered = sum(r.outcome not in (Outcome.UNDECODABLE, Outcome.INCOMPLETE) for r in results)
    latencies = [
        r.answered_ns - r.arrival_ns for r in results if r.answered_ns is not None and r.arrival_ns is not None
    ]
    if not latencies or dropped > MAX_DROPPED_SHARE * offered:
        return False
    pending = sum(r.outcome is Outcome.PENDING for r in results)
    return percentile_ns(sorted([*latencies, *[deadline_ns + 1] * pending]), P95_PER_MILLE) <= deadline_ns
