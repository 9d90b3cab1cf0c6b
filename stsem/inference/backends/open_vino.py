"""OpenVINO: the same files, up to several times faster; an extra, loaded when it is asked for."""

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from stsem.errors import MissingExtraError, NetworkError, UsageError
from stsem.inference.backends.session import first_line
from stsem.inference.preprocess import Tensor

_DEVICE = "CPU"
_TELEMETRY = "openvino_telemetry"
_HINTS = {"f32": "f32", "bf16": "bf16", "int8": "f32"}
"""Precision -> what the layers without a precision of their own compute in. Unsaid, OpenVINO picks bf16 by itself."""


class OpenVinoSession:
    """OpenVINO on the CPU, precision and number of threads fixed: the same bytes for one thread and for two.

    Args:
        path: the ONNX file, quantised for int8.
        precision: a key of `_HINTS`.
        threads: of the session.

    Raises:
        MissingExtraError: OpenVINO is not installed.
        UsageError: the processor does not compute in this precision.
        NetworkError: OpenVINO cannot run the graph.
    """

    def __init__(self, path: Path, precision: str, threads: int) -> None:
        self._path = path
        check_open_vino(precision)
        fixed = {
            "INFERENCE_PRECISION_HINT": _HINTS[precision], "INFERENCE_NUM_THREADS": threads, "NUM_STREAMS": 1,
            "ENABLE_CPU_PINNING": False,
        }  # fmt: skip
        core = _library().Core()
        try:
            self._request = core.compile_model(core.read_model(path), _DEVICE, fixed).create_infer_request()
        except RuntimeError as err:
            raise NetworkError(f"{path} cannot be run by OpenVINO in {precision}: {first_line(err)}") from err

    def run(self, outputs: list[str], inputs: Mapping[str, Tensor]) -> list[np.ndarray[Any, Any]]:
        """See `Session.run`."""
        try:
            values = self._request.infer(dict(inputs))
            return [values[name] for name in outputs]
        except RuntimeError as err:
            raise NetworkError(
                f"The network {self._path.name} fails on the input it states: {first_line(err)}"
            ) from err


def check_open_vino(precision: str) -> None:
    """Raise MissingExtraError without OpenVINO, UsageError where the processor would compute in another precision."""
    abilities = _library().Core().get_property(_DEVICE, "OPTIMIZATION_CAPABILITIES")
    if precision == "bf16" and "BF16" not in abilities:
        raise UsageError("This processor does not compute in bf16; choose --precision f32 or int8.")


def _library() -> Any:
    """The module `openvino`, without its messenger."""
    try:
        with _silenced():
            import openvino
    except ImportError as err:
        raise MissingExtraError("openvino", "The backend openvino") from err
    return openvino


@contextmanager
def _silenced() -> Iterator[None]:
    """Let the import find no messenger: else it writes an id to the home folder and sends it to a counter."""
    if _TELEMETRY in sys.modules:
        yield
        return
    sys.modules[_TELEMETRY] = None  # type: ignore[assignment]  # what makes an import fail, as Python defines it
    try:
        yield
    finally:
        del sys.modules[_TELEMETRY]
