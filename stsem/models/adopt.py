"""A network that was made elsewhere -> one with the inputs and outputs of DESIGN 11; the graph itself is unchanged."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import onnx
from onnx import TensorProto, helper, numpy_helper

from stsem.aside import write_aside
from stsem.errors import NetworkError, OutputError
from stsem.models.foreign import (
    TYPES,
    ForeignInput,
    ForeignOutput,
    Layout,
    find_inputs,
    find_output,
    read_foreign,
    shown,
)

_SUM = 1e-2
"""How far from 1 probabilities may sum; half precision is no better."""


@dataclass(frozen=True)
class Told:
    """What a file does not say of itself.

    Args:
        inputs: role -> name; needed where there are several.
        output: its name; needed where there are several.
        layout: of the inputs, where their shapes do not tell.
        bgr: whether it takes blue first.
    """

    inputs: Mapping[str, str] = field(default_factory=dict)
    output: str | None = None
    layout: Layout | None = None
    bgr: bool = False


def adopt(
    path: Path, out: Path, told: Told, *, size: tuple[int, int], classes: int, inputs: Mapping[str, int],
    metadata: Mapping[str, str],
) -> list[str]:  # fmt: skip
    """Write `out`: the network of `path` between nodes that bring our inputs to its form, and its output to ours.

    Args:
        path: an ONNX file whose output has a score or a probability for every class, or is labels.
        out: the file to write.
        told: see `Told`.
        size: (width, height) of the sidecar.
        classes: number of classes C.
        inputs: role -> channels, of the sidecar.
        metadata: strings to keep in the file.

    Returns:
        What was found, a line for each input and one for the output.

    Raises:
        NetworkError: the file cannot be read, or not be brought to the form; the message says why and what to do.
        OutputError: `out` cannot be written.
    """
    model = read_foreign(path)
    taken = find_inputs(model, inputs, told.inputs, told.layout, size)
    given = find_output(model, taken, told.output)
    nodes = _Nodes()
    for source in taken:
        nodes.feed(source, told.bgr and source.role != "depth")
    before, nodes.made = nodes.made, []
    found = nodes.answer(given, classes, size, taken[0].layout)
    everything = [*before, *model.graph.node, *nodes.made]
    del model.graph.node[:], model.graph.input[:], model.graph.output[:]
    model.graph.node.extend(everything)
    width, height = size
    model.graph.input.extend(_tensor(x.role, TensorProto.FLOAT, (1, inputs[x.role], height, width)) for x in taken)
    model.graph.output.extend(
        _tensor(name, kind, (1, height, width))
        for name, kind in (("labels", nodes.label_type), ("confidence", TensorProto.FLOAT))
    )
    model.graph.initializer.extend(nodes.constants)
    helper.set_model_props(model, dict(sorted(metadata.items())))
    try:
        write_aside(out, model.SerializeToString(deterministic=True))
    except OSError as err:
        raise OutputError(f"The network cannot be written to {out}: {err.strerror}.") from err
    except ValueError as err:
        raise OutputError(f"The network has more than 2 GB, which one ONNX file cannot hold ({err}).") from err
    return [*(f"{x.role} as {shown(x.name)}, {TYPES[x.type]} {x.shape}" for x in taken), found]


class _Nodes:
    """Nodes and constants that surround the foreign graph; all of these kinds exist since opset 13."""

    def __init__(self) -> None:
        self.made: list[onnx.NodeProto] = []
        self.constants: list[onnx.TensorProto] = []
        self.label_type: int = TensorProto.UINT8

    def add(self, kind: str, *inputs: str, output: str = "", **attributes: Any) -> str:
        """The name of the new node's output."""
        name = output or f"adopted/{kind}_{inputs[0]}"
        self.made.append(helper.make_node(kind, inputs, [name], name=f"adopted/{kind}_{name}", **attributes))
        return name

    def constant(self, value: npt.ArrayLike) -> str:
        """The name of a constant; whole numbers as int64."""
        name = f"adopted/constant_{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.asarray(value), name))
        return name

    def feed(self, source: ForeignInput, bgr: bool) -> None:
        """(1, c, H, W) float32 under the name of the role -> the foreign input."""
        name = source.role
        if bgr:
            name = self.add("Gather", name, self.constant([2, 1, 0]), axis=1)
        if source.layout == "nhwc":
            name = self.add("Transpose", name, perm=[0, 2, 3, 1])
        if len(source.shape) == 3:
            name = self.add("Reshape", name, self.constant(source.shape))
        if source.type == TensorProto.UINT8:
            name = self.add("Clip", self.add("Round", name), *(self.constant(np.float32(x)) for x in (0, 255)))
        self.add("Cast", name, output=source.name, to=source.type)

    def answer(self, given: ForeignOutput, classes: int, size: tuple[int, int], layout: Layout) -> str:
        """The foreign output -> `labels` and `confidence`; what it is, for people."""
        kind = f"{shown(given.name)}, {given.value.dtype} {given.value.shape}"
        if given.value.dtype.kind in "iu":
            return self._from_labels(given, size, kind)
        if given.value.dtype.kind != "f":
            raise NetworkError(f"The output {kind} is neither scores nor labels; choose another with --output NAME.")
        return self._from_scores(given, classes, size, layout, kind)

    def _from_labels(self, given: ForeignOutput, size: tuple[int, int], kind: str) -> str:
        """Ids of any whole type; -1 becomes 255, no label. There is no confidence, so it is 1 everywhere.

        Wide ids stay wide, since in 8 bits 256 would be class 0: whoever runs the network refuses those beyond the
        classes.
        """
        shape = given.value.shape
        grid = shape[1:3] if len(shape) == 4 and shape[-1] == 1 else shape[-2:]
        if len(shape) < 2 or given.value.size != grid[0] * grid[1]:
            raise NetworkError(f"The output {kind} is no single label image; choose another with --output NAME.")
        name = self.add("Reshape", given.name, self.constant([1, 1, *grid]))
        if grid != size[::-1]:
            name = self._enlarged(self.add("Cast", name, to=TensorProto.FLOAT), size, "nearest")
        self._labels(name, size, TensorProto.UINT8 if given.value.dtype == np.uint8 else TensorProto.INT64)
        one = numpy_helper.from_array(np.ones(1, np.float32))
        self.add("ConstantOfShape", self.constant([1, size[1], size[0]]), output="confidence", value=one)
        return f"{kind}: labels; their confidence is not known and stands as 1"

    def _from_scores(self, given: ForeignOutput, classes: int, size: tuple[int, int], layout: Layout, kind: str) -> str:
        value = given.value if given.value.ndim == 4 else given.value[None]
        axes = [axis for axis in (1, 3) if value.ndim == 4 and value.shape[axis] == classes]
        if not axes or value.shape[0] != 1:
            raise NetworkError(f"The output {kind} has no side for the {classes} classes of the sidecar; name as many "
                               "classes there as the network has, or choose another with --output NAME.")  # fmt: skip
        axis = axes[0] if len(axes) == 1 else (1 if layout == "nchw" else 3)
        name = self.add("Cast", given.name, output="adopted/scores", to=TensorProto.FLOAT)
        name = self.add("Reshape", name, self.constant(value.shape))
        if axis == 3:
            name = self.add("Transpose", name, perm=[0, 3, 1, 2])
        is_probability = value.min() >= 0 and float(np.abs(value.astype(np.float32).sum(axis) - 1).max()) < _SUM
        if not is_probability:
            name = self.add("Softmax", name, axis=1)
        grid = value.shape[2:] if axis == 1 else value.shape[1:3]
        if grid != size[::-1]:
            name = self._enlarged(name, size, "linear", classes)
        ids = self.add("ArgMax", name, axis=1, keepdims=1)
        self._labels(ids, size, TensorProto.UINT8)
        most = self.add("GatherElements", name, ids, axis=1)
        self.add("Reshape", most, self.constant([1, size[1], size[0]]), output="confidence")
        what = "probabilities" if is_probability else "scores, softmax added"
        return f"{kind}: {what}{'' if grid == size[::-1] else ', enlarged'}"

    def _labels(self, ids: str, size: tuple[int, int], kind: int) -> None:
        self.label_type = kind
        cast = self.add("Cast", ids, to=kind, output="adopted/ids")
        self.add("Reshape", cast, self.constant([1, size[1], size[0]]), output="labels")

    def _enlarged(self, name: str, size: tuple[int, int], mode: str, channels: int = 1) -> str:
        """At (width, height), the centres of pixels aligned, as torch does without `align_corners`."""
        sides = self.constant([1, channels, size[1], size[0]])
        how = {"nearest_mode": "round_prefer_ceil"} if mode == "nearest" else {}
        return self.add(
            "Resize", name, "", "", sides, mode=mode, coordinate_transformation_mode="half_pixel", **how
        )  # fmt: skip


def _tensor(name: str, kind: int, shape: Sequence[int]) -> onnx.ValueInfoProto:
    return helper.make_tensor_value_info(name, kind, shape)
