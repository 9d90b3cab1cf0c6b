"""Moving labels from a keyframe to the current frame: every current pixel fetches, so no holes and no blending."""

from typing import TypeVar

import cv2
import numpy as np
import numpy.typing as npt

from stsem.classes import NO_LABEL, Bools, Labels
from stsem.geometry.homography import Matrix3
from stsem.uncertainty import Confidence

Value = TypeVar("Value", np.uint8, np.float32)


def warp_labels(labels: Labels, H: Matrix3, size: tuple[int, int]) -> Labels:
    """Labels as seen from the current frame, by nearest neighbour; NO_LABEL where the keyframe does not reach.

    Args:
        labels: (H, W) uint8 of the keyframe.
        H: (3, 3), keyframe pixels to current pixels, not behind the horizon anywhere (`homography.is_sane`).
        size: (width, height) of the current frame.
    """
    warped = cv2.warpPerspective(labels, H, size, flags=cv2.INTER_NEAREST, borderValue=NO_LABEL)
    return np.asarray(warped, np.uint8)


def warp_confidence(confidence: Confidence, H: Matrix3, size: tuple[int, int]) -> Confidence:
    """The confidence (H, W) that goes with labels, moved as `warp_labels` moves them; 0 where the keyframe ends."""
    warped = cv2.warpPerspective(confidence, H, size, flags=cv2.INTER_NEAREST, borderValue=0)
    return np.asarray(warped, np.float32)


def warp_covered(shape: tuple[int, ...], H: Matrix3, size: tuple[int, int]) -> Bools:
    """(H, W) bool for an image of `size` (width, height): where a keyframe of `shape` (H, W) reaches."""
    warped = cv2.warpPerspective(np.ones(shape, np.uint8), H, size, flags=cv2.INTER_NEAREST, borderValue=0)
    return np.asarray(warped, np.uint8).view(np.bool_)


def warp_extended(values: npt.NDArray[Value], H: Matrix3, size: tuple[int, int]) -> npt.NDArray[Value]:
    """Labels or confidence as `warp_labels` moves them; where the keyframe does not reach, those of its nearest border.

    A pixel for which the keyframe has NO_LABEL gets NO_LABEL.
    """
    warped = cv2.warpPerspective(values, H, size, flags=cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(warped, values.dtype)
