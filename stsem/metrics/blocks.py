"""Cutting a log into stretches that are long enough to be independent of each other.

Neighbouring frames show the same thing, so they are not a sample of n independent frames. Resampling stretches of at
least three autocorrelation times keeps that dependence inside them (Künsch 1989; Politis and Romano 1994).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

MIN_BLOCKS = 8
MAX_BLOCKS = 100
AUTOCORRELATION_TIMES = 3.0
_WINDOW = 5.0
_MIN_MEANS = 24
_NOTHING = 1e-12


@dataclass(frozen=True)
class NoInterval:
    """There is no honest interval, and why."""

    reason: str


@dataclass(frozen=True, eq=False)
class Blocks:
    """Stretches of equal log time.

    Args:
        of_frame: (n,) int64, ascending: number of the block that each frame is in, 0..count - 1; empty stretches have
            no number.
        count: blocks with frames.
        length_ns: log time of one block.
        autocorrelation_ns: the longest autocorrelation time found.
        inflation: what the variance between independent blocks is multiplied by for the correlation that is left
            between neighbours: 1 + (tau^2 - 1) / (2 l tau) for blocks of l samples whose correlation decays
            exponentially, from cov(neighbours) = sigma^2 (tau^2 - 1) / 4 and var(block) = sigma^2 l tau.
    """

    of_frame: npt.NDArray[np.int64]
    count: int
    length_ns: int
    autocorrelation_ns: int
    inflation: float

    def sums(self, values: npt.NDArray[np.float64] | npt.NDArray[np.int32]) -> npt.NDArray[np.float64]:
        """(count, ...) sums over the frames of each block of values (n, ...)."""
        starts = np.searchsorted(self.of_frame, np.arange(self.count))
        result: npt.NDArray[np.float64] = np.add.reduceat(values, starts, axis=0, dtype=np.float64)
        return result


def autocorrelation_time(series: npt.NDArray[np.float64]) -> float:
    """Integrated autocorrelation time 1 + 2 sum rho(k) in samples, at least 1; NaN samples are left out.

    Corrected by 1 + (2 M + 1) / n for the estimated mean (Wolff 2004; M is the last lag). The saw-tooth
    that keyframes cut into a series hides slow changes under it, so the series is also looked at in means of 2, 4, 8,
    ... samples, as long as 24 of them are left; of each of these estimates half a standard error is taken off
    (tau sqrt((4 M + 2) / n), Madras and Sokal 1988), as the longest one counts. It errs on the long side.
    """
    x = series[~np.isnan(series)]
    if len(x) < 2 or float(np.var(x)) < _NOTHING:
        return 1.0
    tau, last = _integrated(x)
    longest, size = tau * (1 + (2 * last + 1) / len(x)), 2
    while len(x) // size >= _MIN_MEANS:
        means = x[: len(x) // size * size].reshape(-1, size).mean(axis=1)
        tau, last = _integrated(means)
        longest = max(longest, size * (tau - 0.5 * tau * ((4 * last + 2) / len(means)) ** 0.5 - 1) + 1)
        size *= 2
    return longest


def _integrated(series: npt.NDArray[np.float64]) -> tuple[float, int]:
    """(tau, M) with M the first lag >= 5 max(tau(0..M)) (Sokal 1997, section 3; the maximum bridges dips)."""
    x = series - series.mean()
    spectrum = np.fft.rfft(x, 2 * len(x))
    covariance = np.fft.irfft(spectrum * np.conj(spectrum))[: len(x)]
    if covariance[0] < _NOTHING * len(x):
        return 1.0, 0
    tau = np.maximum.accumulate(np.maximum(2 * np.cumsum(covariance / covariance[0]) - 1, 1.0))
    enough = np.flatnonzero(np.arange(len(x)) >= _WINDOW * tau)
    last = int(enough[0]) if len(enough) else len(x) - 1
    return float(tau[last]), last


def cut(stamps_ns: npt.NDArray[np.int64], series: Sequence[npt.NDArray[np.float64]]) -> Blocks | NoInterval:
    """Cut a log into as many equal stretches of time as the slowest of the series allows.

    Args:
        stamps_ns: (n,) ascending stamps of the judged frames.
        series: of (n,) per-frame values, one for every mode and difference that will use these blocks.

    Returns:
        8 to 100 blocks of at least 3 autocorrelation times; `NoInterval` where fewer than 8 fit.
    """
    if len(stamps_ns) < MIN_BLOCKS:
        return NoInterval(f"{len(stamps_ns)} judged frames cannot make {MIN_BLOCKS} blocks")
    period_ns = max(1, int(np.median(np.diff(stamps_ns))))
    tau = max(autocorrelation_time(values) for values in series)
    tau_ns = int(tau * period_ns)
    extent_ns = int(stamps_ns[-1] - stamps_ns[0]) + period_ns
    count = min(MAX_BLOCKS, int(extent_ns // (AUTOCORRELATION_TIMES * tau_ns)))
    if count < MIN_BLOCKS:
        return NoInterval(_too_short(count, tau_ns, extent_ns))
    stretch = (stamps_ns - stamps_ns[0]) * count // extent_ns
    numbers, of_frame = np.unique(stretch, return_inverse=True)
    if len(numbers) < MIN_BLOCKS:
        return NoInterval(_too_short(len(numbers), tau_ns, extent_ns))
    inflation = 1 + (tau - 1 / tau) * period_ns * count / (2 * extent_ns)
    return Blocks(of_frame.astype(np.int64), len(numbers), extent_ns // count, tau_ns, inflation)


def _too_short(count: int, tau_ns: int, extent_ns: int) -> str:
    return (
        f"{extent_ns / 1e9:.1f} s hold {count} blocks of 3 autocorrelation times ({tau_ns / 1e9:.2f} s each), "
        f"and {MIN_BLOCKS} are needed"
    )
