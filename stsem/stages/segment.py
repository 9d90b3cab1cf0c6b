"""Segment: labels for a keyframe, from the network, from the truth as a perfect network, or from a fake."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import cv2
import numpy as np

from stsem.classes import NO_LABEL, Labels
from stsem.frame import Frame, Segmentation


class Segmenter(Protocol):
    """Labels one frame."""

    def can_segment(self, index: int) -> bool:
        """Whether the frame with this log index can be segmented at all (the oracle needs its truth)."""

    def segment(self, frame: Frame) -> Segmentation:
        """Labels at the size of the frame's image, in the ids of the classes that the run reports."""


class Inferencer(Protocol):
    """A network behind its preprocessing, in its own classes."""

    def infer(self, frame: Frame) -> Segmentation:
        """Labels at the size of the frame's image, in the ids of the network's classes."""


@dataclass(frozen=True)
class NetworkSegmenter:
    """A network whose class ids are translated into those of the run.

    Args:
        network: the network.
        translation: (256,) uint8, from its ids to the run's; NO_LABEL where the run has no such class.
    """

    network: Inferencer
    translation: Labels

    def can_segment(self, index: int) -> bool:
        """Always."""
        return True

    def segment(self, frame: Frame) -> Segmentation:
        """The network's answer, translated."""
        answer = self.network.infer(frame)
        return replace(answer, labels=self.translation[answer.labels])


@dataclass(frozen=True)
class OracleSegmenter:
    """The truth as a perfect network; pixels without truth stay without a label (DESIGN 4).

    Args:
        has_truth: whether the frame with a log index has truth.
        truth: labels of the frame with a log index, in the log's classes.
    """

    has_truth: Callable[[int], bool]
    truth: Callable[[int], Labels | None]

    def can_segment(self, index: int) -> bool:
        """Only frames with truth that can be decoded."""
        return self.has_truth(index) and self.truth(index) is not None

    def segment(self, frame: Frame) -> Segmentation:
        """The truth, resized to the image by nearest neighbour where their sizes differ."""
        labels = self.truth(frame.index)
        if labels is None:
            return Segmentation(np.full(frame.image.shape[:2], NO_LABEL, np.uint8))
        if labels.shape != frame.image.shape[:2]:
            resized = cv2.resize(labels, frame.size, interpolation=cv2.INTER_NEAREST_EXACT)
            return Segmentation(np.asarray(resized, np.uint8))
        return Segmentation(labels)


@dataclass(frozen=True)
class FakeSegmenter:
    """For tests of what surrounds a network: every pixel gets the same class.

    Args:
        label: the class id.
    """

    label: int = 0

    def can_segment(self, index: int) -> bool:
        """Always."""
        return True

    def segment(self, frame: Frame) -> Segmentation:
        """A constant image."""
        return Segmentation(np.full(frame.image.shape[:2], self.label, np.uint8))
