"""Moving labels from a keyframe to the current frame: every current pixel fetches, so no holes and no blending."""

import cv2
import numpy as np

from stsem.classes import NO_LABEL, Labels
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


def warp_onto(background: Labels, labels: Labels, H: Matrix3) -> Labels:
    """`warp_labels` with the labels of `background` (H, W), which is left as it is, where the keyframe does not reach.

    A pixel for which the keyframe has NO_LABEL gets NO_LABEL: it was reached.
    """
    height, width = background.shape
    warped = cv2.warpPerspective(
        labels, H, (width, height), dst=background.copy(), flags=cv2.INTER_NEAREST, borderMode=cv2.BORDER_TRANSPARENT
    )
    return np.asarray(warped, np.uint8)
