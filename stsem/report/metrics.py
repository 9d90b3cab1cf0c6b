"""The metrics that tables and comparisons show: where each stands in a run, its name, unit and direction."""

from collections.abc import Sequence
from dataclasses import dataclass

from stsem.document.accuracy import Score
from stsem.document.part import Part
from stsem.document.schema import Comparison, ComparisonRow, Document, Run
from stsem.document.timing import Distribution, Latency, Throughput
from stsem.report.wording import NONE, NOT_MEASURED, meaning, number, percent, percentile, points, signed


@dataclass(frozen=True)
class Metric:
    """One row of a table.

    Args:
        path: where it stands inside a run, e.g. `offline.miou`; also its name in `comparison.rows`.
        name: for readers, with its unit.
        unit: `fraction`, `ms` or `Hz`.
        part, field: where the schema defines it.
    """

    path: str
    name: str
    unit: str
    part: type[Part]
    field: str

    @property
    def meaning(self) -> str:
        """The sentence of the schema that defines it."""
        return meaning(self.part, self.field)

    def shown(self, run: Run) -> str:
        """The value in a run, in words if there is none."""
        return shown(run, self.path)


def _score(name: str) -> list[Metric]:
    return [
        Metric(f"{name}.miou", f"mIoU {name}, %", "fraction", Score, "miou"),
        Metric(f"{name}.pixel_accuracy", f"pixel accuracy {name}, %", "fraction", Score, "pixel_accuracy"),
    ]


def _latency(field: str) -> Metric:
    return Metric(f"latency_ms.from_arrival.{field}", f"latency {field}, ms", "ms", Distribution, field)


METRICS: dict[str, Metric] = {
    metric.path: metric
    for metric in [
        *_score("offline"), *_score("delivered"), *_score("streaming"),
        Metric("delivered_paired.miou", "mIoU delivered, dropped = wrong, %", "fraction", Score, "miou"),
        Metric("delivered_paired.pixel_accuracy", "pixel accuracy delivered, dropped = wrong, %", "fraction", Score,
               "pixel_accuracy"),
        *(_latency(field) for field in ("p50", "p90", "p95", "p99", "max", "mean")),
        Metric("latency_ms.from_stamp.p50", "latency from stamp p50, ms", "ms", Latency, "from_stamp"),
        Metric("throughput.output_hz", "output rate, Hz", "Hz", Throughput, "output_hz"),
        Metric("throughput.processed_share", "frames answered, %", "fraction", Throughput, "processed_share"),
        Metric("throughput.jitter_ms", "jitter, ms", "ms", Throughput, "jitter_ms"),
    ]
}  # fmt: skip


def value(run: Run, path: str) -> object:
    """What stands at a dotted path inside a run; None where a part on the way was not measured."""
    found: object = run
    for key in path.split("."):
        found = found.get(key) if isinstance(found, dict) else getattr(found, key, None)
    return found


def shown(run: Run, path: str) -> str:
    """The number at `path` for readers; `–` where its whole part did not run."""
    parent, _, field = path.rpartition(".")
    part = value(run, parent)
    if part is None:
        return NONE
    if isinstance(part, Distribution):
        return (
            number(part.mean if field == "mean" else part.max) if field in ("mean", "max") else percentile(part, field)
        )
    found = getattr(part, field)
    if found is None:
        return NOT_MEASURED
    metric = METRICS.get(path)
    return percent(found) if metric and metric.unit == "fraction" else number(found, 2 if path.endswith("hz") else 1)


def comparisons(document: Document) -> tuple[Comparison, ...]:
    """The first mode against each further one."""
    return (*((document.comparison,) if document.comparison else ()), *document.more_comparisons)


def row_name(row: ComparisonRow) -> str:
    """A comparison's metric for readers."""
    return METRICS[row.metric].name if row.metric in METRICS else row.metric


def row_value(row: ComparisonRow, number_or_none: float | None) -> str:
    """A value of a comparison row in its own unit, per cent for fractions."""
    if row.unit == "fraction":
        return percent(number_or_none)
    return number(number_or_none, 2 if row.unit == "Hz" else 1)


def row_delta(row: ComparisonRow) -> str:
    """The difference with its interval, in points for fractions: `+7.7 [+5.1, +10.2]`."""
    if row.delta is None:
        return NOT_MEASURED
    write = points if row.unit == "fraction" else signed
    digits = 2 if row.unit == "Hz" else 1
    interval = "" if row.ci95 is None else f" [{write(row.ci95[0], digits)}, {write(row.ci95[1], digits)}]"
    return write(row.delta, digits) + interval


def row_reading(row: ComparisonRow, base: str, other: str) -> str:
    """What the interval says: who is better, or that it cannot be told; without one, that there is none."""
    if row.delta is None:
        return NOT_MEASURED
    if row.ci95 is None:
        return "no interval"
    low, high = row.ci95
    if low <= 0 <= high:
        return "no clear difference"
    return f"{other} better" if (low > 0) == row.higher_is_better else f"{base} better"


def no_intervals(rows: Sequence[ComparisonRow]) -> tuple[str, ...]:
    """Why there is no interval: one sentence per reason, with the metrics that it holds for."""
    reasons: dict[str, list[str]] = {}
    for row in rows:
        if row.ci95 is None and row.why_no_interval:
            reasons.setdefault(row.why_no_interval, []).append(row_name(row).rpartition(",")[0] or row_name(row))
    return tuple(f"No interval for {', '.join(names)}: {reason}." for reason, names in reasons.items())
