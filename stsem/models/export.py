"""A network in torch -> an ONNX file with softmax, fusion, upsampling and argmax inside (DESIGN 11)."""

import logging
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
import onnx
import onnxruntime
import torch
from torch import nn
from torch.nn import functional

from stsem.errors import NetworkError
from stsem.models.folding import folded
from stsem.models.montecarlo import MAPS, fix_masks, uncertainty
from stsem.models.network import CHANNELS, SegmentationNetwork

OPSET = 18
Tensor = npt.NDArray[np.float32]


class Answer(nn.Module):
    """What is exported: a network's probabilities, upsampled, as labels and confidence at the input's size.

    Probabilities are enlarged rather than logits: bilinear weights keep their sum at 1, so the largest is a confidence.

    Args:
        network: in evaluation mode; from `fix_masks` when there are passes.
        passes: of Monte Carlo dropout, which add the maps of `MAPS`; labels and confidence stay those without dropout.
    """

    def __init__(self, network: SegmentationNetwork, *, passes: int = 0) -> None:
        super().__init__()
        self.network = network
        self._passes = passes

    def forward(self, *inputs: torch.Tensor) -> tuple[torch.Tensor, ...]:
        """Inputs as `input_names` lists them, batch 1 -> labels (1, H, W) uint8, confidence and maps (1, H, W) float32.

        Without passes any batch will do.
        """
        named = dict(zip(input_names(self.network), inputs, strict=True))
        features = self.network.features(*(named[name] for name in self.network.inputs))
        maps = uncertainty(self.network, *features, passes=self._passes) if self._passes else ()
        full, *wide = (
            functional.interpolate(x, size=inputs[0].shape[-2:], mode="bilinear", align_corners=True)
            for x in (self.network.head(*features), *maps)
        )
        confidence, labels = torch.max(full, 1)
        return (labels.to(torch.uint8), confidence, *(x[:, 0] for x in wide))


def input_names(network: SegmentationNetwork) -> list[str]:
    """Inputs of the exported graph: the image, used or not, comes first."""
    return ["image", *(name for name in network.inputs if name != "image")]


def exported(
    network: SegmentationNetwork, *, size: tuple[int, int], metadata: Mapping[str, str], passes: int = 0
) -> bytes:
    """`network` for inputs of `size` as an ONNX file; same weights and versions, same bytes.

    Args:
        network: put into evaluation mode here.
        size: (width, height).
        metadata: strings to keep in the file.
        passes: of Monte Carlo dropout with masks that become constants of the graph; it then also gives `MAPS`.

    Raises:
        NetworkError: the size does not fit the network, or it has no dropout to sample.
    """
    _check_size(network, size)
    names = input_names(network.eval())
    example = tuple(torch.zeros(1, CHANNELS[name], size[1], size[0]) for name in names)
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)  # it mentions torchvision, which nothing here needs
    with warnings.catch_warnings(), torch.no_grad():
        warnings.simplefilter("ignore")  # torch's exporter deprecates its own internals
        program = torch.onnx.export(
            folded(answer_of(network, size, passes)), example, dynamo=True, external_data=False, opset_version=OPSET,
            verbose=False, input_names=names, output_names=["labels", "confidence", *(MAPS if passes else ())],
        )  # fmt: skip
    if program is None:
        raise NetworkError("torch could not export the network.")
    model = program.model_proto
    _forget_origins(model)
    onnx.helper.set_model_props(model, dict(sorted(metadata.items())))
    return bytes(model.SerializeToString(deterministic=True))


def answer_of(network: SegmentationNetwork, size: tuple[int, int], passes: int = 0) -> Answer:
    """What is exported of a network in evaluation mode, for inputs of `size` (width, height)."""
    if passes:
        zeros = (torch.zeros(1, CHANNELS[name], size[1], size[0]) for name in network.inputs)
        network = fix_masks(network, *zeros, passes=passes)
    return Answer(network, passes=passes).eval()


def _check_size(network: SegmentationNetwork, size: tuple[int, int]) -> None:
    for side in size:
        if not network.fits(side):
            raise NetworkError(f"The input size {size[0]}x{size[1]} does not fit the network: {side} is not "
                               f"{network.side_rule}; use {network.nearest_side(side)}.")  # fmt: skip


@dataclass(frozen=True)
class Agreement:
    """How alike a file and torch answer.

    Args:
        labels: share of labels that are equal.
        confidence: its largest difference.
        maps: largest difference of a map of uncertainty; 0 without maps.
    """

    labels: float
    confidence: float
    maps: float = 0.0

    SHARE = 0.9999
    CONFIDENCE = 1e-4
    MAPS = 1e-3
    """Ten times as much: the field of CRF-RNN, run on samples, widens the rounding of what goes into it."""

    @property
    def holds(self) -> bool:
        """Whether they are the same up to rounding."""
        return self.labels >= self.SHARE and self.confidence <= self.CONFIDENCE and self.maps <= self.MAPS

    def __str__(self) -> str:
        return (
            f"{self.labels:.4%} of the labels (at least {self.SHARE:.2%} are needed), confidence to "
            f"{self.confidence:.1e} ({self.CONFIDENCE:.0e}), maps of uncertainty to {self.maps:.1e} ({self.MAPS:.0e})"
        )


def agreement(network: SegmentationNetwork, path: Path, inputs: Mapping[str, Tensor], passes: int = 0) -> Agreement:
    """Compare an exported file with torch.

    Args:
        network: what `path` was exported from.
        path: the ONNX file.
        inputs: by name, each (1, channels, H, W) float32.
        passes: as it was exported.
    """
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    labels, *planes = session.run(None, dict(inputs))
    height, width = inputs["image"].shape[-2:]
    with torch.no_grad():
        tensors = (torch.from_numpy(inputs[name]) for name in input_names(network))
        eager, *expected = answer_of(network.eval(), (width, height), passes)(*tensors)
    confidence, *maps = (float(np.abs(x - y.numpy()).max()) for x, y in zip(planes, expected, strict=True))
    return Agreement(float((labels == eager.numpy()).mean()), confidence, max(maps, default=0.0))


def _forget_origins(model: onnx.ModelProto) -> None:
    """Drop the exporter's notes: they hold paths and line numbers of the machine it ran on, and half the bytes."""
    for node in model.graph.node:
        node.doc_string = ""
        del node.metadata_props[:]
    for value in (*model.graph.input, *model.graph.output, *model.graph.value_info, *model.graph.initializer):
        value.doc_string = ""
        del value.metadata_props[:]
    del model.graph.metadata_props[:]
    del model.graph.value_info[:]
