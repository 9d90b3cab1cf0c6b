"""An ONNX file made elsewhere: what goes into it, what comes out, found by reading and by running it once."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import onnx
import onnxruntime
from google.protobuf.message import DecodeError  # type: ignore[import-untyped]
from onnx import TensorProto, compose, version_converter
from onnxruntime.capi import onnxruntime_pybind11_state as ort_errors

from stsem.errors import NetworkError

Layout = Literal["nchw", "nhwc"]
PREFIX = "given/"
"""Before every name of the foreign graph, so that ours are free."""
OLDEST_OPSET = 13
"""Older graphs are converted to it first."""
TYPES: dict[int, str] = {
    TensorProto.FLOAT: "float32", TensorProto.FLOAT16: "float16", TensorProto.DOUBLE: "float64",
    TensorProto.UINT8: "uint8",
}  # fmt: skip
"""What an image can be fed as."""

_ORT_FAILURES = (
    ort_errors.Fail, ort_errors.InvalidArgument, ort_errors.InvalidGraph, ort_errors.InvalidProtobuf,
    ort_errors.NotImplemented, ort_errors.RuntimeException, RuntimeError, ValueError,
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class ForeignInput:
    """An input of the foreign graph and what it is fed with.

    Args:
        role: "image", "difference" or "depth".
        name: in the graph, with `PREFIX`.
        type: of its elements, a key of `TYPES`.
        layout: channels first or last.
        shape: its sides, all of them known now.
    """

    role: str
    name: str
    type: int
    layout: Layout
    shape: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class ForeignOutput:
    """What an output of the foreign graph is: its name with `PREFIX`, and what came out for noise."""

    name: str
    value: np.ndarray[Any, Any]


def read_foreign(path: Path) -> onnx.ModelProto:
    """The file with `PREFIX` before its names, at opset `OLDEST_OPSET` or later. Raises NetworkError."""
    try:
        model = onnx.load(path)
    except OSError as err:
        raise NetworkError(f"The network {path} cannot be read: {err.strerror or err}.") from err
    except (DecodeError, ValueError, onnx.checker.ValidationError) as err:
        raise NetworkError(f"{path} is no ONNX file, or a damaged one; export the network to ONNX first.") from err
    if not model.graph.node:
        raise NetworkError(f"{path} is no ONNX file, or one without a graph; export the network to ONNX first.")
    opset = next((row.version for row in model.opset_import if row.domain in ("", "ai.onnx")), OLDEST_OPSET)
    if opset < OLDEST_OPSET:
        try:
            model = version_converter.convert_version(model, OLDEST_OPSET)
        except (version_converter.ConvertError, RuntimeError, ValueError, IndexError) as err:
            raise NetworkError(f"The network {path} is of opset {opset}, which onnx cannot convert to {OLDEST_OPSET}; "
                               f"export it again with opset {OLDEST_OPSET} or later.") from err  # fmt: skip
    try:
        return compose.add_prefix(model, PREFIX)
    except TypeError as err:  # a name that is not UTF-8 comes as bytes
        raise NetworkError(f"The network {path} is damaged; export it to ONNX again.") from err


def shown(name: str) -> str:
    """A name as its maker knows it."""
    return repr(name.removeprefix(PREFIX))


def find_inputs(
    model: onnx.ModelProto, wanted: Mapping[str, int], named: Mapping[str, str], layout: Layout | None,
    size: tuple[int, int],
) -> tuple[ForeignInput, ...]:  # fmt: skip
    """Which input is fed with what; its open sides are closed in `model`, in place.

    Args:
        model: from `read_foreign`.
        wanted: role -> channels.
        named: role -> name of the input, where the user says so. One input needs no name.
        layout: of all inputs, where their shapes do not tell.
        size: (width, height) to feed.

    Raises:
        NetworkError: an input is missing, left over, or cannot be fed.
    """
    constants = {value.name for value in model.graph.initializer}
    there = {value.name: value for value in model.graph.input if value.name not in constants}
    roles = {role: PREFIX + name for role, name in named.items()}
    if not roles and len(there) == len(wanted) == 1:
        roles = dict(zip(wanted, there, strict=True))
    roles = {role: roles.get(role, PREFIX + role) for role in wanted}
    listed = ", ".join(map(shown, there)) or "none"
    if unknown := [role for role in named if role not in wanted]:
        raise NetworkError(f"The sidecar calls for {', '.join(wanted)} and not for {unknown[0]!r}, which --input "
                           "names; difference and depth need a section of that name in it.")  # fmt: skip
    for role, name in roles.items():
        if name not in there:
            raise NetworkError(f"The network has no input {shown(name)} for the {role}, but {listed}; name it with "
                               f"--input {role}=NAME.")  # fmt: skip
    if left := [name for name in there if name not in roles.values()]:
        raise NetworkError(f"The network also has the input {shown(left[0])}, and the sidecar calls for "
                           f"{', '.join(wanted)} alone; export it without it, or with a constant there.")  # fmt: skip
    return tuple(_input(there[name], role, wanted[role], layout, size) for role, name in roles.items())


def _input(
    value: onnx.ValueInfoProto, role: str, channels: int, layout: Layout | None, size: tuple[int, int]
) -> ForeignInput:
    tensor = value.type.tensor_type
    sides = tuple(side.dim_value or None for side in tensor.shape.dim)
    if tensor.elem_type not in TYPES:
        kind = TensorProto.DataType.Name(tensor.elem_type).lower()
        raise NetworkError(f"The input {shown(value.name)} is of type {kind}; it must be one of "
                           f"{', '.join(TYPES.values())} to take the {role}.")  # fmt: skip
    if len(sides) not in (3, 4):
        raise NetworkError(f"The input {shown(value.name)} has {len(sides)} sides; expected 4, or 3 without a batch.")
    found = layout or _layout(sides, channels)
    if found is None:
        raise NetworkError(f"The input {shown(value.name)} has the shape {_shape(sides)}, which does not tell where "
                           f"its {channels} channel(s) are; say --layout nchw or --layout nhwc.")  # fmt: skip
    width, height = size
    shape = (channels, height, width) if found == "nchw" else (height, width, channels)
    full = (1, *shape)[-len(sides) :]
    if any(is_ is not None and is_ != want for is_, want in zip(sides, full, strict=True)):
        many = len(sides) == 4 and sides[1:] == full[1:]
        what = "export it for one image at a time" if many else "write the network's own size there"
        raise NetworkError(f"The input {shown(value.name)} has the shape {_shape(sides)}, but the sidecar's size calls "
                           f"for {_shape(full)}; {what}.")  # fmt: skip
    for side, number in zip(tensor.shape.dim, full, strict=True):
        side.dim_value = number
    return ForeignInput(role, value.name, tensor.elem_type, found, full)


def _layout(sides: Sequence[int | None], channels: int) -> Layout | None:
    """Where the channels are, if the shape tells: the third side from the end, or the last."""
    first, last = sides[-3] == channels, sides[-1] == channels
    return "nchw" if first and not last else "nhwc" if last and not first else None


def find_output(model: onnx.ModelProto, inputs: Sequence[ForeignInput], name: str | None) -> ForeignOutput:
    """Run the graph once on noise and take the output of that name, or the only one. Raises NetworkError."""
    there = [value.name for value in model.graph.output]
    chosen = there[0] if name is None and len(there) == 1 else f"{PREFIX}{name}"
    if chosen not in there:
        what = "several outputs" if name is None else f"no output {name!r}"
        raise NetworkError(f"The network has {what}: {', '.join(map(shown, there))}; choose one with --output NAME.")
    rng = np.random.default_rng(0)
    feed = {
        x.name: (rng.random(x.shape) * (255 if x.type == TensorProto.UINT8 else 1)).astype(TYPES[x.type])
        for x in inputs
    }  # fmt: skip
    for value in model.graph.output:
        value.type.tensor_type.ClearField("shape")  # stated for other inputs, as it may be
    del model.graph.value_info[:]
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 3
    try:
        session = onnxruntime.InferenceSession(
            model.SerializeToString(), options, providers=["CPUExecutionProvider"], enable_fallback=0
        )
        (value,) = session.run([chosen], feed)
    except _ORT_FAILURES as err:
        raise NetworkError(f"The network fails on an image of the sidecar's size: {str(err).splitlines()[0]}") from err
    if not isinstance(value, np.ndarray):
        raise NetworkError(f"The output {shown(chosen)} is no tensor; choose another one with --output NAME.")
    return ForeignOutput(chosen, value)


def _shape(sides: Sequence[int | None]) -> str:
    return "(" + ", ".join("any" if side is None else str(side) for side in sides) + ")"
