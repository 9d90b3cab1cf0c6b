"""Small ONNX files, built by hand, so that these tests need no torch."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper

WIDTH, HEIGHT, CLASSES = 16, 12, 3
SIDECAR = f"""size = [{WIDTH}, {HEIGHT}]
mean = [0.0, 0.0, 0.0]
std = [1.0, 1.0, 1.0]
classes = ["red", "green", "blue"]
"""
WITH_DIFFERENCE = SIDECAR + "[difference]\nscale = 2.0\n"

Files = Callable[..., Path]


@pytest.fixture
def files(tmp_path: Path) -> Files:
    """Writes `net.onnx` and `net.toml`; `kind` is a row of `GRAPHS`."""

    def write(
        kind: str = "labels", sidecar: str | None = SIDECAR, metadata: dict[str, str] | None = None, name: str = "net"
    ) -> Path:
        model = GRAPHS[kind]()
        helper.set_model_props(model, metadata or {})
        path = tmp_path / f"{name}.onnx"
        path.write_bytes(model.SerializeToString())
        if sidecar is not None:
            path.with_suffix(".toml").write_text(sidecar)
        return path

    return write


def _model(
    nodes: list[onnx.NodeProto], inputs: list[str], outputs: dict[str, tuple[int, list[int]]]
) -> onnx.ModelProto:
    shapes = {name: [1, 1 if name == "depth" else 3, HEIGHT, WIDTH] for name in inputs}
    graph = helper.make_graph(
        nodes, "net", [helper.make_tensor_value_info(name, TensorProto.FLOAT, shapes[name]) for name in inputs],
        [helper.make_tensor_value_info(name, *kind) for name, kind in outputs.items()],
    )  # fmt: skip
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)


_LABELS = {"labels": (TensorProto.UINT8, [1, HEIGHT, WIDTH]), "confidence": (TensorProto.FLOAT, [1, HEIGHT, WIDTH])}


def _answer(source: str) -> list[onnx.NodeProto]:
    return [
        helper.make_node("ArgMax", [source], ["ids"], axis=1, keepdims=0),
        helper.make_node("Cast", ["ids"], ["labels"], to=TensorProto.UINT8),
        helper.make_node("ReduceMax", [source, "axes"], ["confidence"], keepdims=0),
    ]


def _axes() -> onnx.NodeProto:
    return helper.make_node("Constant", [], ["axes"], value=helper.make_tensor("axes", TensorProto.INT64, [1], [1]))


def _strongest_channel() -> onnx.ModelProto:
    """Label = the strongest colour channel, confidence = its value."""
    return _model([_axes(), *_answer("image")], ["image"], _LABELS)


def _difference() -> onnx.ModelProto:
    """The same of the difference alone; the image is added with weight 0."""
    zero = helper.make_node("Constant", [], ["zero"], value=helper.make_tensor("zero", TensorProto.FLOAT, [], [0.0]))
    return _model(
        [_axes(), zero, helper.make_node("Mul", ["image", "zero"], ["nothing"]),
         helper.make_node("Add", ["difference", "nothing"], ["sum"]), *_answer("sum")],
        ["image", "difference"], _LABELS,
    )  # fmt: skip


def _depth() -> onnx.ModelProto:
    """The same of colour plus depth / 4 in the green channel: what is 4 m away is green, confidence at most 1."""
    weights = helper.make_tensor("weights", TensorProto.FLOAT, [1, 3, 1, 1], [0.0, 0.25, 0.0])
    return _model(
        [_axes(), helper.make_node("Constant", [], ["weights"], value=weights),
         helper.make_node("Mul", ["depth", "weights"], ["green"]),
         helper.make_node("Add", ["image", "green"], ["sum"]), *_answer("sum")],
        ["image", "depth"], _LABELS,
    )  # fmt: skip


def _logits() -> onnx.ModelProto:
    """Half-size scores: channel means of 2x2 pixels, times 8."""
    eight = helper.make_node("Constant", [], ["eight"], value=helper.make_tensor("eight", TensorProto.FLOAT, [], [8.0]))
    return _model(
        [eight, helper.make_node("AveragePool", ["image"], ["small"], kernel_shape=[2, 2], strides=[2, 2]),
         helper.make_node("Mul", ["small", "eight"], ["logits"])],
        ["image"], {"logits": (TensorProto.FLOAT, [1, 3, HEIGHT // 2, WIDTH // 2])},
    )  # fmt: skip


def _unsure() -> onnx.ModelProto:
    """The strongest channel; two maps of uncertainty: red as the variance, blue as the mutual information."""
    constants = [helper.make_node("Constant", [], [name], value=helper.make_tensor(name, TensorProto.INT64, [], [i]))
                 for name, i in (("red", 0), ("blue", 2))]  # fmt: skip
    return _model(
        [_axes(), *constants, *_answer("image"), helper.make_node("Gather", ["image", "red"], ["variance"], axis=1),
         helper.make_node("Gather", ["image", "blue"], ["mutual_information"], axis=1)],
        ["image"], _LABELS | dict.fromkeys(("mutual_information", "variance"), _LABELS["confidence"]),
    )  # fmt: skip


def _wide_labels() -> onnx.ModelProto:
    """Labels as int64."""
    nodes = [_axes(), helper.make_node("ArgMax", ["image"], ["labels"], axis=1, keepdims=0), _answer("image")[2]]
    return _model(nodes, ["image"], {**_LABELS, "labels": (TensorProto.INT64, [1, HEIGHT, WIDTH])})


def _negative_labels() -> onnx.ModelProto:
    """The same less 1."""
    one = helper.make_node("Constant", [], ["one"], value=helper.make_tensor("one", TensorProto.INT64, [], [1]))
    nodes = [_axes(), one, helper.make_node("ArgMax", ["image"], ["ids"], axis=1, keepdims=0),
             helper.make_node("Sub", ["ids", "one"], ["labels"]), _answer("image")[2]]  # fmt: skip
    return _model(nodes, ["image"], {**_LABELS, "labels": (TensorProto.INT64, [1, HEIGHT, WIDTH])})


def _other_output() -> onnx.ModelProto:
    return _model(
        [helper.make_node("Relu", ["image"], ["out"])], ["image"], {"out": (TensorProto.FLOAT, [1, 3, HEIGHT, WIDTH])}
    )


def _other_input() -> onnx.ModelProto:
    model = _strongest_channel()
    for node in model.graph.node:
        for i, name in enumerate(node.input):
            node.input[i] = "input" if name == "image" else name
    model.graph.input[0].name = "input"
    return model


def _nan_confidence() -> onnx.ModelProto:
    nan = helper.make_tensor("nan", TensorProto.FLOAT, [], [np.nan])
    return _model(
        [_axes(), helper.make_node("Constant", [], ["nan"], value=nan),
         helper.make_node("Mul", ["image", "nan"], ["bad"]), *_answer("bad")],
        ["image"], _LABELS,
    )  # fmt: skip


GRAPHS: dict[str, Callable[[], onnx.ModelProto]] = {
    "labels": _strongest_channel,
    "difference": _difference,
    "depth": _depth,
    "logits": _logits,
    "unsure": _unsure,
    "wide labels": _wide_labels,
    "negative labels": _negative_labels,
    "other output": _other_output,
    "other input": _other_input,
    "nan": _nan_confidence,
}
