"""How fast answers come out, and how busy the cores are (DESIGN 5)."""

from array import array
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import ClassVar

import numpy as np

from stsem.result import FrameResult, Span

SECOND_NS = 1_000_000_000


@dataclass(frozen=True)
class Throughput:
    """Rates of a real-time run; None where there are too few events for the number to mean something.

    Args:
        output_hz: (N - 1) / (t_last - t_first) over the N answers.
        offered_hz: the same over the arrivals.
        outputs: N.
        processed_share: answered frames / all frames.
        real_time_factor: seconds of log between the first and the last answered frame's stamps, per simulated second
            between their answers; 1 keeps up with the recording, below 1 falls behind.
        jitter_ms: standard deviation of the intervals between answers, of this very population (no n - 1): it
            describes the run, it does not estimate another one.
        deadline_misses: frames answered later than the deadline after arrival, or not at all; None without a deadline.
        utilisation: busy share of each core, core 0 first, from the first arrival to the last event of the run.
    """

    output_hz: float | None
    offered_hz: float | None
    outputs: int
    processed_share: float | None
    real_time_factor: float | None
    jitter_ms: float | None
    deadline_misses: int | None
    utilisation: tuple[float, ...]


def throughput(
    results: Iterable[FrameResult],
    spans: Sequence[Span],
    *,
    cores: int = 2,
    deadline_ns: int | None = None,
    rate: float = 1.0,
) -> Throughput:
    """Throughput of a run.

    Args:
        results: of every frame of the log.
        spans: every job of the run.
        cores: size of the core pool.
        deadline_ns: from arrival.
        rate: simulated stamps are the log's divided by it.
    """
    meter = ThroughputMeter(cores=cores, deadline_ns=deadline_ns, rate=rate)
    for result in results:
        meter.update(result)
    return meter.compute(spans)


class ThroughputMeter:
    """Accumulates the frames of a run; arguments as of `throughput`."""

    unit: ClassVar[str] = "Hz"
    higher_is_better: ClassVar[bool] = True

    def __init__(self, *, cores: int = 2, deadline_ns: int | None = None, rate: float = 1.0) -> None:
        self._cores, self._deadline_ns, self._rate = cores, deadline_ns, rate
        self._arrivals, self._answers, self._answered_stamps = array("q"), array("q"), array("q")
        self._frames = self._in_time = 0

    def update(self, result: FrameResult) -> None:
        """Add a frame."""
        self._frames += 1
        if result.arrival_ns is None:
            return
        self._arrivals.append(result.arrival_ns)
        if result.outcome.is_answer and result.answered_ns is not None:
            self._answers.append(result.answered_ns)
            self._answered_stamps.append(result.stamp_ns)
            deadline_ns = self._deadline_ns
            self._in_time += deadline_ns is not None and result.answered_ns - result.arrival_ns <= deadline_ns

    def compute(self, spans: Sequence[Span]) -> Throughput:
        """The rates, given every job of the run."""
        times = sorted(self._answers)
        return Throughput(
            output_hz=rate_hz(times),
            offered_hz=rate_hz(self._arrivals),
            outputs=len(times),
            processed_share=len(times) / self._frames if self._frames else None,
            real_time_factor=self._real_time_factor(times),
            jitter_ms=jitter_ms(times),
            deadline_misses=None if self._deadline_ns is None else self._frames - self._in_time,
            utilisation=utilisation(spans, self._cores, self._arrivals),
        )

    def _real_time_factor(self, times_ns: Sequence[int]) -> float | None:
        if len(times_ns) < 2 or times_ns[-1] == times_ns[0]:
            return None
        stamps = self._answered_stamps
        return self._rate * (max(stamps) - min(stamps)) / (times_ns[-1] - times_ns[0])


def rate_hz(times_ns: Sequence[int]) -> float | None:
    """(N - 1) / (t_last - t_first): N events bound N - 1 intervals. None for fewer than two instants."""
    if len(times_ns) < 2 or max(times_ns) == min(times_ns):
        return None
    return (len(times_ns) - 1) * SECOND_NS / (max(times_ns) - min(times_ns))


def jitter_ms(ascending_ns: Sequence[int]) -> float | None:
    """Population standard deviation of the intervals, milliseconds; None for fewer than two intervals."""
    if len(ascending_ns) < 3:
        return None
    return float(np.diff(np.asarray(ascending_ns, np.int64)).std() / 1e6)


def utilisation(spans: Sequence[Span], cores: int, arrivals_ns: Sequence[int]) -> tuple[float, ...]:
    """Busy share of each core between the first arrival and the last event (arrival, or end of a job); () without."""
    if not arrivals_ns:
        return ()
    start = min(arrivals_ns)
    extent = max(chain(arrivals_ns, (span.end_ns for span in spans))) - start
    busy = [sum(s.end_ns - s.start_ns for s in spans if core in s.cores) for core in range(cores)]
    return tuple(ns / extent for ns in busy) if extent else ()
