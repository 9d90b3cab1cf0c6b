"""Order statistics of durations, stated only when there are enough samples for them."""

from array import array
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import ClassVar

MIN_SAMPLES = {500: 11, 900: 64, 950: 130, 990: 662, 999: 6636}
"""Per mille -> samples from which that percentile is stated (MLPerf LoadGen's early-stopping bound)."""


@dataclass(frozen=True)
class Summary:
    """Order statistics of one kind of duration, in milliseconds.

    Args:
        p50, p90, p95, p99, p999: sorted[ceil(p n) - 1], no interpolation; None: n too small (see `MIN_SAMPLES`).
        max, mean: always stated.
        n: durations.
        n_distinct: distinct samples of the cost profile behind them; None when they are independent measurements.
    """

    p50: float | None
    p90: float | None
    p95: float | None
    p99: float | None
    p999: float | None
    max: float
    mean: float
    n: int
    n_distinct: int | None = None

    @property
    def n_effective(self) -> int:
        """What `MIN_SAMPLES` is applied to: the smaller of `n` and `n_distinct`."""
        return self.n if self.n_distinct is None else min(self.n, self.n_distinct)


def percentile_ns(ascending_ns: Sequence[int], per_mille: int) -> int:
    """sorted[ceil(p n) - 1] with p = `per_mille` / 1000, in integers.

    Raises:
        ValueError: the list is empty or `per_mille` is not in 1..1000.
    """
    if not ascending_ns or not 1 <= per_mille <= 1000:
        raise ValueError(f"no {per_mille} per mille point of {len(ascending_ns)} durations")
    return ascending_ns[-(-per_mille * len(ascending_ns) // 1000) - 1]


def summarise(durations_ns: Iterable[int], distinct_samples: int | None = None) -> Summary | None:
    """Summary of durations in nanoseconds; None when there are none.

    Args:
        durations_ns: in any order.
        distinct_samples: of the slowest stage's cost profile: replaying 12 measured costs 10,000 times does not make
            a p99. None: the durations are independent measurements.
    """
    ascending = sorted(durations_ns)
    if not ascending:
        return None
    n = len(ascending)
    effective = n if distinct_samples is None else min(n, distinct_samples)

    def point(per_mille: int) -> float | None:
        return percentile_ns(ascending, per_mille) / 1e6 if effective >= MIN_SAMPLES[per_mille] else None

    return Summary(
        p50=point(500), p90=point(900), p95=point(950), p99=point(990), p999=point(999),
        max=ascending[-1] / 1e6, mean=sum(ascending) / n / 1e6, n=n, n_distinct=distinct_samples,
    )  # fmt: skip


class Durations:
    """Accumulates one kind of duration; every sample is kept, for percentiles and plots."""

    unit: ClassVar[str] = "ms"
    higher_is_better: ClassVar[bool] = False

    def __init__(self, distinct_samples: int | None = None) -> None:
        self._distinct = distinct_samples
        self.samples_ns = array("q")

    def update(self, duration_ns: int) -> None:
        """Add one duration in nanoseconds."""
        self.samples_ns.append(duration_ns)

    def compute(self) -> Summary | None:
        """Summary so far; None before the first duration."""
        return summarise(self.samples_ns, self._distinct)
