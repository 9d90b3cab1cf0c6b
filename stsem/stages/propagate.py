"""Propagate: labels for a frame from a finished keyframe. One more method is one class and one table row."""

from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

import numpy as np

from stsem.frame import Frame, Segmentation
from stsem.geometry.homography import Homography
from stsem.geometry.warp import warp_confidence, warp_labels, warp_onto
from stsem.stages.keyframe import Keyframe


class Propagation(Protocol):
    """Predicts labels from a keyframe."""

    @property
    def needs_homography(self) -> bool:
        """Whether `homography` must be estimated for it."""

    def propagate(self, keyframe: Keyframe, frame: Frame, homography: Homography | None) -> Segmentation:
        """Labels for `frame` at the size of its image; NO_LABEL where the method has nothing to say.

        The confidence of a label moves with it; maps of uncertainty do not: they are about the keyframe.

        Args:
            keyframe: a finished keyframe.
            frame: the frame to label.
            homography: from `keyframe` to `frame`; None if there is no trustworthy one.
        """


class Hold:
    """Copies the keyframe's labels and their confidence: what not predicting at all scores."""

    needs_homography = False

    def propagate(self, keyframe: Keyframe, frame: Frame, homography: Homography | None) -> Segmentation:
        """The keyframe's labels as they are, by nearest neighbour if the image size changed."""
        held = replace(keyframe.segmentation, uncertainty=None)
        if held.labels.shape == frame.image.shape[:2]:
            return held
        H = _stretch(held.labels.shape, frame.size)
        confidence = None if held.confidence is None else warp_confidence(held.confidence, H, frame.size)
        return Segmentation(warp_labels(held.labels, H, frame.size), confidence)


class HomographyWarp:
    """Warps the keyframe's labels by one homography (equation 2); what it does not cover is copied in place.

    A copied border is right more often than one without a label. Without a trustworthy homography the whole keyframe
    is copied.
    """

    needs_homography = True

    def propagate(self, keyframe: Keyframe, frame: Frame, homography: Homography | None) -> Segmentation:
        """Warped labels, holes filled from the same pixel of the keyframe."""
        held = Hold().propagate(keyframe, frame, None)
        if homography is None:
            return held
        labels, confidence = keyframe.segmentation.labels, keyframe.segmentation.confidence
        if held.confidence is None or confidence is None:
            return Segmentation(warp_onto(held.labels, labels, homography.H))
        return Segmentation(
            warp_onto(held.labels, labels, homography.H), warp_onto(held.confidence, confidence, homography.H)
        )


PROPAGATIONS: dict[str, Callable[[], Propagation]] = {"hold": Hold, "homography": HomographyWarp}
"""Method on the command line -> its factory."""


def _stretch(shape: tuple[int, ...], size: tuple[int, int]) -> np.ndarray:
    """(3, 3) homography that resizes an image of `shape` (H, W) to `size` (W, H), pixel centres at integers."""
    sx, sy = size[0] / shape[1], size[1] / shape[0]
    return np.array([[sx, 0, (sx - 1) / 2], [0, sy, (sy - 1) / 2], [0, 0, 1]])
