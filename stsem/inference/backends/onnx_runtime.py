"""ONNX Runtime: the reference result, and the judge of what a file is."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
from onnxruntime.capi import onnxruntime_pybind11_state as ort_errors

from stsem.errors import NetworkError
from stsem.inference.backends.session import Port, Signature, first_line
from stsem.inference.preprocess import Tensor

FAILURES = (
    ort_errors.Fail, ort_errors.InvalidArgument, ort_errors.InvalidGraph, ort_errors.InvalidProtobuf,
    ort_errors.NoSuchFile, ort_errors.NotImplemented, ort_errors.RuntimeException, ort_errors.EPFail,
    ort_errors.NoModel, ort_errors.NotFound, RuntimeError,
)  # fmt: skip
"""What ONNX Runtime raises at a file or an input; it has no parent of its own for them."""
_ERRORS_ONLY = 3


class OrtSession:
    """ONNX Runtime on the CPU with a fixed number of threads.

    Waiting threads sleep instead of spinning: two networks or a busy machine would otherwise pay for the spinning.
    The file decides the arithmetic: f32, or int8 where it says so.
    """

    def __init__(self, path: Path, precision: str, threads: int) -> None:
        self._path = path
        self._session = _open(path, threads, onnxruntime.GraphOptimizationLevel.ORT_ENABLE_ALL)

    def run(self, outputs: list[str], inputs: Mapping[str, Tensor]) -> list[np.ndarray[Any, Any]]:
        """See `Session.run`."""
        try:
            values: list[np.ndarray[Any, Any]] = self._session.run(outputs, dict(inputs))
        except FAILURES as err:
            raise NetworkError(
                f"The network {self._path.name} fails on the input it states: {first_line(err)}"
            ) from err
        return values


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
    except FAILURES as err:
        raise NetworkError(f"{path} cannot be loaded as an ONNX network: {first_line(err)}") from err


def _port(arg: Any) -> Port:
    return Port(arg.name, arg.type, tuple(side if isinstance(side, int) else None for side in arg.shape))
