"""Frames in, label images out."""

import importlib.metadata
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stsem.classes import NO_LABEL, Labels
from stsem.errors import NetworkError, UsageError
from stsem.frame import Frame, Segmentation
from stsem.inference.backends import DEFAULT_BACKEND, DEFAULT_PRECISION, choose_backend
from stsem.inference.cpu import cpu_features
from stsem.inference.network import Network, OutputKind
from stsem.inference.preprocess import labels_at, network_inputs

CONFIDENCE_STEPS = 64
"""Confidence is rounded to 1/64 before anybody sees it: exact in float32, and cheap to keep on disk."""


@dataclass(frozen=True, eq=False)
class Output:
    """What a network said, at its own size.

    Args:
        labels: (h, w) uint8 in the network's ids; NO_LABEL is possible.
        confidence: (h, w) uint8, in steps of 1/CONFIDENCE_STEPS.
    """

    labels: Labels
    confidence: npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Identity:
    """What a result depends on besides the log (DESIGN 9, `identity`)."""

    backend: str
    versions: dict[str, str]
    precision: str
    cpu_features: tuple[str, ...]
    model_sha256: str


class Inferencer:
    """Runs one network on frames.

    Args:
        network: from `load_network`.
        backend, precision: a row of `BACKENDS` and one of its precisions.
        threads: threads of the session; the labels do not depend on it.

    Raises:
        NetworkError, UsageError, MissingExtraError: see `choose_backend`; or the graph cannot be loaded.
    """

    def __init__(
        self, network: Network, *, backend: str = DEFAULT_BACKEND, precision: str = DEFAULT_PRECISION, threads: int = 2
    ) -> None:
        if threads < 1:
            raise UsageError(f"The number of threads is {threads}; it must be at least 1.")
        row = choose_backend(backend, precision)
        self.network = network
        self.identity = Identity(
            backend, _versions(row.distribution), precision, cpu_features(), network.sha256
        )  # fmt: skip
        self._session = row.open(network.path, threads)

    def infer(self, frame: Frame) -> Segmentation:
        """Labels, in the network's ids, and confidence of `frame`, both at its image's size.

        Raises:
            NetworkError: the graph fails, or returns what cannot be labels and confidence.
        """
        return segmentation(self.compute(frame), frame.size)

    def compute(self, frame: Frame) -> Output:
        """The same at the network's size."""
        inputs = network_inputs(frame.image, frame.previous, self.network.sidecar, frame.depth)
        if self.network.output is OutputKind.LABELS:
            labels, confidence = self._session.run(["labels", "confidence"], inputs)
            return self._checked(labels[0], confidence[0])
        (logits,) = self._session.run(["logits"], inputs)
        return self._checked(*_argmax(logits[0], self.network.size))

    def _checked(self, labels: np.ndarray[Any, Any], confidence: np.ndarray[Any, Any]) -> Output:
        name, (width, height), count = self.network.path.name, self.network.size, len(self.network.classes)
        if labels.shape != (height, width) or confidence.shape != (height, width):
            raise NetworkError(
                f"The network {name} returned labels of shape {labels.shape} and confidence of shape "
                f"{confidence.shape}; its sidecar's size calls for ({height}, {width})."
            )
        known = labels[labels != NO_LABEL] if labels.max() >= count else labels
        if known.size and known.max() >= count:
            raise NetworkError(
                f"The network {name} returned class {known.max()}, but its sidecar names {count} classes."
            )
        low, high = float(confidence.min()), float(confidence.max())
        if not -1e-3 <= low <= high <= 1 + 1e-3:  # also false for NaN
            raise NetworkError(f"The network {name} returned a confidence from {low:g} to {high:g}; expected 0 to 1.")
        return Output(labels, np.rint(confidence.clip(0, 1) * CONFIDENCE_STEPS).astype(np.uint8))


def segmentation(output: Output, size: tuple[int, int]) -> Segmentation:
    """`output` at an image's size (width, height), by nearest neighbour, so that label and confidence stay together."""
    confidence = labels_at(output.confidence, size).astype(np.float32) / np.float32(CONFIDENCE_STEPS)
    return Segmentation(labels_at(output.labels, size), confidence)


def _argmax(logits: npt.NDArray[np.float32], size: tuple[int, int]) -> tuple[Labels, npt.NDArray[np.float32]]:
    """Labels and confidence (h', w') at `size` from logits (C, h, w): softmax, bilinear enlargement, largest class."""
    shifted = np.exp(logits - logits.max(axis=0))
    planes = (shifted / shifted.sum(axis=0)).astype(np.float32)
    full = [plane if plane.shape[::-1] == size else cv2.resize(plane, size, interpolation=cv2.INTER_LINEAR)
            for plane in planes]  # fmt: skip
    stack = np.stack(full)
    return stack.argmax(axis=0).astype(np.uint8), stack.max(axis=0)


def _versions(distribution: str) -> dict[str, str]:
    return {
        distribution: importlib.metadata.version(distribution),
        "opencv": cv2.__version__,
        "numpy": np.__version__,
    }
