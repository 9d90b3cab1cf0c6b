"""Hold: the keyframe's labels as they are, which is what not predicting at all scores."""

import numpy as np

from stsem.frame import Frame, Segmentation
from stsem.geometry.homography import Matrix3
from stsem.geometry.warp import warp_confidence, warp_labels
from stsem.stages.keyframe import Keyframe
from stsem.stages.propagation.method import Memoryless, Needs, Predicted
from stsem.stages.register import Registration


class Hold(Memoryless):
    """Copies the keyframe's labels and their confidence; it knows nothing of what covers a pixel."""

    needs = Needs()

    def predict(self, source: Keyframe, frame: Frame, registration: Registration | None) -> Predicted:
        """The keyframe's labels as they are, by nearest neighbour if the image size changed."""
        return Predicted(held(source.segmentation, frame.size), source.index)

    def expected_coverage(self, frame: Frame, registration: Registration) -> float | None:
        """None: it does not look."""
        return None


def held(segmentation: Segmentation, size: tuple[int, int]) -> Segmentation:
    """Labels and confidence of a keyframe in place, for an image of `size` (width, height)."""
    labels, confidence = segmentation.labels, segmentation.confidence
    if labels.shape == (size[1], size[0]):
        return Segmentation(labels, confidence)
    H = _stretch(labels.shape, size)
    return Segmentation(
        warp_labels(labels, H, size), None if confidence is None else warp_confidence(confidence, H, size)
    )


def uncovered(segmentation: Segmentation, size: tuple[int, int]) -> Segmentation:
    """`held`, said to rest on no evidence: what a method does that lost its keyframe."""
    answer = held(segmentation, size)
    return Segmentation(answer.labels, answer.confidence, covered=np.zeros(answer.labels.shape, np.bool_))


def _stretch(shape: tuple[int, ...], size: tuple[int, int]) -> Matrix3:
    """(3, 3) homography that resizes an image of `shape` (H, W) to `size` (W, H), pixel centres at integers."""
    sx, sy = size[0] / shape[1], size[1] / shape[0]
    return np.array([[sx, 0, (sx - 1) / 2], [0, sy, (sy - 1) / 2], [0, 0, 1]])
