"""Modes against each other, paired over the same frames (promise P4)."""

from collections.abc import Callable
from dataclasses import dataclass

from stsem.document.schema import Comparison, ComparisonRow, Run
from stsem.metrics.accumulate import Samples
from stsem.metrics.blocks import Blocks, NoInterval
from stsem.metrics.bootstrap import Metric, paired_difference, shared_blocks
from stsem.metrics.scores import scores_of_tally
from stsem.replay.record import Record

SCORE_METRICS: tuple[Metric, ...] = ("miou", "pixel_accuracy")


@dataclass(frozen=True, eq=False)
class Contender:
    """One mode: its part of the report, and the frames behind its scores."""

    part: Run
    real_time: Record | None
    offline: Record | None


@dataclass(frozen=True)
class _Timing:
    metric: str
    value: Callable[[Run], float | None]
    unit: str
    higher_is_better: bool


def _arrival(name: str) -> _Timing:
    def value(run: Run) -> float | None:
        found: float | None = None if run.latency_ms is None else getattr(run.latency_ms.from_arrival, name)
        return found

    return _Timing(f"latency_ms.from_arrival.{name}", value, "ms", higher_is_better=False)


def _throughput(name: str, unit: str) -> _Timing:
    def value(run: Run) -> float | None:
        found: float | None = None if run.throughput is None else getattr(run.throughput, name)
        return found

    return _Timing(f"throughput.{name}", value, unit, higher_is_better=True)


TIMINGS = (
    _arrival("mean"), _arrival("p50"), _arrival("p95"), _arrival("max"),
    _throughput("output_hz", "Hz"), _throughput("processed_share", "fraction"),
)  # fmt: skip


def compare(contenders: list[Contender], seed: int) -> tuple[Comparison, ...]:
    """The first mode against each further one.

    Args:
        contenders: the modes, in the order of the report.
        seed: of the resampling.
    """
    base, *others = contenders
    scores = _scores(contenders, seed) if others else []
    return tuple(
        Comparison(base=base.part.mode, other=other.part.mode, rows=(*scores[i], *_timings(base, other)))
        for i, other in enumerate(others)
    )


def _scores(contenders: list[Contender], seed: int) -> list[list[ComparisonRow]]:
    """For each contender but the first: a row per pass and metric, over blocks of log time that all of them share."""
    passes: dict[str, Callable[[Contender], Samples | None]] = {
        "offline": lambda c: _own(c.offline), "delivered_paired": lambda c: _own(c.real_time), "streaming": _streaming,
    }  # fmt: skip
    rows: list[list[ComparisonRow]] = [[] for _ in contenders[1:]]
    for name, samples_of in passes.items():
        samples = [found for c in contenders if (found := samples_of(c)) is not None and len(found)]
        if len(samples) < len(contenders):
            continue
        for metric in SCORE_METRICS:
            blocks = shared_blocks(samples, metric)
            for row, other in zip(rows, samples[1:], strict=True):
                row.append(_score_row(f"{name}.{metric}", metric, samples[0], other, seed, blocks))
    return rows


def _own(record: Record | None) -> Samples | None:
    return None if record is None or record.scorecard is None else record.scorecard.samples()


def _streaming(contender: Contender) -> Samples | None:
    record = contender.real_time
    return None if record is None or record.scorecard is None else record.scorecard.streaming_samples()


def _score_row(
    path: str, metric: Metric, first: Samples, second: Samples, seed: int, blocks: Blocks | NoInterval
) -> ComparisonRow:
    found = paired_difference(first, second, metric, seed=seed, blocks=blocks)
    values = [getattr(scores_of_tally(samples.tallies.sum(axis=0)), metric) for samples in (first, second)]
    return ComparisonRow(
        metric=path,
        base=values[0],
        other=values[1],
        delta=values[1] - values[0],
        ci95=None if isinstance(found, NoInterval) else (found.low, found.high),
        n=len(first),
        unit="fraction",
        higher_is_better=True,
        why_no_interval=found.reason if isinstance(found, NoInterval) else "",
    )


def _timings(base: Contender, other: Contender) -> list[ComparisonRow]:
    rows = []
    for timing in TIMINGS:
        first, second = timing.value(base.part), timing.value(other.part)
        if first is not None and second is not None:
            rows.append(
                ComparisonRow(
                    metric=timing.metric,
                    base=first,
                    other=second,
                    delta=second - first,
                    n=base.part.frames,
                    unit=timing.unit,
                    higher_is_better=timing.higher_is_better,
                    why_no_interval="the simulated clock repeats exactly",
                )
            )
    return rows
