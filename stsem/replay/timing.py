"""From results and spans to the timing part of a report."""

from collections.abc import Sequence
from fractions import Fraction

from stsem.document import timing as doc
from stsem.metrics.durations import Summary
from stsem.metrics.latency import Latency
from stsem.metrics.throughput import Throughput
from stsem.result import STAGES


def distribution(found: Summary | None) -> doc.Distribution:
    """Order statistics as the report has them; empty when there are none."""
    if found is None:
        return doc.Distribution()
    return doc.Distribution(
        p50=found.p50, p90=found.p90, p95=found.p95, p99=found.p99, p999=found.p999, max=found.max, mean=found.mean,
        n=found.n, n_distinct=found.n_distinct,
    )  # fmt: skip


def latency(found: Latency) -> doc.Latency:
    """Latencies in simulated milliseconds."""
    return doc.Latency(
        from_arrival=distribution(found.from_arrival), from_stamp=distribution(found.from_stamp),
        waiting=distribution(found.waiting),
        stages={
            stage: doc.StageLatency(waiting=distribution(times.waiting), service=distribution(times.service))
            for stage, times in found.stages.items()
        },
    )  # fmt: skip


def throughput(found: Throughput, deadline_ns: int, sustainable_hz: float | None) -> doc.Throughput:
    """Rates on the simulated clock."""
    return doc.Throughput(
        output_hz=found.output_hz, offered_hz=found.offered_hz, outputs=found.outputs,
        processed_share=found.processed_share, utilisation=found.utilisation, deadline_ms=deadline_ns / 1e6,
        deadline_misses=found.deadline_misses, jitter_ms=found.jitter_ms, real_time_factor=found.real_time_factor,
        sustainable_hz=sustainable_hz,
    )  # fmt: skip


def deadline_ns(deadline_ms: float | None, period_ns: int, rate: Fraction) -> int:
    """The deadline from arrival: as given, else the capture period / rate."""
    if deadline_ms is not None:
        return round(deadline_ms * 1e6)
    return period_ns * rate.denominator // rate.numerator


def outcomes(counts: dict[str, int]) -> doc.Outcomes:
    """Outcome counts by name."""
    return doc.Outcomes(**counts)


def stages_inside(names: Sequence[str]) -> tuple[str, ...]:
    """Stages that the latency contains, in pipeline order."""
    return tuple(stage for stage in STAGES if stage in names)
