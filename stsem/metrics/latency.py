"""How late answers are: from arrival, from the sensor's stamp, and where the time goes (DESIGN 5)."""

from array import array
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from operator import attrgetter
from typing import ClassVar

from stsem.metrics.durations import Summary, summarise
from stsem.packed import IntByIndex
from stsem.result import ANSWER_STAGES, FrameResult, Span, Spans

_FRAME = attrgetter("frame")


@dataclass(frozen=True)
class StageTiming:
    """One stage over all its jobs: waiting = start - ready, service = end - start."""

    waiting: Summary
    service: Summary


@dataclass(frozen=True)
class Latency:
    """Latencies of the answered frames on the simulated clock.

    Args:
        from_arrival: answered - arrived: the pipeline's own share.
        from_stamp: answered - captured: from sensor to result.
        waiting: the part of `from_arrival` during which no job of the frame's answer held a core.
        stages: every stage that ran, on and beside the answer path.
        inside: the stages that ran between arrival and answer: what `from_arrival` contains.
    """

    from_arrival: Summary | None
    from_stamp: Summary | None
    waiting: Summary | None
    stages: Mapping[str, StageTiming]
    inside: tuple[str, ...]


def latency(
    results: Iterable[FrameResult],
    spans: Sequence[Span],
    *,
    distinct_samples: int | None = None,
    answer_stages: Sequence[str] = ANSWER_STAGES,
) -> Latency:
    """Latencies of a run.

    Args:
        results: of every frame.
        spans: every job of the run.
        distinct_samples: of the slowest stage's cost profile; limits which percentiles are stated. None: no limit.
        answer_stages: stages on the answer path.
    """
    meter = LatencyMeter(distinct_samples, answer_stages)
    for result in results:
        meter.update(result)
    return meter.compute(spans)


class LatencyMeter:
    """Accumulates the answered frames of a run; keeps three integers a frame.

    Args:
        distinct_samples, answer_stages: as of `latency`.
    """

    unit: ClassVar[str] = "ms"
    higher_is_better: ClassVar[bool] = False

    def __init__(self, distinct_samples: int | None = None, answer_stages: Sequence[str] = ANSWER_STAGES) -> None:
        self._distinct, self._path = distinct_samples, frozenset(answer_stages)
        self._stamp_ns, self._arrival_ns, self._answered_ns = IntByIndex(), IntByIndex(), IntByIndex()

    def update(self, result: FrameResult) -> None:
        """Add a frame; one without an answer on the clock has no latency."""
        if result.outcome.is_answer and result.arrival_ns is not None and result.answered_ns is not None:
            self._stamp_ns[result.index] = result.stamp_ns
            self._arrival_ns[result.index] = result.arrival_ns
            self._answered_ns[result.index] = result.answered_ns

    def compute(self, spans: Sequence[Span]) -> Latency:
        """The latencies, given every job of the run."""
        inside = Spans(span for span in spans if self._is_inside(span))
        inside.sort(key=_FRAME)
        busy_ns = IntByIndex()
        for frame, jobs in groupby(inside, _FRAME):
            busy_ns[frame] = _busy_ns(jobs)
        end_ns = self._answered_ns
        return Latency(
            from_arrival=self._summary(end_ns[i] - arrival for i, arrival in self._arrival_ns.items()),
            from_stamp=self._summary(end_ns[i] - stamp for i, stamp in self._stamp_ns.items()),
            waiting=self._summary(end_ns[i] - start - busy_ns.get(i, 0) for i, start in self._arrival_ns.items()),
            stages=stage_timings(spans, self._distinct),
            inside=_in_order_of_start(inside),
        )

    def _is_inside(self, span: Span) -> bool:
        answered_ns = self._answered_ns.get(span.frame)
        return answered_ns is not None and span.stage in self._path and span.end_ns <= answered_ns

    def _summary(self, durations_ns: Iterable[int]) -> Summary | None:
        return summarise(durations_ns, self._distinct)


def stage_timings(spans: Iterable[Span], distinct_samples: int | None = None) -> dict[str, StageTiming]:
    """Waiting and service by stage, in order of the names."""
    waiting: defaultdict[str, array[int]] = defaultdict(_times)
    service: defaultdict[str, array[int]] = defaultdict(_times)
    for span in spans:
        waiting[span.stage].append(span.start_ns - span.ready_ns)
        service[span.stage].append(span.end_ns - span.start_ns)
    found = {
        s: (summarise(waiting[s], distinct_samples), summarise(service[s], distinct_samples)) for s in sorted(waiting)
    }
    return {stage: StageTiming(w, s) for stage, (w, s) in found.items() if w is not None and s is not None}


def _times() -> "array[int]":
    return array("q")


def _in_order_of_start(spans: Iterable[Span]) -> tuple[str, ...]:
    """The stages, the one that started first (at equal times: for the older frame) first."""
    first: dict[str, tuple[int, int]] = {}
    for span in spans:
        started = span.start_ns, span.frame
        first[span.stage] = min(started, first.get(span.stage, started))
    return tuple(sorted(first, key=first.__getitem__))


def _busy_ns(spans: Iterable[Span]) -> int:
    """Length of the union of the spans: two jobs of a frame side by side count once."""
    total, until = 0, -1
    for span in sorted(spans, key=lambda s: s.start_ns):
        total += max(0, span.end_ns - max(span.start_ns, until))
        until = max(until, span.end_ns)
    return total
