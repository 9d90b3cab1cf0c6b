"""A file of weights as torch saves it -> tensors by name. Nothing in the file is ever run."""

import pickle  # noqa: TID251 - only the name of its error: nothing is unpickled here
import re
import struct
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path

import torch
from torch import Tensor

from stsem.errors import NetworkError

Weights = dict[str, Tensor]

_CONTAINERS = ("mean", "state_dict", "model_state_dict", "model", "network", "net")
"""Keys under which a checkpoint keeps its weights; `mean` is the running mean of our own trainings."""
_WRAPPED = re.compile(r"^(?:(?:module|_orig_mod|model|net)\.)+")
"""What DataParallel, AveragedModel, torch.compile and Lightning put before each name."""
_COUNTERS = ("n_averaged",)

_FAILURES = (
    OSError, RuntimeError, EOFError, ValueError, LookupError, TypeError, AttributeError, AssertionError,
    ArithmeticError, MemoryError, ImportError, struct.error, pickle.UnpicklingError, zipfile.BadZipFile,
)  # fmt: skip
"""What torch makes of bytes that are no weights."""
_FOREIGN: tuple[tuple[Callable[[Path, bytes], bool], str], ...] = (
    (lambda path, head: path.suffix == ".onnx", "an ONNX network, which stsem-replay takes with --model"),
    (lambda path, head: head.startswith(b"\x89HDF"), "an HDF5 file, as Keras writes it"),
    (lambda path, head: path.suffix in {".pb", ".tflite", ".index", ".meta"} or ".data-0" in path.name,
     "a TensorFlow file"),
    (lambda path, head: path.suffix == ".caffemodel", "a Caffe model"),
    (lambda path, head: head[8:9] == b"{" or path.suffix == ".safetensors", "a safetensors file"),
    (lambda path, head: not head, "empty"),
    (lambda path, head: _is_text(head), "text"),
)  # fmt: skip
_SAVE = "give what torch.save(network.state_dict(), FILE) writes"
_RESAVE = "if you trust it, save its weights alone: torch.save(torch.load(FILE, weights_only=False)['state_dict'], NEW)"


def read_weights(path: Path) -> Weights:
    """Tensors by name: a state dict, or a checkpoint that holds one, in torch's zip format or its older one.

    Names lose what wrappers put before them (`module.`). Tensors are on the CPU.

    Raises:
        NetworkError: the file is missing, damaged, of another kind, or holds objects that are no tensors.
    """
    try:
        with path.open("rb") as file:
            head = file.read(4096)
    except OSError as err:
        raise NetworkError(f"The weights {path} cannot be read: {err.strerror}; {_SAVE}.") from err
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # torch deprecates parts of its own older format
            loaded = torch.load(path, map_location="cpu", weights_only=True)
    except _FAILURES as err:
        raise NetworkError(f"The weights {path} cannot be read: {_reason(path, head, err)}.") from err
    found = _tensors(loaded)
    if not found:
        raise NetworkError(f"The file {path} holds no weights by name, but {_described(loaded)}; {_SAVE}.")
    return found


def _tensors(loaded: object) -> Weights:
    """The tensors of a state dict, or of the first container in which there are any."""
    if not isinstance(loaded, dict):
        return {}
    for key in _CONTAINERS:
        inside = _tensors(loaded.get(key))
        if inside:
            return inside
    return {
        _WRAPPED.sub("", key): value for key, value in loaded.items()
        if isinstance(key, str) and isinstance(value, Tensor) and key not in _COUNTERS
    }  # fmt: skip


def _described(loaded: object) -> str:
    if not isinstance(loaded, dict):
        return f"a {type(loaded).__name__}"
    return f"the keys {', '.join(map(repr, list(loaded)[:5]))}" if loaded else "an empty table"


def _reason(path: Path, head: bytes, err: BaseException) -> str:
    """Why torch could not read the file, and what to do."""
    for is_it, what in _FOREIGN:
        if is_it(path, head):
            return f"it is {what}; {_SAVE}"
    names = _zipped(path)
    if names:
        if not any(name.endswith("data.pkl") for name in names):
            return f"it is a zip archive without weights; {_SAVE}"
        if any(name.endswith("constants.pkl") for name in names):
            return f"it is a TorchScript program; {_SAVE}"
    called = _CALLED.search(str(err))
    if called and not called[1].startswith("torch._"):  # a name of torch's own that was cut short
        return f"it holds Python objects ({called[1]}) beside tensors, and only tensors are read; {_RESAVE}"
    return f"it is damaged, or no file of torch; {_SAVE}"


_CALLED = re.compile(r"(?:GLOBAL|global|instantiate|class) [`']?([\w.]+\.\w+)")


def _zipped(path: Path) -> list[str]:
    """Names in a zip archive; none where it is no whole one."""
    try:
        with zipfile.ZipFile(path) as archive:
            return archive.namelist()
    except (OSError, zipfile.BadZipFile, ValueError, NotImplementedError):
        return []


def _is_text(head: bytes) -> bool:
    """Printable ASCII all over; a pickle of protocol 0, which is that too, is told by its first bytes."""
    return _PICKLED.match(head) is None and not head.translate(None, _PRINTABLE)


_PICKLED = re.compile(rb"\(|c[\w.]+\n[\w.]+\n")
_PRINTABLE = bytes(range(32, 127)) + b"\t\n\r"
