"""What labels keyframes: a network in other classes, the truth, a fake."""

import numpy as np

from stsem.classes import NO_LABEL, ClassSet, Labels, translation
from stsem.frame import Frame, Segmentation
from stsem.stages.segment import FakeSegmenter, NetworkSegmenter, OracleSegmenter


def frame(index: int = 0, width: int = 6, height: int = 4) -> Frame:
    return Frame(index, index, np.zeros((height, width, 3), np.uint8))


class Ramp:
    """A network that says 0, 1, 2, 3 and sometimes nothing."""

    def infer(self, frame: Frame) -> Segmentation:
        labels = np.tile(np.array([0, 1, 2, 3, 255, 0], np.uint8), (4, 1))
        return Segmentation(labels, np.full((4, 6), 0.5, np.float32))


def test_a_network_speaks_the_classes_of_the_run() -> None:
    """Ids are translated by name; what has no name there, and what had no label, is without a label."""
    network, log = ClassSet(("Floor", "lamp", "rubbish_bin", "wall")), ClassSet(("wall", "floor", "Rubbish Bin"))
    answer = NetworkSegmenter(Ramp(), translation(network, log)).segment(frame())
    assert answer.labels[0].tolist() == [1, NO_LABEL, 2, 0, NO_LABEL, 1]
    assert answer.labels.dtype == np.uint8
    assert answer.confidence is not None
    assert NetworkSegmenter(Ramp(), translation(network, log)).can_segment(99)


def oracle(truth: dict[int, Labels]) -> OracleSegmenter:
    return OracleSegmenter(truth.__contains__, truth.get)


def test_the_oracle_is_the_truth() -> None:
    """Pixel by pixel; 255 stays without a label; frames without truth cannot be segmented."""
    labels = np.arange(24, dtype=np.uint8).reshape(4, 6)
    labels[1] = NO_LABEL
    segmenter = oracle({3: labels})
    assert segmenter.can_segment(3)
    assert not segmenter.can_segment(4)
    assert (segmenter.segment(frame(3)).labels == labels).all()
    assert (segmenter.segment(frame(4)).labels == NO_LABEL).all()
    assert segmenter.segment(frame(4)).labels.shape == (4, 6)


def test_truth_of_another_size() -> None:
    """By nearest neighbour: doubled pixels, or every second one; never a class in between."""
    small = np.array([[0, 9], [NO_LABEL, 4]], np.uint8)
    doubled = oracle({0: small}).segment(frame(0, 4, 4)).labels
    assert (doubled == small.repeat(2, axis=0).repeat(2, axis=1)).all()
    large = np.random.default_rng(1).choice(np.array([0, 7, NO_LABEL], np.uint8), (9, 15))
    shrunk = oracle({0: large}).segment(frame(0, 5, 3)).labels
    assert (shrunk == large[1::3, 1::3]).all()


def test_the_fake() -> None:
    """One class everywhere."""
    segmenter = FakeSegmenter(2)
    assert segmenter.can_segment(0)
    assert (segmenter.segment(frame()).labels == 2).all()
