"""How late answers are: from arrival, from the sensor's stamp, and where the time goes (DESIGN 5)."""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

from stsem.metrics.durations import Summary, summarise
from stsem.result import ANSWER_STAGES, FrameResult, Span


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
        self._answered: dict[int, tuple[int, int, int]] = {}

    def update(self, result: FrameResult) -> None:
        """Add a frame; one without an answer on the clock has no latency."""
        if result.outcome.is_answer and result.arrival_ns is not None and result.answered_ns is not None:
            self._answered[result.index] = (result.stamp_ns, result.arrival_ns, result.answered_ns)

    def compute(self, spans: Sequence[Span]) -> Latency:
        """The latencies, given every job of the run."""
        inside = [span for span in spans if self._is_inside(span)]
        jobs: defaultdict[int, list[Span]] = defaultdict(list)
        for span in inside:
            jobs[span.frame].append(span)
        times = self._answered.items()
        return Latency(
            from_arrival=self._summary(end - arrival for _, (_, arrival, end) in times),
            from_stamp=self._summary(end - stamp for _, (stamp, _, end) in times),
            waiting=self._summary(end - arrival - _busy_ns(jobs[i]) for i, (_, arrival, end) in times),
            stages=stage_timings(spans, self._distinct),
            inside=tuple(dict.fromkeys(span.stage for span in sorted(inside, key=lambda s: (s.start_ns, s.frame)))),
        )

    def _is_inside(self, span: Span) -> bool:
        found = self._answered.get(span.frame)
        return found is not None and span.stage in self._path and span.end_ns <= found[2]

    def _summary(self, durations_ns: Iterable[int]) -> Summary | None:
        return summarise(durations_ns, self._distinct)


def stage_timings(spans: Iterable[Span], distinct_samples: int | None = None) -> dict[str, StageTiming]:
    """Waiting and service by stage, in order of the names."""
    waiting: defaultdict[str, list[int]] = defaultdict(list)
    service: defaultdict[str, list[int]] = defaultdict(list)
    for span in spans:
        waiting[span.stage].append(span.start_ns - span.ready_ns)
        service[span.stage].append(span.end_ns - span.start_ns)
    found = {
        s: (summarise(waiting[s], distinct_samples), summarise(service[s], distinct_samples)) for s in sorted(waiting)
    }
    return {stage: StageTiming(w, s) for stage, (w, s) in found.items() if w is not None and s is not None}


def _busy_ns(spans: Iterable[Span]) -> int:
    """Length of the union of the spans: two jobs of a frame side by side count once."""
    total, until = 0, -1
    for span in sorted(spans, key=lambda s: s.start_ns):
        total += max(0, span.end_ns - max(span.start_ns, until))
        until = max(until, span.end_ns)
    return total
