"""Files that hold no weights: one sentence each, and nothing in them is run."""

import json
import os
import pickle
import warnings
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

torch = pytest.importorskip("torch", reason="the extra 'train' is not installed")

from stsem.errors import NetworkError
from stsem.models.checkpoint import load_weights
from stsem.models.zoo import build

pytestmark = pytest.mark.torch
CLASSES = 5


class Hostile:
    """Would leave a file behind if it were unpickled."""

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, ("was-run",)


def _torch(thing: object, zipped: bool = True) -> Callable[[Path], None]:
    return lambda path: torch.save(thing, path, _use_new_zipfile_serialization=zipped)


def _bytes(data: bytes) -> Callable[[Path], object]:
    return lambda path: path.write_bytes(data)


def _cut(keep: float, zipped: bool) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        torch.save({"state_dict": {"x": torch.zeros(999)}}, path, _use_new_zipfile_serialization=zipped)
        data = path.read_bytes()
        path.write_bytes(data[: int(len(data) * keep)])

    return write


def _zip(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.txt", "x")


def _many_disks(path: Path) -> None:
    """zipfile itself raises an error of its own here."""
    _zip(path)
    end, locator = path.read_bytes(), b"PK\x06\x07" + bytes(4 + 8) + b"\x02\x00\x00\x00"
    at = end.index(b"PK\x05\x06")
    path.write_bytes(end[:at] + locator + end[at:])


def _script(path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        torch.jit.script(torch.nn.Conv2d(1, 1, 1)).save(str(path))


_HEADER = json.dumps({"a": 1}).encode()
FILES: dict[str, tuple[str, Callable[[Path], object], str]] = {
    "text": ("a.pth", _bytes(b"conv1.weight = 0\n" * 9), "it is text"),
    "empty": ("a.pth", _bytes(b""), "it is empty"),
    "noise": ("a.pth", _bytes(bytes(range(255, 0, -1)) * 9), "it is damaged, or no file of torch"),
    "folder": ("a.pth", Path.mkdir, "Is a directory"),
    "missing": ("a.pth", lambda path: None, "No such file"),
    "cut": ("a.pth", _cut(0.5, True), "it is damaged"),
    "a little cut": ("a.pth", _cut(0.99, True), "it is damaged"),
    "cut old format": ("a.pth", _cut(0.5, False), "it is damaged"),
    "pickle": ("a.pkl", _bytes(pickle.dumps(Hostile())), "it is damaged, or no file of torch"),
    "old pickle": ("a.pkl", _bytes(pickle.dumps(Hostile(), protocol=0)), "posix.mkdir) beside tensors"),
    "code": ("a.pth", _torch({"x": Hostile(), "state_dict": {"conv1.weight": torch.zeros(2)}}), "posix.mkdir) beside"),
    "code, old format": ("a.pth", _torch([Hostile()], zipped=False), "it holds Python objects (posix.mkdir)"),
    "module": ("a.pth", _torch(torch.nn.Linear(2, 2)), "(torch.nn.modules.linear.Linear) beside"),
    "list": ("a.pth", _torch([torch.zeros(2)]), "holds no weights by name, but a list"),
    "nothing": ("a.pth", _torch({}), "an empty table"),
    "numbers": ("a.pth", _torch({"epoch": 3, "state_dict": {"a": 1}}), "the keys 'epoch', 'state_dict'"),
    "zip of many disks": ("a.pth", _many_disks, "it is damaged"),
    "zip": ("a.pth", _zip, "it is a zip archive without weights"),
    "program": ("a.pt", _script, "it is a TorchScript program"),
    "onnx": ("a.onnx", _bytes(b"\x08\x08\x12\x07pytorch"), "an ONNX network"),
    "keras": ("a.h5", _bytes(b"\x89HDF\r\n\x1a\n" + bytes(99)), "HDF5"),
    "tensorflow": ("model.ckpt.data-00000-of-00001", _bytes(bytes(99)), "a TensorFlow file"),
    "caffe": ("a.caffemodel", _bytes(b"\x0a\x04pspn" + bytes(99)), "a Caffe model"),
    "safetensors": ("a.pth", _bytes(len(_HEADER).to_bytes(8, "little") + _HEADER), "a safetensors file"),
}  # fmt: skip


@pytest.mark.parametrize("case", FILES)
def test_files_that_hold_no_weights(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, case: str) -> None:
    """One sentence that says what it is and what to do; no code of the file is run."""
    monkeypatch.chdir(tmp_path)
    name, write, sentence = FILES[case]
    write(tmp_path / name)
    with pytest.raises(NetworkError) as caught:
        load_weights(build("pspnet-r18-spatial-w1", CLASSES), tmp_path / name)
    assert sentence in str(caught.value)
    assert "torch.save(" in str(caught.value)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "was-run").exists()
