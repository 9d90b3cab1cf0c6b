"""The libraries that run a network: one row per backend."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from stsem.errors import UsageError
from stsem.inference.backends.onnx_runtime import OrtSession, read_signature
from stsem.inference.backends.open_vino import OpenVinoSession, check_open_vino
from stsem.inference.backends.session import Port, Session, Signature

__all__ = [
    "BACKENDS", "DEFAULT_BACKEND", "DEFAULT_PRECISION", "PRECISIONS", "Backend", "Port", "Session", "Signature",
    "choose_backend", "read_signature",
]  # fmt: skip

DEFAULT_BACKEND = "onnxruntime"
DEFAULT_PRECISION = "f32"


@dataclass(frozen=True)
class Backend:
    """A row of `BACKENDS`.

    Args:
        precisions: what it computes in.
        distribution: the package whose version goes into a result's identity.
        open: (file, precision, threads) -> a session.
        check: raises what stands against it on this machine in a precision.
    """

    precisions: tuple[str, ...]
    distribution: str
    open: Callable[[Path, str, int], Session]
    check: Callable[[str], None] = lambda precision: None


BACKENDS: dict[str, Backend] = {
    "onnxruntime": Backend(("f32", "int8"), "onnxruntime", OrtSession),
    "openvino": Backend(("f32", "bf16", "int8"), "openvino", OpenVinoSession, check_open_vino),
}
PRECISIONS = tuple(dict.fromkeys(precision for row in BACKENDS.values() for precision in row.precisions))
"""Every precision that some backend computes in."""


def choose_backend(name: str, precision: str) -> Backend:
    """The row for `name`, checked against `precision`, this installation and this processor.

    Raises:
        UsageError: no such backend, it does not compute in `precision`, or the processor does not.
        MissingExtraError: it is not installed.
    """
    if name not in BACKENDS:
        raise UsageError(f"There is no backend {name!r} in this version; choose one of {', '.join(BACKENDS)}.")
    row = BACKENDS[name]
    if precision not in row.precisions:
        offered = ", ".join(row.precisions)
        others = [other for other, its in BACKENDS.items() if precision in its.precisions]
        instead = f", or --backend {others[0]}" if others else ""
        raise UsageError(
            f"The backend {name} does not compute in precision {precision!r}; choose one of {offered}{instead}."
        )
    row.check(precision)
    return row
