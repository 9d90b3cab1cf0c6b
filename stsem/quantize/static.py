"""Static quantisation: 8-bit weights and activations, with ranges seen on frames (Jacob et al., CVPR 2018)."""

import logging
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
from onnxruntime.quantization import CalibrationDataReader, CalibrationMethod, QuantFormat, QuantType, quantize_static
from onnxruntime.quantization import quant_pre_process as fold

from stsem.aside import aside
from stsem.errors import NetworkError, OutputError
from stsem.frame import Frame
from stsem.inference.backends.onnx_runtime import FAILURES
from stsem.inference.backends.session import first_line
from stsem.inference.inferencer import Inferencer
from stsem.inference.network import Network
from stsem.inference.preprocess import Tensor, network_inputs
from stsem.inference.variant import INT8, MADE_FROM, at_precision, variant_path

FEWEST_FRAMES = 2
_WARNINGS, _ERRORS = 2, 3
"""Severities of ONNX Runtime's logger, the first its own choice."""
_OPSET = 13
"""The first in which weights can have a scale per channel."""
_REFUSALS = (*FAILURES, onnx.version_converter.ConvertError, ValueError, TypeError, KeyError, AttributeError)
"""What the libraries raise at a graph that they do not foresee."""
_WEIGHTED = ("Conv", "ConvTranspose", "Gemm", "MatMul")
_BETWEEN = ("Add", "AveragePool", "Clip", "GlobalAveragePool", "LeakyRelu", "MaxPool", "Relu", "Resize")
"""Operators without weights that hand on 8 bits as they come, so that nothing is widened between two convolutions.

Not Concat: OpenVINO 2026.4 ends in a segmentation fault on the concatenations of AdapNet++ in 8 bits.
"""


def quantize(network: Network, frames: Sequence[Frame]) -> Network:
    """Write the int8 variant of `network` beside it; same network, frames and versions, same bytes.

    A scale per output channel for weights, per tensor for activations (asymmetric, uint8), from the smallest and
    largest values on `frames`. Weights take 7 of the 8 bits: processors without VNNI add two products of 8 bits in 16
    and would saturate in silence. What follows a softmax stays f32.

    Args:
        network: in f32.
        frames: of the kind it will see; labels play no part.

    Returns:
        The variant, as `at_precision` finds it.

    Raises:
        NetworkError: nothing in the graph can be quantised, or ONNX Runtime refuses to.
        OutputError: the variant cannot be written.
    """
    if len(frames) < FEWEST_FRAMES:
        raise NetworkError(
            f"{len(frames)} frame(s) do not show the ranges of a network; give {FEWEST_FRAMES} or more from its logs."
        )
    with tempfile.TemporaryDirectory(prefix="stsem-") as folder, _quiet():
        try:
            model = _quantized(_folded(network.path, Path(folder)), network, frames, Path(folder))
        except _REFUSALS as err:
            raise NetworkError(f"ONNX Runtime cannot quantize {network.path}: {first_line(err)}") from err
    _write(variant_path(network), model)
    return at_precision(network, INT8)


def label_agreement(one: Network, other: Network, frames: Sequence[Frame]) -> float:
    """Share of the pixels of `frames`, at the network's size, that both give the same label."""
    sessions = [Inferencer(network, precision=network.precision) for network in (one, other)]
    labels = ([session.compute(frame).labels for session in sessions] for frame in frames)
    return float(np.mean([(a == b).mean() for a, b in labels]))


class _Inputs(CalibrationDataReader):  # type: ignore[misc]  # the library has no types
    """Frames as the inputs that a replay would form."""

    def __init__(self, network: Network, frames: Sequence[Frame]) -> None:
        self._inputs = (network_inputs(f.image, f.previous, network.sidecar, f.depth) for f in frames)

    def get_next(self) -> dict[str, Tensor] | None:
        """The next frame's inputs by name."""
        return next(self._inputs, None)


def _folded(path: Path, folder: Path) -> onnx.ModelProto:
    """The graph with normalisations and constants folded into their neighbours, in an opset that knows channels."""
    model = onnx.load(path)
    opset = next(entry.version for entry in model.opset_import if entry.domain in ("", "ai.onnx"))
    if opset < _OPSET:
        model = onnx.version_converter.convert_version(model, _OPSET)
    onnx.save(model, folder / "given.onnx")
    fold(str(folder / "given.onnx"), str(folder / "folded.onnx"), skip_symbolic_shape=True)
    return onnx.load(folder / "folded.onnx")


def _quantized(model: onnx.ModelProto, network: Network, frames: Sequence[Frame], folder: Path) -> onnx.ModelProto:
    _name_nodes(model)
    kept = behind_softmax(model)
    if not any(node.op_type in _WEIGHTED and node.name not in kept for node in model.graph.node):
        raise NetworkError(
            f"{network.path} has no {', '.join(_WEIGHTED)} before a softmax, so there is nothing to quantize; "
            "run it in f32."
        )
    quantize_static(
        model, folder / "int8.onnx", _Inputs(network, frames), quant_format=QuantFormat.QDQ,
        op_types_to_quantize=[*_WEIGHTED, *_BETWEEN], nodes_to_exclude=sorted(kept), per_channel=True,
        activation_type=QuantType.QUInt8, weight_type=QuantType.QInt8, reduce_range=True,
        calibrate_method=CalibrationMethod.MinMax,
    )  # fmt: skip
    quantized = onnx.load(folder / "int8.onnx")
    stated = {prop.key: prop.value for prop in onnx.load(network.path, load_external_data=False).metadata_props}
    onnx.helper.set_model_props(quantized, dict(sorted({**stated, MADE_FROM: network.sha256}.items())))
    return quantized


def behind_softmax(model: onnx.ModelProto) -> frozenset[str]:
    """Names of the softmax nodes and of all that depends on one: fusion, enlargement, variance, argmax.

    Probabilities are spread over orders of magnitude, where 256 equal steps lose the small ones.
    """
    tensors: set[str] = set()
    nodes: set[str] = set()
    for node in model.graph.node:  # in the order of computation
        if node.op_type == "Softmax" or not tensors.isdisjoint(node.input):
            tensors.update(node.output)
            nodes.add(node.name)
    return frozenset(nodes)


def _name_nodes(model: onnx.ModelProto) -> None:
    """Exclusion goes by name, which a file may leave out or use twice."""
    for place, node in enumerate(model.graph.node):
        node.name = f"{place} {node.op_type}"


def _write(path: Path, model: onnx.ModelProto) -> None:
    beside = aside(path)
    try:
        beside.write_bytes(model.SerializeToString(deterministic=True))
        beside.replace(path)
    except OSError as err:
        beside.unlink(missing_ok=True)
        raise OutputError(
            f"{path} cannot be written ({err.strerror}); copy the network and its sidecar to a folder of yours and "
            "quantize it there."
        ) from err


@contextmanager
def _quiet() -> Iterator[None]:
    """ONNX Runtime's advice on its own steps is not the user's."""
    before: Any = logging.root.manager.disable
    logging.disable(logging.WARNING)
    onnxruntime.set_default_logger_severity(_ERRORS)
    try:
        yield
    finally:
        logging.disable(before)
        onnxruntime.set_default_logger_severity(_WARNINGS)
