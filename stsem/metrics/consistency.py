"""Temporal consistency: does an answer say the same as the previous one, carried into its frame? (TC of VSPW)

One confusion matrix over all pairs of consecutive answers; its "truth" is the previous answer, warped. VSPW warps by
optical flow; which correspondence is used here is part of the result. It says nothing about being right.
"""

from dataclasses import dataclass
from typing import ClassVar, Literal

import cv2
import numpy as np
import numpy.typing as npt

from stsem.classes import NO_LABEL, Labels
from stsem.metrics.confusion import confusion, resized
from stsem.metrics.scores import scores

Correspondence = Literal["identity", "homography"]


@dataclass(frozen=True)
class Consistency:
    """Temporal consistency.

    Args:
        miou: between each answer and the previous one carried into its frame; NaN without a pair.
        pixel_accuracy: share of the carried pixels on which both agree; NaN without a pair.
        pairs: pairs of consecutive answers.
        correspondence: how the previous answer was carried.
    """

    miou: float
    pixel_accuracy: float
    pairs: int
    correspondence: Correspondence


def carried(previous: Labels, H: npt.NDArray[np.float64], width: int, height: int) -> Labels:
    """`previous` (h, w) moved by H (3, 3), previous pixels to current pixels; NO_LABEL where nothing comes from."""
    warped = cv2.warpPerspective(
        np.ascontiguousarray(previous), H, (width, height),
        flags=cv2.INTER_NEAREST, borderMode=cv2.BORDER_CONSTANT, borderValue=NO_LABEL,
    )  # fmt: skip
    return np.asarray(warped, np.uint8)


def agreement(
    previous: Labels, current: Labels, classes: int, H: npt.NDArray[np.float64] | None = None
) -> npt.NDArray[np.int64]:
    """Confusion matrix (C, C + 1) of one pair: rows the previous answer carried by H (None: identity), columns now.

    Pixels that the previous answer did not label, or that come into view, are ignored.
    """
    height, width = current.shape
    truth = resized(previous, width, height) if H is None else carried(previous, H, width, height)
    return confusion(truth, current, classes)


class ConsistencyMeter:
    """Accumulates consecutive answers.

    Args:
        classes: C.
        correspondence: how answers are carried; with "homography" each pair needs its H.
    """

    unit: ClassVar[str] = "fraction"
    higher_is_better: ClassVar[bool] = True

    def __init__(self, classes: int, correspondence: Correspondence = "identity") -> None:
        self._matrix = np.zeros((classes, classes + 1), np.int64)
        self._correspondence: Correspondence = correspondence
        self._previous: Labels | None = None
        self._pairs = 0

    def update(self, answer: Labels, H: npt.NDArray[np.float64] | None = None) -> None:
        """Add the next answer (H, W).

        Args:
            answer: labels of the next answered frame.
            H: (3, 3) from the previous answered frame's pixels to this one's; None for the first answer, and where
                there is no trustworthy one: that pair is left out unless the correspondence is the identity.
        """
        moves = self._correspondence == "homography"
        if self._previous is not None and (H is not None or not moves):
            self._matrix += agreement(self._previous, answer, len(self._matrix), H if moves else None)
            self._pairs += 1
        self._previous = answer

    def compute(self) -> Consistency:
        """Consistency over the pairs so far."""
        found = scores(self._matrix)
        return Consistency(found.miou, found.pixel_accuracy, self._pairs, self._correspondence)
