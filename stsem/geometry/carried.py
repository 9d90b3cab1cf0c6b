"""Labels brought from keyframes to the current frame, with what is known of them: the result of a warp."""

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from stsem.classes import NO_LABEL, Labels
from stsem.geometry.packed import Rows
from stsem.uncertainty import Confidence

Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Carried:
    """Labels for every pixel of a frame, and where they rest on evidence.

    Args:
        labels: (H, W) uint8; where nothing covers a pixel, by the rule of the method.
        confidence: (H, W) float32 that moved with the labels; None where the keyframes have none.
        covered: (H, W) bool: the keyframe saw this point, so far as the method can tell.
    """

    labels: Labels
    confidence: Confidence | None
    covered: Bools

    @property
    def coverage(self) -> float:
        """Share of the pixels that are covered, 0..1."""
        return float(np.count_nonzero(self.covered)) / max(1, self.covered.size)


@dataclass(eq=False)
class Draft:
    """An answer in the making: one source after another fills in what those before it left open, the best first.

    Args:
        labels: (H, W) uint8, NO_LABEL where it is open.
        confidence: (H, W) float32; None if the keyframes have none.
        covered: (H, W) bool: what was said rests on evidence.
    """

    labels: Labels
    confidence: Confidence | None
    covered: Bools
    _left: Rows | None = field(default=None, repr=False)

    @classmethod
    def blank(cls, shape: tuple[int, ...], *, sure: bool) -> "Draft":
        """Of `shape` (H, W), open everywhere; with room for a confidence if the keyframes are `sure` of something."""
        confidence = np.zeros(shape, np.float32) if sure else None
        return cls(np.full(shape, NO_LABEL, np.uint8), confidence, np.zeros(shape, np.bool_))

    @property
    def open(self) -> Bools:
        """(H, W) bool: nobody has said anything yet."""
        return np.asarray(self.labels == NO_LABEL)

    def left(self) -> Rows:
        """(n,) the open pixels, counted row by row. They only ever become fewer, so it looks at the last ones again."""
        flat = self.labels.reshape(-1)
        last = self._left
        self._left = np.flatnonzero(flat == NO_LABEL) if last is None else last[flat.take(last) == NO_LABEL]
        return self._left
