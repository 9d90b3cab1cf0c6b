"""A network in torch -> an ONNX file with softmax, fusion, upsampling and argmax inside (DESIGN 11)."""

import logging
import warnings
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt
import onnx
import onnxruntime
import torch

from stsem.errors import NetworkError, OutputError
from stsem.models.pspnet import fits
from stsem.models.two_stream import Answer, OneStream, TwoStream

OPSET = 18
AGREEMENT = 0.9999
"""Smallest share of labels that must be equal in torch and in the exported graph."""

Tensor = npt.NDArray[np.float32]


def export_onnx(
    network: TwoStream | OneStream, path: Path, *, size: tuple[int, int], metadata: Mapping[str, str]
) -> None:
    """Write `network` for inputs of `size` to `path`, one file; same weights and versions, same bytes.

    Args:
        network: put into evaluation mode here.
        path: the ONNX file; its folder must exist.
        size: (width, height), both 48 k - 7, so that every pool is a fixed one.
        metadata: strings to keep in the file.

    Raises:
        NetworkError: the size does not fit the pyramid.
        OutputError: the file cannot be written.
    """
    for side in size:
        if not fits(side):
            nearest = max(1, round((side + 7) / 48)) * 48 - 7
            raise NetworkError(f"The input size {size[0]}x{size[1]} does not fit the pyramid: {side} is not 48 k - 7; "
                               f"use {nearest}.")  # fmt: skip
    answer = Answer(network.eval()).eval()
    inputs = _input_names(network)
    example = tuple(torch.zeros(1, 3, size[1], size[0]) for _ in inputs)
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)  # it mentions torchvision, which nothing here needs
    with warnings.catch_warnings(), torch.no_grad():
        warnings.simplefilter("ignore")  # torch's exporter deprecates its own internals
        program = torch.onnx.export(
            answer, example, dynamo=True, external_data=False, opset_version=OPSET, verbose=False,
            input_names=inputs, output_names=["labels", "confidence"],
        )  # fmt: skip
    if program is None:
        raise NetworkError(f"torch could not export the network to {path}.")
    model = program.model_proto
    _forget_origins(model)
    onnx.helper.set_model_props(model, dict(sorted(metadata.items())))
    try:
        path.write_bytes(model.SerializeToString(deterministic=True))
    except OSError as err:
        raise OutputError(f"The network cannot be written to {path}: {err.strerror}.") from err


def agreement(network: TwoStream | OneStream, path: Path, inputs: Mapping[str, Tensor]) -> float:
    """Share of labels that the file and torch give alike.

    Args:
        network: what `path` was exported from.
        path: the ONNX file.
        inputs: by name, each (1, 3, H, W) float32.
    """
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    exported = session.run(["labels"], dict(inputs))[0]
    with torch.no_grad():
        eager, _ = Answer(network.eval())(*(torch.from_numpy(inputs[name]) for name in _input_names(network)))
    return float((exported == eager.numpy()).mean())


def _input_names(network: TwoStream | OneStream) -> list[str]:
    return ["image", "difference"] if isinstance(network, TwoStream) else ["image"]


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
