"""Right and wrong pixels by level: is the stated confidence true, and does a measure point at the wrong pixels?

Everything is computed from counts, so that a log needs no memory and counts of parts add up to those of the whole.
Expected calibration error: Guo et al., On Calibration of Modern Neural Networks (2017), equation 3; its maximum,
equation 5.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stsem.classes import Labels
from stsem.metrics.confusion import joint_counts, resized
from stsem.uncertainty import CONFIDENCE_STEPS, Levels

BINS = 15
"""Of the confidence, equally wide: ((m - 1) / BINS, m / BINS]."""

RIGHT, WRONG, IGNORED = 0, 1, 2

Counts = npt.NDArray[np.int64]
"""(levels, 2) pixels by level: right, wrong."""


@dataclass(frozen=True)
class ReliabilityBin:
    """The pixels whose confidence lies in (lower, upper]; mean confidence and accuracy are NaN without any."""

    lower: float
    upper: float
    pixels: int
    confidence: float
    accuracy: float


@dataclass(frozen=True)
class Reliability:
    """How well confidence agrees with accuracy.

    Args:
        ece: expected calibration error: |accuracy - mean confidence| of the bins, weighted by their pixels.
        mce: the largest of those differences.
        confidence, accuracy: means over all pixels.
        pixels, frames: judged.
        bins: BINS of them, ascending.
    """

    ece: float
    mce: float
    confidence: float
    accuracy: float
    pixels: int
    frames: int
    bins: tuple[ReliabilityBin, ...]


def rightness(truth: Labels, answer: Labels, classes: int) -> Levels:
    """(H, W) uint8 at the truth's size: RIGHT, WRONG (also without a label), or IGNORED where the truth is no class.

    Args:
        truth: (H, W) uint8.
        answer: (h, w) uint8, resized by nearest neighbour.
        classes: C.
    """
    wrong = (resized(answer, truth.shape[1], truth.shape[0]) != truth).view(np.uint8)
    ignored = np.uint8(IGNORED) * (truth >= classes).view(np.uint8)
    return np.asarray(np.maximum(wrong, ignored), np.uint8)


def error_counts(levels: Levels, right: Levels) -> Counts:
    """(256, 2): how many right and wrong pixels have each level.

    Args:
        levels: (h, w) uint8, resized by nearest neighbour as labels are.
        right: (H, W) from `rightness`.
    """
    return joint_counts(resized(levels, right.shape[1], right.shape[0]), right, 256)[:, :IGNORED]


def area_under_roc(counts: Counts) -> float:
    """Chance that a wrong pixel has a higher level than a right one, equal levels counting half (Mann and Whitney).

    That is the area under the ROC curve of calling a pixel wrong above a level, over all levels. NaN without a right or
    without a wrong pixel.
    """
    below = twice = wrong_ones = 0
    for right, wrong in counts.tolist():  # Python's integers: pairs of pixels of a long log exceed 64 bits
        twice += wrong * (2 * below + right)
        below += right
        wrong_ones += wrong
    return twice / (2 * below * wrong_ones) if below and wrong_ones else float("nan")


def reliability(counts: Counts, frames: int) -> Reliability | None:
    """Calibration from the counts of each step of the confidence; None without pixels.

    Args:
        counts: (CONFIDENCE_STEPS + 1, 2); row k has confidence k / CONFIDENCE_STEPS.
        frames: that were counted.
    """
    steps = np.arange(CONFIDENCE_STEPS + 1)
    place = np.maximum(-(-steps * BINS // CONFIDENCE_STEPS) - 1, 0)
    pixels, said, right = (
        np.array([column[place == i].sum() for i in range(BINS)], np.int64)
        for column in (counts.sum(axis=1), steps * counts.sum(axis=1), CONFIDENCE_STEPS * counts[:, RIGHT])
    )
    if not (total := int(pixels.sum())):
        return None
    gaps = np.abs(right - said)  # in pixels and steps of confidence
    with np.errstate(invalid="ignore"):
        confidence, accuracy, worst = (sums / (CONFIDENCE_STEPS * pixels) for sums in (said, right, gaps))
    return Reliability(
        ece=int(gaps.sum()) / (CONFIDENCE_STEPS * total),
        mce=float(np.nanmax(worst)),
        confidence=int(said.sum()) / (CONFIDENCE_STEPS * total),
        accuracy=int(right.sum()) / (CONFIDENCE_STEPS * total),
        pixels=total,
        frames=frames,
        bins=tuple(
            ReliabilityBin(i / BINS, (i + 1) / BINS, int(pixels[i]), float(confidence[i]), float(accuracy[i]))
            for i in range(BINS)
        ),
    )
