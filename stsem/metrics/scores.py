"""Scores of a confusion matrix: IoU per class, mIoU in its two definitions, pixel accuracy."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Tally = npt.NDArray[np.int64] | npt.NDArray[np.int32]
"""(..., 3, C): pixels right, pixels of truth, pixels predicted, per class: all that IoU and pixel accuracy need."""

ClassMask = npt.NDArray[np.bool_]
"""(C,) which classes are averaged."""


@dataclass(frozen=True, eq=False)
class Scores:
    """Scores as fractions 0..1; NaN is "not measured", never 0.

    Args:
        iou: (C,) float64, TP / (TP + FP + FN); NaN for a class that is not averaged.
        miou: mean of `iou` over the classes with truth pixels (or over the fixed class set).
        miou_union: the same, with every class that is predicted but absent from the truth averaged in as 0.
        pixel_accuracy: right pixels / all pixels.
        classes_averaged, classes_averaged_union: how many classes went into either mean.
        pixels: how many pixels were judged.
    """

    iou: npt.NDArray[np.float64]
    miou: float
    miou_union: float
    pixel_accuracy: float
    classes_averaged: int
    classes_averaged_union: int
    pixels: int


def tally(matrix: npt.NDArray[np.int64]) -> Tally:
    """(..., 3, C) int64 from confusion matrices (..., C, C + 1)."""
    square = matrix[..., :-1]
    right = np.diagonal(square, axis1=-2, axis2=-1)
    return np.stack([right, matrix.sum(axis=-1), square.sum(axis=-2)], axis=-2)


def scores(matrix: npt.NDArray[np.int64], class_set: ClassMask | None = None) -> Scores:
    """Scores of one confusion matrix (C, C + 1); `class_set` as of `scores_of_tally`."""
    return scores_of_tally(tally(matrix), class_set)


def scores_of_tally(counts: Tally, class_set: ClassMask | None = None) -> Scores:
    """Scores of one tally (3, C).

    Args:
        counts: pixels right, of truth, predicted.
        class_set: (C,) classes to average whatever is present here: bootstrap and comparison keep the class set of
            the full sample. Such a class without truth scores 0 if it is predicted, and drops out (NaN) if it is not.
            None: the classes with truth pixels.
    """
    right, truth, predicted = counts
    averaged = truth > 0 if class_set is None else np.asarray(class_set, np.bool_)
    iou = _iou(counts)
    iou[~averaged] = np.nan
    valid = iou[~np.isnan(iou)]
    total, n, n_union = float(valid.sum()), len(valid), len(valid) + int(((predicted > 0) & ~averaged).sum())
    pixels = int(truth.sum())
    return Scores(
        iou=iou,
        miou=_ratio(total, n),
        miou_union=_ratio(total, n_union) if pixels else float("nan"),
        pixel_accuracy=_ratio(int(right.sum()), pixels),
        classes_averaged=n,
        classes_averaged_union=n_union if pixels else 0,
        pixels=pixels,
    )


def mean_iou_over(counts: Tally, mask: ClassMask) -> float:
    """mIoU (NaN: none) over those classes of `mask` that have truth pixels."""
    iou = _iou(counts)[mask & (counts[1] > 0)]
    return _ratio(float(iou.sum()), len(iou))


def pixel_accuracies(counts: Tally) -> npt.NDArray[np.float64]:
    """(...) right / all of tallies (..., 3, C); NaN where no pixel has truth."""
    right, pixels = counts[..., 0, :].sum(axis=-1), counts[..., 1, :].sum(axis=-1)
    result = np.full(right.shape, np.nan)
    np.divide(right, pixels, out=result, where=pixels > 0)
    return result


def _iou(counts: Tally) -> npt.NDArray[np.float64]:
    right, truth, predicted = counts
    union = truth + predicted - right
    result = np.full(len(right), np.nan)
    np.divide(right, union, out=result, where=union > 0)
    return result


def _ratio(part: float, whole: int) -> float:
    return part / whole if whole else float("nan")
