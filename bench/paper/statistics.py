"""Mean and spread over seeds, and the one rule that calls a difference; written before any result."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

T95 = (12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262)
"""Student's t of a two-sided 95 % interval, for 1 to 9 degrees of freedom."""


@dataclass(frozen=True)
class Spread:
    """Values over seeds: how many, their mean, and their standard deviation (n - 1; None for one value)."""

    n: int
    mean: float
    deviation: float | None


@dataclass(frozen=True)
class Comparison:
    """A less B, paired by seed.

    Args:
        spread: of the differences.
        margin: half the width of the 95 % interval of their mean; None for fewer than two seeds.
    """

    spread: Spread
    margin: float | None

    @property
    def called(self) -> bool:
        """Whether the interval leaves out 0, so that this is called a difference."""
        return self.margin is not None and abs(self.spread.mean) > self.margin


def spread(values: Sequence[float]) -> Spread:
    """Mean and deviation of at least one value."""
    mean = math.fsum(values) / len(values)
    if len(values) == 1:
        return Spread(1, mean, None)
    return Spread(len(values), mean, math.sqrt(math.fsum((v - mean) ** 2 for v in values) / (len(values) - 1)))


def compare(a: Mapping[int, float], b: Mapping[int, float]) -> Comparison:
    """A less B over the seeds that both have.

    Raises:
        ValueError: they share no seed, or more than ten.
    """
    shared = sorted(a.keys() & b.keys())
    if not 1 <= len(shared) <= len(T95) + 1:
        raise ValueError(f"a comparison takes 1 to {len(T95) + 1} shared seeds, but {len(shared)} came")
    found = spread([a[seed] - b[seed] for seed in shared])
    if found.deviation is None:
        return Comparison(found, None)
    return Comparison(found, T95[found.n - 2] * found.deviation / math.sqrt(found.n))
