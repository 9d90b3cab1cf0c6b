"""The libraries that run a network: one row per backend."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import onnxruntime
from onnxruntime.capi import onnxruntime_pybind11_state as ort_errors

from stsem.errors import NetworkError, UsageError
from stsem.inference.preprocess import Tensor

DEFAULT_BACKEND = "onnxruntime"
DEFAULT_PRECISION = "f32"

_ORT_FAILURES = (
    ort_errors.Fail, ort_errors.InvalidArgument, ort_errors.InvalidGraph, ort_errors.InvalidProtobuf,
    ort_errors.NoSuchFile, ort_errors.NotImplemented, ort_errors.RuntimeException, ort_errors.EPFail,
    ort_errors.NoModel, ort_errors.NotFound, RuntimeError,
)  # fmt: skip
_ERRORS_ONLY = 3


@dataclass(frozen=True)
class Port:
    """One input or output of a graph; a side that the file leaves open is None."""

    name: str
    type: str
    shape: tuple[int | None, ...]


@dataclass(frozen=True)
class Signature:
    """What goes into a graph, what comes out, and the metadata that its maker left in the file."""

    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    metadata: Mapping[str, str]


class Session(Protocol):
    """A network that is ready to run."""

    def run(self, outputs: list[str], inputs: Mapping[str, Tensor]) -> list[np.ndarray[Any, Any]]:
        """Values of the named outputs. Raises NetworkError when the graph fails."""


class OrtSession:
    """ONNX Runtime on the CPU with a fixed number of threads.

    Waiting threads sleep instead of spinning: two networks or a busy machine would otherwise pay for the spinning.
    """

    def __init__(self, path: Path, threads: int) -> None:
        self._path = path
        self._session = _open(path, threads, onnxruntime.GraphOptimizationLevel.ORT_ENABLE_ALL)

    def run(self, outputs: list[str], inputs: Mapping[str, Tensor]) -> list[np.ndarray[Any, Any]]:
        """See `Session.run`."""
        try:
            values: list[np.ndarray[Any, Any]] = self._session.run(outputs, dict(inputs))
        except _ORT_FAILURES as err:
            raise NetworkError(
                f"The network {self._path.name} fails on the input it states: {_first_line(err)}"
            ) from err
        return values


@dataclass(frozen=True)
class Backend:
    """A row of `BACKENDS`."""

    precisions: tuple[str, ...]
    distribution: str
    open: Callable[[Path, int], Session]


BACKENDS: dict[str, Backend] = {
    "onnxruntime": Backend(("f32",), "onnxruntime", OrtSession),
}


def choose_backend(name: str, precision: str) -> Backend:
    """The row for `name`, checked against `precision`.

    Raises:
        UsageError: no such backend, or it does not compute in `precision`.
    """
    if name not in BACKENDS:
        raise UsageError(f"There is no backend {name!r} in this version; choose one of {', '.join(BACKENDS)}.")
    row = BACKENDS[name]
    if precision not in row.precisions:
        offered = ", ".join(row.precisions)
        raise UsageError(f"The backend {name} does not compute in precision {precision!r}; choose one of {offered}.")
    return row


def read_signature(path: Path) -> Signature:
    """Inputs and outputs of an ONNX file.

    Raises:
        NetworkError: not an ONNX file, or a graph that ONNX Runtime cannot load.
    """
    session = _open(path, 1, onnxruntime.GraphOptimizationLevel.ORT_DISABLE_ALL)
    return Signature(
        tuple(map(_port, session.get_inputs())), tuple(map(_port, session.get_outputs())),
        dict(session.get_modelmeta().custom_metadata_map),
    )  # fmt: skip


def _open(path: Path, threads: int, level: Any) -> Any:
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
    options.graph_optimization_level = level
    options.log_severity_level = _ERRORS_ONLY
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    try:
        return onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except _ORT_FAILURES as err:
        raise NetworkError(f"{path} cannot be loaded as an ONNX network: {_first_line(err)}") from err


def _port(arg: Any) -> Port:
    return Port(arg.name, arg.type, tuple(side if isinstance(side, int) else None for side in arg.shape))


def _first_line(err: BaseException) -> str:
    lines = str(err).strip().splitlines()
    return lines[0] if lines else type(err).__name__
