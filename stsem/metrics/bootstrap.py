"""Intervals of scores and of paired differences: bootstrap-t over blocks of a log, or over logs.

A score is a mean of ratios of sums, IoU_c = sum TP_c / sum (TP_c + FP_c + FN_c) over the frames, so a resample is a
weighted sum of per-block sums and never touches a pixel. Every resample is studentised by its own standard error, from
the linearisation of the score (infinitesimal jackknife), which is what makes the interval right to second order
(Hall 1988; Efron and Tibshirani 1993, section 12.5; Davison and Hinkley 1997, section 2.7.2).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from stsem.chance import generator
from stsem.metrics.accumulate import Samples
from stsem.metrics.blocks import Blocks, NoInterval, cut
from stsem.metrics.scores import ClassMask, Tally

Metric = Literal["miou", "pixel_accuracy"]
Floats = npt.NDArray[np.float64]

RESAMPLES = 2000
MIN_LOGS = 10
_TAIL_PER_MILLE = 25
_NOTHING = 1e-12


@dataclass(frozen=True)
class Interval:
    """A 95 % confidence interval.

    Args:
        value: of the full sample.
        low, high: bounds, inside the range that the score can have.
        standard_error: of `value`.
        units: blocks or logs that were resampled.
        n: frames.
    """

    value: float
    low: float
    high: float
    standard_error: float
    units: int
    n: int


def interval(
    samples: Samples, metric: Metric, *, seed: int, blocks: Blocks | NoInterval | None = None
) -> Interval | NoInterval:
    """Interval of a score of one run.

    Args:
        samples: per-frame tallies.
        metric: `miou` or `pixel_accuracy`.
        seed: of the run; the draws depend on it and on the number of blocks only.
        blocks: shared with other runs (`shared_blocks`); None: cut for these samples alone.
    """
    return _of_blocks([samples], metric, seed, blocks or shared_blocks([samples], metric))


def paired_difference(
    base: Samples, other: Samples, metric: Metric, *, seed: int, blocks: Blocks | NoInterval | None = None
) -> Interval | NoInterval:
    """Interval of score(other) - score(base) over the same frames; a dropped frame is in both, as all "no label".

    Raises:
        ValueError: the two runs were not judged on the same frames.
    """
    return _of_blocks([base, other], metric, seed, blocks or shared_blocks([base, other], metric))


def shared_blocks(runs: Sequence[Samples], metric: Metric) -> Blocks | NoInterval:
    """Blocks for all runs of a log and for the differences from the first: the slowest series decides.

    The series of a run is what each frame adds to the score, linearised: for pixel accuracy the frame's own accuracy,
    weighted by its pixels; for mIoU its share in the mean of the IoUs.

    Raises:
        ValueError: the runs were not judged on the same frames.
    """
    _require_same_frames(runs)
    if not runs[0].class_set.any():
        return NoInterval("no pixel with truth was judged")
    series = [_Ratios(run.tallies, metric, run.class_set).influence() for run in runs]
    differences = [other - series[0] for other in series[1:]]
    return cut(runs[0].stamp_ns, [*series, *differences])


def over_logs(
    base: Sequence[Samples], other: Sequence[Samples] | None, metric: Metric, *, seed: int
) -> Interval | NoInterval:
    """Interval over whole logs, for ten or more: of the pooled score, or of its paired difference `other` - `base`.

    Raises:
        ValueError: the numbers of logs differ, or the frames of a log.
    """
    if other is not None and len(base) != len(other):
        raise ValueError(f"{len(base)} and {len(other)} logs cannot be paired")
    if len(base) < MIN_LOGS:
        return NoInterval(f"{len(base)} logs are too few to resample logs, {MIN_LOGS} are needed")
    for pair in zip(base, other or base, strict=True):
        _require_same_frames(pair)
    runs = [base] if other is None else [base, other]
    tallies = [np.stack([log.tallies.sum(axis=0) for log in run]) for run in runs]
    return _bootstrap(tallies, metric, seed, sum(len(log) for log in base))


class _Ratios:
    """A score as the mean of K ratios of sums over units: per unit a numerator and a denominator for each ratio."""

    def __init__(self, tallies: Tally, metric: Metric, class_set: ClassMask) -> None:
        right, truth, predicted = np.moveaxis(tallies, 1, 0)
        if metric == "miou":
            kept = np.flatnonzero(class_set)
            self.above = right[:, kept] + 0.0
            self.below = truth[:, kept] + 0.0 + predicted[:, kept] - right[:, kept]
        else:
            self.above, self.below = (right.sum(axis=1, keepdims=True) + 0.0, truth.sum(axis=1, keepdims=True) + 0.0)
        self.fill = self.above.sum(axis=0) / self.below.sum(axis=0)

    def resampled(self, counts: Floats) -> tuple[Floats, Floats]:
        """Values (R,) and influences (R, units) for resamples that hold unit u `counts[r, u]` times.

        A class that is in no unit of a resample keeps its ratio of the full sample: the class set never changes.
        """
        # Sums of integers below 2^53: exact, whatever order BLAS adds them in.
        above, below = counts @ self.above, counts @ self.below
        held = below > 0
        ratio = np.where(held, above / np.where(held, below, 1.0), self.fill)
        scale = np.where(held, 1.0 / np.where(held, below, 1.0), 0.0) / ratio.shape[1]
        # einsum, not BLAS: its order of additions does not depend on the number of threads.
        influence = np.einsum("rk,uk->ru", scale, self.above) - np.einsum("rk,uk->ru", scale * ratio, self.below)
        return ratio.mean(axis=1), influence

    def influence(self) -> Floats:
        """(units,) what each unit adds to the value of the full sample, linearised; sums to 0."""
        found: Floats = self.resampled(np.ones((1, len(self.above))))[1][0]
        return found


def _of_blocks(
    runs: Sequence[Samples], metric: Metric, seed: int, blocks: Blocks | NoInterval
) -> Interval | NoInterval:
    _require_same_frames(runs)
    if isinstance(blocks, NoInterval):
        return blocks
    sums = [blocks.sums(run.tallies).astype(np.int64) for run in runs]
    return _bootstrap(sums, metric, seed, len(runs[0]), blocks.inflation)


def _bootstrap(
    tallies: Sequence[npt.NDArray[np.int64]], metric: Metric, seed: int, n: int, inflation: float = 1.0
) -> Interval | NoInterval:
    """Bootstrap-t of the score of tallies (units, 3, C), or of the difference of the second's from the first's."""
    class_set = np.asarray(tallies[0][:, 1].sum(axis=0) > 0)
    if not class_set.any():
        return NoInterval("no pixel with truth was judged")
    scores = [_Ratios(one, metric, class_set) for one in tallies]
    units = len(tallies[0])
    counts = _draws(seed, units)
    value, error = _value_and_error(scores, np.ones((1, units)))
    values, errors = _value_and_error(scores, counts)
    spread = float(error[0]) * inflation**0.5
    low, high = _studentised(float(value[0]), spread, values, errors)
    if not (np.isfinite(low) and np.isfinite(high)):
        return NoInterval(f"too few of the {units} blocks differ from each other")
    floor = 0.0 if len(tallies) == 1 else -1.0
    return Interval(float(value[0]), max(low, floor), min(high, 1.0), spread, units, n)


def _draws(seed: int, units: int) -> Floats:
    """(RESAMPLES, units) how often each resample, `units` draws with replacement, holds each unit."""
    drawn = generator(seed, "bootstrap", units).integers(units, size=(RESAMPLES, units))
    cells = drawn + units * np.arange(RESAMPLES)[:, None]
    return np.bincount(cells.ravel(), minlength=RESAMPLES * units).reshape(RESAMPLES, units).astype(np.float64)


def _value_and_error(scores: Sequence[_Ratios], counts: Floats) -> tuple[Floats, Floats]:
    """Value and standard error (R,) of each resample: the first score, or the second minus the first."""
    values, influences = scores[0].resampled(counts)
    if len(scores) > 1:
        other, other_influences = scores[1].resampled(counts)
        values, influences = other - values, other_influences - influences
    units = counts.shape[1]
    variances: Floats = np.einsum("ru,ru,ru->r", counts, influences, influences) * (units / (units - 1))
    return values, np.sqrt(variances)


def _studentised(value: float, error: float, values: Floats, errors: Floats) -> tuple[float, float]:
    """Bounds value - t error at the order statistics of t = (value* - value) / error*; infinite where t is."""
    if error < _NOTHING:
        return value, value
    off = values - value
    off[np.abs(off) < _NOTHING] = 0.0
    flat = errors < _NOTHING
    t = np.where(flat, np.where(off == 0, 0.0, np.copysign(np.inf, off)), off / np.where(flat, 1.0, errors))
    t.sort()
    tail = len(t) * _TAIL_PER_MILLE // 1000
    lower, upper = t[tail], t[-1 - tail]
    return float(value - upper * error), float(value - lower * error)


def _require_same_frames(runs: Sequence[Samples]) -> None:
    for run in runs[1:]:
        if not np.array_equal(run.index, runs[0].index) or not np.array_equal(
            run.tallies[:, 1].sum(axis=1), runs[0].tallies[:, 1].sum(axis=1)
        ):
            raise ValueError("two runs can only be paired over the same frames with the same truth")
