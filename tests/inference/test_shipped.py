"""The network that ships: what it says of itself, that it sees, and that threads change nothing."""

from pathlib import Path

import numpy as np
import pytest

from stsem.classes import translation
from stsem.frame import Frame
from stsem.inference.inferencer import Inferencer
from stsem.inference.network import DEFAULT, Network, load_network
from stsem.log.log import open_log
from stsem.metrics.confusion import ConfusionMatrix

LOG = Path(__file__).resolve().parents[2] / "logs" / "office.mcap"
SOME = range(0, 150, 30)


@pytest.fixture(scope="module")
def network() -> Network:
    """The default."""
    return load_network(DEFAULT)


def test_it_is_small_and_knows_the_paper_s_classes(network: Network) -> None:
    """At most 10 MB, 13 classes of table 3, two streams."""
    assert network.path.stat().st_size < 10e6
    assert len(network.classes) == 13
    assert network.classes.find("rubbish_bin") == 12
    assert network.has_difference


def test_it_sees_an_office_it_was_not_trained_on(network: Network) -> None:
    """Five frames of the shipped log: far above what the most frequent class would get."""
    inferencer = Inferencer(network, threads=1)
    with open_log([LOG]) as log:
        assert log.classes is not None
        lookup, matrix = translation(network.classes, log.classes), ConfusionMatrix(len(log.classes))
        for loaded in log.frames(SOME, depth=False, previous=True, truth=True):
            assert loaded.frame is not None
            assert loaded.truth is not None
            matrix.update(loaded.truth, lookup[inferencer.infer(loaded.frame).labels])
    scores = matrix.compute()
    assert scores.pixel_accuracy > 0.85
    assert scores.miou > 0.6


def test_threads_change_no_bit(network: Network) -> None:
    """Labels and confidence of one and of two threads, on a random pair of images."""
    image, previous = np.random.default_rng(0).integers(0, 256, (2, 270, 480, 3)).astype(np.uint8)
    one, two = (Inferencer(network, threads=n).infer(Frame(1, 1, image, previous=previous)) for n in (1, 2))
    assert np.array_equal(one.labels, two.labels)
    assert one.confidence is not None
    assert two.confidence is not None
    assert np.array_equal(one.confidence, two.confidence)
