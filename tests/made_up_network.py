"""A small convolutional network as an ONNX file, made by hand: no torch, a tenth of a second to quantize."""

from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

WIDTH, HEIGHT = 96, 64
SIDECAR = f"""size = [{WIDTH}, {HEIGHT}]
mean = [0.5, 0.5, 0.5]
std = [0.25, 0.25, 0.25]
classes = ["wall", "floor", "door"]
"""
DEPTH = "\n[depth]\nscale = 0.2\n"
AXES_AS_INPUT = 18
_CHANNELS = {"image": 3, "depth": 1}


def write_network(path: Path, *, depth: bool = False, variance: bool = False, opset: int = 18) -> Path:
    """Two convolutions over colour (and depth), half the size, a classifier, softmax, enlargement, argmax.

    Args:
        path: NAME.onnx; the sidecar goes beside it.
        depth: it also takes depth.
        variance: it also gives a map of that name, made from the probabilities.
        opset: of the file.
    """
    inputs = ["image", "depth"] if depth else ["image"]
    channels = sum(_CHANNELS[name] for name in inputs)
    nodes = [
        helper.make_node("Concat", inputs, ["all"], axis=1),
        helper.make_node("Conv", ["all", "w0"], ["c0"], pads=[1, 1, 1, 1]),
        helper.make_node("Relu", ["c0"], ["r0"]),
        helper.make_node("AveragePool", ["r0"], ["p0"], kernel_shape=[2, 2], strides=[2, 2]),
        helper.make_node("Conv", ["p0", "w1"], ["c1"], pads=[1, 1, 1, 1]),
        helper.make_node("Relu", ["c1"], ["r1"]),
        helper.make_node("Conv", ["r1", "w2", "b2"], ["scores"]),
        helper.make_node("Softmax", ["scores"], ["shares"], axis=1),
        _enlarged("shares", "full"),
        helper.make_node("ArgMax", ["full"], ["ids"], axis=1, keepdims=0),
        helper.make_node("Cast", ["ids"], ["labels"], to=TensorProto.UINT8),
        *_along("ReduceMax", "full", "confidence", opset),
    ]
    outputs = {"labels": TensorProto.UINT8, "confidence": TensorProto.FLOAT}
    if variance:
        nodes += [
            helper.make_node("Mul", ["full", "full"], ["squares"]),
            *_along("ReduceMin", "squares", "variance", opset),
        ]
        outputs["variance"] = TensorProto.FLOAT
    graph = helper.make_graph(
        nodes, "net",
        [helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, _CHANNELS[name], HEIGHT, WIDTH])
         for name in inputs],
        [helper.make_tensor_value_info(name, kind, [1, HEIGHT, WIDTH]) for name, kind in outputs.items()],
        _weights(channels, opset),
    )  # fmt: skip
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", opset)], ir_version=8)
    path.write_bytes(model.SerializeToString())
    path.with_suffix(".toml").write_text(SIDECAR + (DEPTH if depth else ""))
    return path


def _weights(channels: int, opset: int) -> list[onnx.TensorProto]:
    """Class 0 is dark, class 2 bright (or far, with depth), class 1 in between."""
    signs = np.where(np.arange(16) % 2, -1.0, 1.0)[:, None, None, None]
    mean = np.full((1, channels, 3, 3), 1 / (9 * channels))
    spread = np.full((1, 16, 3, 3), 1 / 72) * np.where(np.arange(16) % 2, -1.0, 1.0)[:, None, None]
    weights = {
        "w0": signs * mean * np.linspace(0.5, 1.5, 16)[:, None, None, None], "w1": signs * spread,
        "w2": np.concatenate([-signs, 0 * signs, signs]).reshape(3, 16, 1, 1), "b2": np.array([0, 2, 0]),
        "sizes": np.array([1, 3, HEIGHT, WIDTH], np.int64), "nothing": np.zeros(0),
    }  # fmt: skip
    if opset >= AXES_AS_INPUT:
        weights["axes"] = np.array([1], np.int64)
    return [
        numpy_helper.from_array(value if name in ("sizes", "axes") else value.astype(np.float32), name)
        for name, value in weights.items()
    ]


def _enlarged(source: str, name: str) -> onnx.NodeProto:
    return helper.make_node("Resize", [source, "nothing", "nothing", "sizes"], [name], mode="linear")


def _along(kind: str, source: str, name: str, opset: int) -> list[onnx.NodeProto]:
    """A reduction over the classes; its axes were an attribute before opset 18."""
    if opset < AXES_AS_INPUT:
        return [helper.make_node(kind, [source], [name], axes=[1], keepdims=0)]
    return [helper.make_node(kind, [source, "axes"], [name], keepdims=0)]
