"""A network of a few nodes that is right about nothing in particular, and says how unsure it is."""

from pathlib import Path

import onnx
from onnx import TensorProto, helper

from stsem.uncertainty import MEASURES

SIDECAR = """size = [48, 32]
mean = [0.0, 0.0, 0.0]
std = [1.0, 1.0, 1.0]
classes = ["wall", "floor", "door"]
"""


def write_network(path: Path, *, measures: bool) -> Path:
    """Chances are a softmax over the colours; the entropy is true, variance and mutual information are made from it."""
    nodes = [
        _constant("two", TensorProto.FLOAT, [2.0]), _constant("tenth", TensorProto.FLOAT, [0.1]),
        _constant("channel", TensorProto.INT64, [1]),
        helper.make_node("Mul", ["image", "two"], ["scores"]), helper.make_node("Softmax", ["scores"], ["p"], axis=1),
        helper.make_node("ArgMax", ["p"], ["ids"], axis=1, keepdims=0),
        helper.make_node("Cast", ["ids"], ["labels"], to=TensorProto.UINT8),
        helper.make_node("ReduceMax", ["p", "channel"], ["confidence"], keepdims=0),
        helper.make_node("Log", ["p"], ["log p"]), helper.make_node("Mul", ["p", "log p"], ["p log p"]),
        helper.make_node("ReduceSum", ["p log p", "channel"], ["negative"], keepdims=0),
        helper.make_node("Neg", ["negative"], ["entropy"]),
        helper.make_node("Mul", ["entropy", "tenth"], ["mutual_information"]),
        helper.make_node("Mul", ["mutual_information", "confidence"], ["variance"]),
    ]  # fmt: skip
    given = helper.make_tensor_value_info("image", TensorProto.FLOAT, [1, 3, 32, 48])
    kinds = {"labels": TensorProto.UINT8, "confidence": TensorProto.FLOAT}
    kinds |= dict.fromkeys(MEASURES, TensorProto.FLOAT) if measures else {}
    outputs = [helper.make_tensor_value_info(name, kind, [1, 32, 48]) for name, kind in kinds.items()]
    graph = helper.make_graph(nodes, "unsure", [given], outputs)
    onnx.save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9), str(path))
    path.with_suffix(".toml").write_text(SIDECAR)
    return path


def _constant(name: str, kind: int, values: list[float]) -> onnx.NodeProto:
    shape = [len(values)] if kind == TensorProto.INT64 else []
    return helper.make_node("Constant", [], [name], value=helper.make_tensor(name, kind, shape, values))
