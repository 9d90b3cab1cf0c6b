"""Accuracy over the distance to the keyframe: mIoU_d of AR-Seg, DAVSS and GSVNet, with its mean and minimum."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from stsem.metrics.scores import Tally, scores_of_tally, tally

MIN_FRAMES = 10
"""A distance with fewer frames is shown, but goes neither into the mean nor into the minimum."""


@dataclass(frozen=True)
class DistanceRow:
    """Accuracy of the frames at one distance from their keyframe.

    Args:
        frames: log index of the frame - log index of its keyframe; 0 is the keyframe itself.
        ms: mean time since the keyframe's stamp over these frames, milliseconds.
        miou, pixel_accuracy: fractions; NaN without truth pixels.
        classes_averaged: in `miou`: classes with truth pixels at this distance.
        n: frames.
    """

    frames: int
    ms: float
    miou: float
    pixel_accuracy: float
    classes_averaged: int
    n: int


@dataclass(frozen=True)
class DistanceSummary:
    """Mean and minimum over the `distances` that have at least `min_frames` frames; every distance weighs the same."""

    miou_mean: float
    miou_min: float
    pixel_accuracy_mean: float
    pixel_accuracy_min: float
    distances: int
    min_frames: int


def by_distance(distances: Sequence[int], distances_ns: Sequence[int], tallies: Tally) -> tuple[DistanceRow, ...]:
    """Rows by ascending distance.

    Args:
        distances: (n,) per frame, log-index difference to the keyframe.
        distances_ns: (n,) per frame, stamp difference to the keyframe.
        tallies: (n, 3, C) per frame.
    """
    steps, times = np.asarray(distances, np.int64), np.asarray(distances_ns, np.int64)
    return tuple(
        _row(int(d), int(times[steps == d].sum()), int((steps == d).sum()), tallies[steps == d].sum(axis=0))
        for d in np.unique(steps)
    )


def summarise(rows: Sequence[DistanceRow], min_frames: int = MIN_FRAMES) -> DistanceSummary | None:
    """Mean and minimum over the rows with at least `min_frames` frames; None when there is no such row."""
    kept = [row for row in rows if row.n >= min_frames and not np.isnan(row.miou)]
    if not kept:
        return None
    miou, accuracy = np.array([r.miou for r in kept]), np.array([r.pixel_accuracy for r in kept])
    return DistanceSummary(
        miou_mean=float(miou.mean()),
        miou_min=float(miou.min()),
        pixel_accuracy_mean=float(accuracy.mean()),
        pixel_accuracy_min=float(accuracy.min()),
        distances=len(kept),
        min_frames=min_frames,
    )


class ByDistance:
    """Accumulates frames by their distance: one tally per distance, so memory does not grow with the log."""

    unit: ClassVar[str] = "fraction"
    higher_is_better: ClassVar[bool] = True

    def __init__(self, classes: int) -> None:
        self._zero = np.zeros((3, classes), np.int64)
        self._sums: dict[int, Tally] = {}
        self._time_ns: Counter[int] = Counter()
        self._frames: Counter[int] = Counter()

    def update(self, distance: int, distance_ns: int, matrix: npt.NDArray[np.int64]) -> None:
        """Add the matrix (C, C + 1) of one frame at `distance` frames and `distance_ns` from its keyframe."""
        self._sums[distance] = self._sums.get(distance, self._zero) + tally(matrix)
        self._time_ns[distance] += distance_ns
        self._frames[distance] += 1

    def compute(self) -> tuple[DistanceRow, ...]:
        """Rows by ascending distance."""
        return tuple(_row(d, self._time_ns[d], self._frames[d], self._sums[d]) for d in sorted(self._sums))


def _row(distance: int, time_ns: int, n: int, counts: Tally) -> DistanceRow:
    found = scores_of_tally(counts)
    return DistanceRow(
        frames=distance,
        ms=time_ns / n / 1e6,
        miou=found.miou,
        pixel_accuracy=found.pixel_accuracy,
        classes_averaged=found.classes_averaged,
        n=n,
    )
