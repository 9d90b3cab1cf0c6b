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
from stsem.inference.variant import at_precision
from stsem.uncertainty import CONFIDENCE_STEPS, Uncertainty, ceiling, to_levels


@dataclass(frozen=True, eq=False)
class Output:
    """What a network said, at its own size.

    Args:
        labels: (h, w) uint8 in the network's ids; NO_LABEL is possible.
        confidence: (h, w) uint8, in steps of 1/CONFIDENCE_STEPS.
        uncertainty: its maps (h, w); None when it gives none.
    """

    labels: Labels
    confidence: npt.NDArray[np.uint8]
    uncertainty: Uncertainty | None = None


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
        NetworkError, UsageError, MissingExtraError: see `choose_backend` and `at_precision`; or the graph cannot be
            loaded.
    """

    def __init__(
        self, network: Network, *, backend: str = DEFAULT_BACKEND, precision: str = DEFAULT_PRECISION, threads: int = 2
    ) -> None:
        if threads < 1:
            raise UsageError(f"The number of threads is {threads}; it must be at least 1.")
        row = choose_backend(backend, precision)
        self.network = network = at_precision(network, precision)
        self.identity = Identity(
            backend, _versions(row.distribution), precision, cpu_features(), network.sha256
        )  # fmt: skip
        self._session = row.open(network.path, precision, threads)

    def infer(self, frame: Frame) -> Segmentation:
        """Labels, in the network's ids, confidence and maps of uncertainty of `frame`, all at its image's size.

        Raises:
            NetworkError: the graph fails, or returns what cannot be labels and confidence.
        """
        return segmentation(self.compute(frame), frame.size)

    def compute(self, frame: Frame) -> Output:
        """The same at the network's size."""
        inputs = network_inputs(frame.image, frame.previous, self.network.sidecar, frame.depth)
        measures = self.network.measures
        if self.network.output is OutputKind.LABELS:
            labels, confidence, *maps = self._session.run(["labels", "confidence", *measures], inputs)
            return self._checked(labels[0], confidence[0], self._uncertainty([found[0] for found in maps]))
        logits, *maps = self._session.run(["logits", *measures], inputs)
        labels, confidence = _argmax(logits[0], self.network.size)
        return self._checked(labels, confidence, self._uncertainty([found[0] for found in maps]))

    def _uncertainty(self, maps: list[np.ndarray[Any, Any]]) -> Uncertainty | None:
        """The maps (h, w) of the network's measures, rounded; None without any."""
        measures, (width, height), classes = self.network.measures, self.network.size, len(self.network.classes)
        if not measures:
            return None
        for measure, found in zip(measures, maps, strict=True):
            low, high, top = float(found.min()), float(found.max()), ceiling(measure, classes)
            if found.shape != (height, width) or not -1e-3 <= low <= high <= top + 1e-3:  # also false for NaN
                raise NetworkError(
                    f"The network {self.network.path.name} returned {measure!r} of shape {found.shape} from {low:g} to "
                    f"{high:g}; expected shape ({height}, {width}) and, with {classes} classes, 0 to {top:.4g}."
                )
        levels = np.stack([to_levels(found, measure, classes) for measure, found in zip(measures, maps, strict=True)])
        return Uncertainty(measures, levels, classes)

    def _checked(
        self, labels: np.ndarray[Any, Any], confidence: np.ndarray[Any, Any], uncertainty: Uncertainty | None
    ) -> Output:
        name, (width, height), count = self.network.path.name, self.network.size, len(self.network.classes)
        if labels.shape != (height, width) or confidence.shape != (height, width):
            raise NetworkError(
                f"The network {name} returned labels of shape {labels.shape} and confidence of shape "
                f"{confidence.shape}; its sidecar's size calls for ({height}, {width})."
            )
        if labels.dtype != np.uint8:
            labels = np.where(labels < 0, NO_LABEL, labels)
        known = labels[labels != NO_LABEL] if labels.max() >= count else labels
        if known.size and known.max() >= count:
            raise NetworkError(
                f"The network {name} returned class {known.max()}, but its sidecar names {count} classes."
            )
        low, high = float(confidence.min()), float(confidence.max())
        if not -1e-3 <= low <= high <= 1 + 1e-3:  # also false for NaN
            raise NetworkError(f"The network {name} returned a confidence from {low:g} to {high:g}; expected 0 to 1.")
        steps = np.rint(confidence.clip(0, 1) * CONFIDENCE_STEPS).astype(np.uint8)
        return Output(labels.astype(np.uint8, copy=False), steps, uncertainty)


def segmentation(output: Output, size: tuple[int, int]) -> Segmentation:
    """`output` at an image's size (width, height), by nearest neighbour, so that what belongs together stays so."""
    confidence = labels_at(output.confidence, size).astype(np.float32) / np.float32(CONFIDENCE_STEPS)
    maps = output.uncertainty
    if maps is not None:
        maps = maps.each(lambda plane: labels_at(plane, size))
    return Segmentation(labels_at(output.labels, size), confidence, maps)


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
