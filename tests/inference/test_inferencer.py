"""Frames in, labels out: sizes, the difference, confidence, and answers that cannot be."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from stsem.classes import NO_LABEL
from stsem.errors import NetworkError, UsageError
from stsem.frame import Frame, Image
from stsem.inference.inferencer import Inferencer
from stsem.inference.network import load_network
from stsem.uncertainty import CONFIDENCE_STEPS

Files = Callable[..., Path]
SIDECAR = 'size = [16, 12]\nmean = [0.0, 0.0, 0.0]\nstd = [1.0, 1.0, 1.0]\nclasses = ["red", "green", "blue"]\n'


def _halves(left: int, right: int, width: int = 32, height: int = 24) -> Image:
    """Left half in channel `left`, right half in channel `right`, at 3/4 of full brightness."""
    image = np.zeros((height, width, 3), np.uint8)
    image[:, : width // 2, left] = 192
    image[:, width // 2 :, right] = 192
    return image


def test_labels_come_back_at_the_size_of_the_image(files: Files) -> None:
    """The image is stretched to 16x12, the labels by nearest neighbour back to 32x24."""
    answer = Inferencer(load_network(files()), threads=1).infer(Frame(0, 0, _halves(0, 2)))
    assert answer.labels.shape == (24, 32)
    assert answer.labels.dtype == np.uint8
    assert (answer.labels[:, :16] == 0).all()
    assert (answer.labels[:, 16:] == 2).all()


def test_wide_labels_are_narrowed(files: Files) -> None:
    """int64, as argmax gives them."""
    answer = Inferencer(load_network(files("wide labels")), threads=1).infer(Frame(0, 0, _halves(0, 2)))
    assert answer.labels.dtype == np.uint8
    assert (answer.labels[:, :16] == 0).all()
    assert (answer.labels[:, 16:] == 2).all()
    unknown = Inferencer(load_network(files("negative labels")), threads=1).infer(Frame(0, 0, _halves(0, 2)))
    assert (unknown.labels[:, :16] == NO_LABEL).all()
    assert (unknown.labels[:, 16:] == 1).all()


def test_confidence_is_in_steps(files: Files) -> None:
    """192 / 255 = 0.753 is 48 steps of 1/64."""
    answer = Inferencer(load_network(files()), threads=1).infer(Frame(0, 0, _halves(1, 1)))
    assert answer.confidence is not None
    assert answer.confidence.dtype == np.float32
    assert (answer.confidence == np.float32(48 / CONFIDENCE_STEPS)).all()


def test_the_difference_is_current_minus_previous(files: Files) -> None:
    """What grew brighter since the previous frame wins; without one the difference is zero."""
    network = load_network(files("difference", SIDECAR + "[difference]\nscale = 1.0\n"))
    inferencer = Inferencer(network, threads=1)
    both = _halves(0, 0) + _halves(1, 1) // 2
    grown = inferencer.infer(Frame(1, 1, both, previous=_halves(0, 0)))
    assert (grown.labels == 1).all()
    first = inferencer.infer(Frame(0, 0, both))
    assert (first.labels == 0).all()
    assert first.confidence is not None
    assert not first.confidence.any()


def test_depth_reaches_the_network(files: Files) -> None:
    """Green where it is 4 m away; where depth is unknown, and in a frame without, colour alone counts."""
    inferencer = Inferencer(load_network(files("depth", SIDECAR + "[depth]\n")), threads=1)
    depth = np.full((24, 32), 4, np.float32)
    depth[12:] = np.nan
    answer = inferencer.infer(Frame(0, 0, _halves(0, 2) // 2, depth=depth))
    assert (answer.labels[:12] == 1).all()
    for labels in (answer.labels[12:], inferencer.infer(Frame(0, 0, _halves(0, 2))).labels):
        assert (labels[:, :16] == 0).all()
        assert (labels[:, 16:] == 2).all()


def test_logits_are_decided_outside(files: Files) -> None:
    """Half-size logits: softmax, enlargement, argmax; the confidence is the probability."""
    answer = Inferencer(load_network(files("logits")), threads=1).infer(Frame(0, 0, _halves(2, 1)))
    assert (answer.labels[:, :14] == 2).all()
    assert (answer.labels[:, 18:] == 1).all()
    probability = 1 / (1 + 2 * np.exp(-8 * 192 / 255))
    assert answer.confidence is not None
    assert answer.confidence[0, 0] == round(probability * CONFIDENCE_STEPS) / CONFIDENCE_STEPS


def test_an_answer_that_cannot_be(files: Files) -> None:
    """A class that the sidecar does not name, and a confidence that is not a number."""
    two = SIDECAR.replace(', "blue"', "")
    with pytest.raises(NetworkError, match="returned class 2, but its sidecar names 2 classes"):
        Inferencer(load_network(files(sidecar=two)), threads=1).infer(Frame(0, 0, _halves(0, 2)))
    with pytest.raises(NetworkError, match="confidence from nan"):
        Inferencer(load_network(files("nan")), threads=1).infer(Frame(0, 0, _halves(0, 2)))


def test_backend_and_precision_are_checked(files: Files) -> None:
    """A known backend that is not installed names its extra; a wrong word lists the right ones."""
    network = load_network(files())
    with pytest.raises(UsageError, match=r"'tensorrt'.*onnxruntime"):
        Inferencer(network, backend="tensorrt")
    with pytest.raises(UsageError, match=r"'float8'.*f32, int8\.$"):
        Inferencer(network, precision="float8")
    with pytest.raises(UsageError, match=r"'bf16'.*--backend openvino"):
        Inferencer(network, precision="bf16")
    with pytest.raises(UsageError, match="threads is 0"):
        Inferencer(network, threads=0)


def test_a_backend_that_does_not_exist(files: Files) -> None:
    """The sentence lists what there is."""
    with pytest.raises(UsageError, match="choose one of onnxruntime"):
        Inferencer(load_network(files()), backend="abacus")


def test_identity_names_what_a_result_depends_on(files: Files) -> None:
    """Backend, versions, precision, CPU and both files."""
    network = load_network(files())
    identity = Inferencer(network, threads=1).identity
    assert (identity.backend, identity.precision) == ("onnxruntime", "f32")
    assert {"onnxruntime", "opencv", "numpy"} <= identity.versions.keys()
    assert identity.model_sha256 == network.sha256
    assert identity.cpu_features
