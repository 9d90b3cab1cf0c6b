"""What a network is, read from its ONNX file and the sidecar beside it (DESIGN 11)."""

import hashlib
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from stsem.classes import ClassSet
from stsem.errors import NetworkError
from stsem.inference.backends import Port, Signature, read_signature
from stsem.inference.sidecar import Sidecar, parse
from stsem.uncertainty import MEASURES

SHIPPED = Path(__file__).parent / "networks"
DEFAULT = "default"
VARIANT_SUFFIX = ".int8.onnx"
"""`name.int8.onnx` beside `name.onnx` is the same network in int8 (stsem/inference/variant.py)."""
CLASS_COUNT = "stsem.class_count"
"""Metadata key in our ONNX files: the number of classes, since `labels` does not show it."""

CHANNELS = {"image": 3, "difference": 3, "depth": 1}
"""Inputs there can be: name -> channels; each (1, channels, H, W) float32."""

_FLOAT = ("tensor(float)",)
_WHOLE = ("tensor(uint8)", "tensor(int64)", "tensor(int32)")
"""Types of labels; the first is the one to have, the others are narrowed behind the graph."""
_ADOPT = "`stsem adopt` makes such a file fit"


class OutputKind(StrEnum):
    """What the graph returns."""

    LABELS = "labels"
    """`labels` (1, H, W) uint8 and `confidence` (1, H, W) float32."""
    LOGITS = "logits"
    """`logits` (1, C, h, w) float32; the argmax is taken outside."""


@dataclass(frozen=True)
class Network:
    """A network's description; nothing is loaded to run yet.

    Args:
        name: file name without suffix.
        path: the ONNX file.
        sidecar: size of the input, normalisation, classes, how difference and depth are formed.
        output: what the graph returns.
        model_sha256, sidecar_sha256: of the two files' bytes, hexadecimal.
        measures: maps of uncertainty that it also returns, of MEASURES; each (1, H, W) float32.
        precision: of the file's arithmetic: "f32", or "int8" for a variant.
    """

    name: str
    path: Path
    sidecar: Sidecar
    output: OutputKind
    model_sha256: str
    sidecar_sha256: str
    measures: tuple[str, ...] = ()
    precision: str = "f32"

    @property
    def sha256(self) -> str:
        """One fingerprint of both files: sha256 of the two sums in hexadecimal, model first."""
        return hashlib.sha256(f"{self.model_sha256}{self.sidecar_sha256}".encode()).hexdigest()

    @property
    def classes(self) -> ClassSet:
        """Classes in the order of the network's ids."""
        return self.sidecar.classes

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) of the input in pixels."""
        return self.sidecar.size

    @property
    def has_difference(self) -> bool:
        """Whether it also takes the image difference."""
        return self.sidecar.difference is not None

    @property
    def has_depth(self) -> bool:
        """Whether it also takes depth."""
        return self.sidecar.depth is not None


def shipped_networks() -> tuple[str, ...]:
    """Names of the networks inside the package."""
    return tuple(sorted(path.stem for path in SHIPPED.glob("*.onnx") if not _is_variant(path)))


def load_network(path_or_name: str | Path) -> Network:
    """Describe the network in an ONNX file, or the shipped one of that name ("default").

    Raises:
        NetworkError: no such file or name, no sidecar, a sidecar that cannot be, or a graph whose inputs, outputs,
            types, sizes or number of classes are not those of DESIGN 11.
    """
    path = _locate(path_or_name)
    beside = path.with_suffix(".toml")
    if not beside.is_file():
        raise NetworkError(
            f"The network {path} has no sidecar {beside.name} beside it; write one with size, mean, std and classes."
        )
    model, text = _read(path), _read(beside)
    try:
        sidecar = parse(text.decode(), str(beside))
    except UnicodeDecodeError as err:
        raise NetworkError(f"The sidecar {beside} is not UTF-8 text; save it as such.") from err
    signature = read_signature(path)
    _check_inputs(signature, sidecar, path)
    return Network(
        path.stem, path, sidecar, _output_kind(signature, sidecar, path),
        hashlib.sha256(model).hexdigest(), hashlib.sha256(text).hexdigest(), _measures(signature, sidecar, path),
    )  # fmt: skip


def _locate(path_or_name: str | Path) -> Path:
    given = Path(path_or_name)
    if _is_variant(given):
        plain = given.name.removesuffix(VARIANT_SUFFIX) + ".onnx"
        raise NetworkError(
            f"{given} is named as the int8 variant of {plain}; give {plain} with --precision int8, or rename it."
        )
    if given.suffix == ".onnx":
        if given.is_file():
            return given
        raise NetworkError(f"There is no network file {given}; give the path of an ONNX file.")
    if str(path_or_name) in shipped_networks():
        return SHIPPED / f"{path_or_name}.onnx"
    known = ", ".join((*shipped_networks(), "oracle"))
    if str(path_or_name) == "oracle":
        raise NetworkError("The oracle is the truth of a log and has no file; give a file ending in .onnx, or one of "
                           f"{', '.join(shipped_networks())}.")  # fmt: skip
    raise NetworkError(f"There is no network {str(path_or_name)!r}; give a file ending in .onnx, or one of {known}.")


def _is_variant(path: Path) -> bool:
    return path.name.endswith(VARIANT_SUFFIX)


def _read(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as err:
        raise NetworkError(f"{path} cannot be read: {err.strerror}.") from err


def _check_inputs(signature: Signature, sidecar: Sidecar, path: Path) -> None:
    wanted = set(sidecar.inputs)
    got = {port.name for port in signature.inputs}
    if got != wanted:
        raise NetworkError(
            f"The network {path} has the inputs {_listed(got)}, but its sidecar calls for {_listed(wanted)}; "
            f"the sections [difference] and [depth] stand for the inputs of these names, and {_ADOPT}."
        )
    width, height = sidecar.size
    for port in signature.inputs:
        _check_port(port, _FLOAT, (1, CHANNELS[port.name], height, width), path)


def _output_kind(signature: Signature, sidecar: Sidecar, path: Path) -> OutputKind:
    ports = {port.name: port for port in signature.outputs}
    width, height = sidecar.size
    stated = signature.metadata.get(CLASS_COUNT)
    if stated is not None and stated != str(len(sidecar.classes)):
        raise NetworkError(
            f"The network {path} tells {stated} classes apart, but its sidecar names {len(sidecar.classes)}."
        )
    if {"labels", "confidence"} <= ports.keys():
        _check_port(ports["labels"], _WHOLE, (1, height, width), path)
        _check_port(ports["confidence"], _FLOAT, (1, height, width), path)
        return OutputKind.LABELS
    if "logits" in ports:
        _check_port(ports["logits"], _FLOAT, (1, len(sidecar.classes), None, None), path)
        return OutputKind.LOGITS
    raise NetworkError(
        f"The network {path} has the outputs {_listed(ports)}; expected 'labels' and 'confidence', or 'logits'; "
        f"{_ADOPT}."
    )


def _measures(signature: Signature, sidecar: Sidecar, path: Path) -> tuple[str, ...]:
    ports = {port.name: port for port in signature.outputs}
    width, height = sidecar.size
    found = tuple(measure for measure in MEASURES if measure in ports)
    for measure in found:
        _check_port(ports[measure], _FLOAT, (1, height, width), path)
    return found


def _check_port(port: Port, types: tuple[str, ...], shape: tuple[int | None, ...], path: Path) -> None:
    """A side that either the file or we leave open fits anything."""
    fits = len(port.shape) == len(shape) and all(
        a is None or b is None or a == b for a, b in zip(port.shape, shape, strict=False)
    )
    if port.type not in types or not fits:
        raise NetworkError(
            f"The network {path} has {port.name!r} as {port.type} of shape {_shape(port.shape)}; "
            f"with its sidecar's size and classes, {types[0]} of shape {_shape(shape)} is expected; {_ADOPT}."
        )


def _shape(shape: tuple[int | None, ...]) -> str:
    return "(" + ", ".join("any" if side is None else str(side) for side in shape) + ")"


def _listed(names: "set[str] | dict[str, Port]") -> str:
    return ", ".join(repr(name) for name in sorted(names)) or "none"
