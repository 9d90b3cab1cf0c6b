"""Maps of a network's uncertainty, and how they are kept: a byte for each pixel and measure."""

from collections.abc import Callable
from dataclasses import dataclass
from math import log

import numpy as np
import numpy.typing as npt

MEASURES = ("variance", "entropy", "mutual_information")
"""What a network may say besides its confidence, as it names its outputs; see `docs/metrics.md`, section 1."""

DOUBT = "one_minus_confidence"
"""The measure that every network has: 1 - confidence."""

UNITS = {"variance": "", "entropy": "nats", "mutual_information": "nats"}

CONFIDENCE_STEPS = 64
"""Confidence is rounded to 1/64 before anybody sees it: exact in float32, and cheap to keep on disk."""

TOP_LEVEL = 255
ROOT = 4
"""A level is the fourth root of a value: most values are far below the largest possible one, and which of two is larger
must still be seen."""

Levels = npt.NDArray[np.uint8]
Confidence = npt.NDArray[np.float32]
"""(H, W) in 0..1."""


def ceiling(measure: str, classes: int) -> float:
    """The largest value that a measure can have with `classes` classes.

    Entropy, and mutual information below it, end at ln C. The variance, mean over the classes, is
    (E sum p^2 - sum (E p)^2) / C, where the first sum is at most 1 and the second at least 1 / C.
    """
    return (1 - 1 / classes) / classes if measure == "variance" else log(classes)


def to_levels(values: npt.NDArray[np.float32], measure: str, classes: int) -> Levels:
    """Values of a measure, any shape, as levels 0..TOP_LEVEL; value = ceiling (level / TOP_LEVEL)^ROOT."""
    shares = values.clip(0, None) / np.float32(ceiling(measure, classes) or 1)  # with one class all values are 0
    return np.asarray(np.rint(np.sqrt(np.sqrt(shares.clip(0, 1))) * TOP_LEVEL), np.uint8)


def to_values(levels: Levels, measure: str, classes: int) -> npt.NDArray[np.float64]:
    """Levels, any shape, as values of the measure: what `to_levels` rounded them to."""
    return ceiling(measure, classes) * (levels.astype(np.float64) / TOP_LEVEL) ** ROOT


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """How unsure a network is of each pixel of one image.

    Args:
        measures: which maps there are, some of MEASURES and in that order.
        levels: (len(measures), H, W) uint8, as `to_levels` makes them.
        classes: how many the network tells apart; the values behind the levels depend on it.
    """

    measures: tuple[str, ...]
    levels: Levels
    classes: int

    def of(self, measure: str) -> Levels:
        """(H, W) levels of one measure. Raises ValueError when there is no such map."""
        return np.asarray(self.levels[self.measures.index(measure)])

    def values(self, measure: str) -> npt.NDArray[np.float64]:
        """(H, W) values of one measure: entropy and mutual information in nats."""
        return to_values(self.of(measure), measure, self.classes)

    def mean(self, measure: str) -> float:
        """Mean value of one measure over the image."""
        counts = np.bincount(self.of(measure).ravel(), minlength=TOP_LEVEL + 1)
        values = to_values(np.arange(TOP_LEVEL + 1, dtype=np.uint8), measure, self.classes)
        return float((counts * values).sum() / counts.sum())

    def each(self, change: Callable[[Levels], Levels]) -> "Uncertainty":
        """The same measures with `change` applied to each (H, W) map."""
        return Uncertainty(self.measures, np.stack([change(plane) for plane in self.levels]), self.classes)
