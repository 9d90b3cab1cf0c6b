"""Propagate: labels for a frame from a finished keyframe. One more method is one class and one table row."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from stsem.frame import Frame, Segmentation
from stsem.geometry.homography import Homography
from stsem.geometry.warp import warp_labels, warp_onto
from stsem.stages.keyframe import Keyframe


class Propagation(Protocol):
    """Predicts labels from a keyframe."""

    @property
    def needs_homography(self) -> bool:
        """Whether `homography` must be estimated for it."""

    def propagate(self, keyframe: Keyframe, frame: Frame, homography: Homography | None) -> Segmentation:
        """Labels for `frame` at the size of its image; NO_LABEL where the method has nothing to say.

        Args:
            keyframe: a finished keyframe.
            frame: the frame to label.
            homography: from `keyframe` to `frame`; None if there is no trustworthy one.
        """


class Hold:
    """Copies the keyframe's labels: what not predicting at all scores."""

    needs_homography = False

    def propagate(self, keyframe: Keyframe, frame: Frame, homography: Homography | None) -> Segmentation:
        """The keyframe's labels as they are, by nearest neighbour if the image size changed."""
        labels = keyframe.segmentation.labels
        if labels.shape == frame.image.shape[:2]:
            return Segmentation(labels)
        return Segmentation(warp_labels(labels, _stretch(labels.shape, frame.size), frame.size))


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
        return Segmentation(warp_onto(held.labels, keyframe.segmentation.labels, homography.H))


PROPAGATIONS: dict[str, Callable[[], Propagation]] = {"hold": Hold, "homography": HomographyWarp}
"""Method on the command line -> its factory."""


def _stretch(shape: tuple[int, ...], size: tuple[int, int]) -> np.ndarray:
    """(3, 3) homography that resizes an image of `shape` (H, W) to `size` (W, H), pixel centres at integers."""
    sx, sy = size[0] / shape[1], size[1] / shape[0]
    return np.array([[sx, 0, (sx - 1) / 2], [0, sy, (sy - 1) / 2], [0, 0, 1]])
