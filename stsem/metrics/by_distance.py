"""Accuracy over the distance to the keyframe: mIoU_d of AR-Seg, DAVSS and GSVNet, with its mean and minimum."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
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
        covered: share of their judged pixels that rest on evidence; None where no prediction says.
        covered_miou, covered_pixel_accuracy: over those pixels alone; None likewise, NaN without any.
    """

    frames: int
    ms: float
    miou: float
    pixel_accuracy: float
    classes_averaged: int
    n: int
    covered: float | None = None
    covered_miou: float | None = None
    covered_pixel_accuracy: float | None = None


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
        self._covered: dict[int, Tally] = {}
        self._told: dict[int, Tally] = {}
        self._time_ns: Counter[int] = Counter()
        self._frames: Counter[int] = Counter()

    def update(
        self, distance: int, distance_ns: int, matrix: npt.NDArray[np.int64],
        covered: npt.NDArray[np.int64] | None = None,
    ) -> None:  # fmt: skip
        """Add one frame at `distance` frames and `distance_ns` from its keyframe.

        Args:
            distance, distance_ns: log indices and capture time.
            matrix: (C, C + 1) of the frame.
            covered: (C, C + 1) of its covered pixels alone; None if its answer does not say which they are.
        """
        counts = tally(matrix)
        self._sums[distance] = self._sums.get(distance, self._zero) + counts
        if covered is not None:
            self._covered[distance] = self._covered.get(distance, self._zero) + tally(covered)
            self._told[distance] = self._told.get(distance, self._zero) + counts
        self._time_ns[distance] += distance_ns
        self._frames[distance] += 1

    def compute(self) -> tuple[DistanceRow, ...]:
        """Rows by ascending distance."""
        return tuple(self._covered_row(d) for d in sorted(self._sums))

    def _covered_row(self, distance: int) -> DistanceRow:
        row = _row(distance, self._time_ns[distance], self._frames[distance], self._sums[distance])
        if distance not in self._covered:
            return row
        covered, pixels = self._covered[distance], int(self._told[distance][1].sum())
        there = scores_of_tally(covered)
        share = int(covered[1].sum()) / pixels if pixels else float("nan")
        return replace(row, covered=share, covered_miou=there.miou, covered_pixel_accuracy=there.pixel_accuracy)


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
