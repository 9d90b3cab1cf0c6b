"""The confusion matrix of label images: rows truth, columns prediction, one column more for "no label"."""

from typing import ClassVar

import cv2
import numpy as np
import numpy.typing as npt

from stsem.classes import NO_LABEL, Labels
from stsem.metrics.scores import Scores, scores

Matrix = npt.NDArray[np.int64]
"""(C, C + 1) pixel counts: rows truth, columns prediction, last column pixels without a prediction."""

# calcHist counts in float32, which holds every integer up to this one.
_EXACT_PIXELS = 1 << 24


def confusion(truth: Labels, answer: Labels | None, classes: int) -> Matrix:
    """Count the pixels of one frame.

    Args:
        truth: (H, W) uint8 ids; NO_LABEL and every other id >= `classes` are ignored before counting.
        answer: (h, w) uint8 ids, resized by nearest neighbour if its size differs; NO_LABEL and every other id
            >= `classes` go to the column "no label"; None is an answer without any label.
        classes: C, 1 to 255.

    Returns:
        (C, C + 1) int64.

    Raises:
        ValueError: an array is not a two-dimensional uint8 image, or `classes` is out of range.
    """
    if not 1 <= classes <= NO_LABEL:
        raise ValueError(f"a confusion matrix has 1 to {NO_LABEL} classes, but {classes} came")
    _require_labels("truth", truth)
    if answer is None:
        return _unanswered(truth, classes)
    _require_labels("answer", answer)
    pairs = joint_counts(truth, resized(answer, truth.shape[1], truth.shape[0]), classes)
    matrix = np.empty((classes, classes + 1), np.int64)
    matrix[:, :classes] = pairs[:, :classes]
    matrix[:, classes] = pairs[:, classes:].sum(axis=1)
    return matrix


def resized(labels: Labels, width: int, height: int) -> Labels:
    """`labels` at (`width`, `height`): the nearest neighbour by pixel centres; nothing shifts by half a pixel."""
    if labels.shape == (height, width):
        return labels
    bigger = cv2.resize(np.ascontiguousarray(labels), (width, height), interpolation=cv2.INTER_NEAREST_EXACT)
    return np.asarray(bigger, np.uint8)


def joint_counts(a: Labels, b: Labels, rows: int) -> Matrix:
    """(rows, 256) int64 counts of value pairs of two uint8 images of one size, `a` below `rows`."""
    a, b = np.ascontiguousarray(a), np.ascontiguousarray(b)
    if a.size < _EXACT_PIXELS:
        return _histogram(a, b, rows)
    flat_a, flat_b, step = a.reshape(1, -1), b.reshape(1, -1), _EXACT_PIXELS - 1
    total = np.zeros((rows, 256), np.int64)
    for start in range(0, a.size, step):
        total += _histogram(flat_a[:, start : start + step], flat_b[:, start : start + step], rows)
    return total


class ConfusionMatrix:
    """One matrix summed over the frames of a stratum, never a mean of per-image scores (DESIGN 4)."""

    unit: ClassVar[str] = "fraction"
    higher_is_better: ClassVar[bool] = True

    def __init__(self, classes: int) -> None:
        self._matrix = np.zeros((classes, classes + 1), np.int64)

    @property
    def matrix(self) -> Matrix:
        """(C, C + 1) int64, the sum so far (a copy)."""
        return self._matrix.copy()

    def update(self, truth: Labels, answer: Labels | None) -> None:
        """Add one frame; arguments as of `confusion`."""
        self._matrix += confusion(truth, answer, len(self._matrix))

    def compute(self) -> Scores:
        """Scores of the sum; NaN before the first pixel."""
        return scores(self._matrix)


def _require_labels(name: str, labels: Labels) -> None:
    if labels.ndim != 2 or labels.dtype != np.uint8:
        raise ValueError(f"{name} must be an (H, W) uint8 label image, but {labels.dtype} {labels.shape} came")


def _unanswered(truth: Labels, classes: int) -> Matrix:
    matrix = np.zeros((classes, classes + 1), np.int64)
    matrix[:, classes] = np.bincount(truth.ravel(), minlength=NO_LABEL + 1)[:classes]
    return matrix


def _histogram(a: Labels, b: Labels, rows: int) -> Matrix:
    if a.size == 0:
        return np.zeros((rows, 256), np.int64)
    # All 256 x 256 pairs are counted, so that no id can fall outside the ranges and vanish.
    return cv2.calcHist([a, b], [0, 1], None, [256, 256], [0, 256, 0, 256])[:rows].astype(np.int64)
