"""Moving labels from a keyframe to the current frame: every current pixel fetches, so no holes and no blending."""

import cv2
import numpy as np
import numpy.typing as npt

from stsem.classes import NO_LABEL, Labels
from stsem.frame import Segmentation
from stsem.geometry.homography import Matrix3


def warp_labels(labels: Labels, H: Matrix3, size: tuple[int, int]) -> Labels:
    """Labels as seen from the current frame, by nearest neighbour; NO_LABEL where the keyframe does not reach.

    Args:
        labels: (H, W) uint8 of the keyframe.
        H: (3, 3), keyframe pixels to current pixels, not behind the horizon anywhere (`homography.is_sane`).
        size: (width, height) of the current frame.
    """
    warped = cv2.warpPerspective(labels, H, size, flags=cv2.INTER_NEAREST, borderValue=NO_LABEL)
    return np.asarray(warped, np.uint8)


def warp_confidence(confidence: npt.NDArray[np.float32], H: Matrix3, size: tuple[int, int]) -> npt.NDArray[np.float32]:
    """Confidence (H, W) float32 fetched like the labels; 0 where the keyframe does not reach."""
    warped = cv2.warpPerspective(confidence, H, size, flags=cv2.INTER_NEAREST, borderValue=0)
    return np.asarray(warped, np.float32)


def warp_segmentation(source: Segmentation, H: Matrix3, size: tuple[int, int]) -> Segmentation:
    """Labels and, if there is one, confidence of a keyframe as seen from the current frame; see `warp_labels`."""
    confidence = None if source.confidence is None else warp_confidence(source.confidence, H, size)
    return Segmentation(warp_labels(source.labels, H, size), confidence)


def warp_onto(background: Labels, labels: Labels, H: Matrix3) -> Labels:
    """`warp_labels` with the labels of `background` (H, W), which is left as it is, where the keyframe does not reach.

    A pixel for which the keyframe has NO_LABEL gets NO_LABEL: it was reached.
    """
    height, width = background.shape
    warped = cv2.warpPerspective(
        labels, H, (width, height), dst=background.copy(), flags=cv2.INTER_NEAREST, borderMode=cv2.BORDER_TRANSPARENT
    )
    return np.asarray(warped, np.uint8)
