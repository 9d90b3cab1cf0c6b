"""`stsem export`, as typed."""

import errno
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnxruntime
import pytest

pytest.importorskip("torch", reason="the extra 'train' is not installed")
pytest.importorskip("onnx", reason="the extra 'train' is not installed")

from stsem.classes import ClassSet
from stsem.frame import Frame
from stsem.inference import placing
from stsem.inference.inferencer import Inferencer
from stsem.inference.network import load_network
from stsem.inference.sidecar import DepthForm, Difference, Sidecar, render
from stsem.models.export import Agreement
from stsem.models.zoo import ZOO, build
from stsem.train import publish

from .conftest import Cli

pytestmark = pytest.mark.torch
SIDECAR = Sidecar((89, 41), (0.5,) * 3, (0.25,) * 3, ClassSet(("dark", "red", "green")), Difference(4.0))


@pytest.fixture
def sidecar(tmp_path: Path) -> Path:
    path = tmp_path / "like.toml"
    path.write_text(render(SIDECAR), encoding="utf-8")
    return path


def test_a_network_with_uncertainty(cli: Cli, sidecar: Path, tmp_path: Path) -> None:
    """The temporal network does not look at the image, yet takes it as every network does; the maps come along."""
    out = tmp_path / "net.onnx"
    arguments = ("--sidecar", sidecar, "--architecture", "pspnet-r18-temporal-w1", "--uncertainty", "3")
    ran = cli("export", out, *arguments)
    assert (ran.code, ran.err) == (0, "")
    assert "3 classes, 89x41" in ran.out
    frame = Frame(0, 0, np.random.default_rng(0).integers(0, 256, (41, 89, 3), np.uint8))
    assert Inferencer(load_network(out), threads=1).infer(frame).labels.shape == (41, 89)
    outputs = onnxruntime.InferenceSession(str(out), providers=["CPUExecutionProvider"]).get_outputs()
    assert [port.name for port in outputs] == ["labels", "confidence", "variance", "entropy", "mutual_information"]
    assert all(port.shape == [1, 41, 89] for port in outputs)


def test_the_sidecar_follows_the_inputs(cli: Cli, sidecar: Path, tmp_path: Path) -> None:
    """A network with depth and without difference, from a sidecar that has it the other way round; nothing is said but
    what was done. How a difference was scaled nobody can guess."""
    out = tmp_path / "net.onnx"
    ran = cli("export", out, "--sidecar", sidecar, "--architecture", "fusenet-w1")
    assert (ran.code, ran.err) == (0, "")
    assert "Inputs:  image, depth\n" in ran.out
    network = load_network(out)
    assert network.sidecar == replace(SIDECAR, difference=None, depth=DepthForm())
    sidecar.write_text(render(network.sidecar), encoding="utf-8")
    ran = cli("export", tmp_path / "other.onnx", "--sidecar", sidecar, "--architecture", "pspnet-r18-sum-w1")
    assert ran.code == 1
    assert "its sidecar has no section [difference]" in ran.sentence
    assert not (tmp_path / "other.onnx").exists()


def test_a_failed_export_leaves_what_was_there(
    cli: Cli, sidecar: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whether the graph disagrees with torch or the disk fills up on the way; then both files are replaced."""
    folder = tmp_path / "nets"
    folder.mkdir()
    out, beside = folder / "net.onnx", folder / "net.toml"
    out.write_bytes(b"a good network")
    beside.write_text("# its sidecar")
    arguments = ("export", out, "--sidecar", sidecar, "--architecture", "fcn-32s-w1")
    with monkeypatch.context() as patch:
        patch.setattr(publish, "agreement", lambda *_: Agreement(0.5, 0.1))
        ran = cli(*arguments)
        assert (ran.code, ran.err.count("\n")) == (1, 1)
        assert "does not answer as torch does: equal are 50.0000% of the labels" in ran.err
        patch.setattr(placing, "render", _full_disk)
        ran = cli(*arguments)
        assert ran.err == f"stsem: The network cannot be written to {out}: No space left on device.\n"
    assert (out.read_bytes(), beside.read_text()) == (b"a good network", "# its sidecar")
    assert sorted(folder.iterdir()) == [out, beside]
    assert cli(*arguments).code == 0
    assert load_network(out).classes == SIDECAR.classes
    assert sorted(folder.iterdir()) == [out, beside]


def _full_disk(_: object) -> str:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_a_sidecar_of_the_users_own_stays(cli: Cli, tmp_path: Path) -> None:
    """With its comments, when it is the network's own and says what would be written."""
    own, text = tmp_path / "net.toml", "# mine\n" + render(replace(SIDECAR, difference=None))
    own.write_text(text, encoding="utf-8")
    ran = cli("export", tmp_path / "net.onnx", "--sidecar", own, "--architecture", "segnet-basic-w1")
    assert (ran.code, own.read_text(encoding="utf-8")) == (0, text)


def test_weights_from_elsewhere(cli: Cli, sidecar: Path, tmp_path: Path) -> None:
    """What was taken, and what was not."""
    weights, out = tmp_path / "colour.pt", tmp_path / "net.onnx"
    arguments = ("--architecture", "pspnet-r18-spatial-w1", "--weights", weights, "--sidecar", sidecar)
    weights.write_text("no weights")
    assert "it is text; give what torch.save" in cli("export", out, *arguments).sentence
    torch = pytest.importorskip("torch")
    torch.manual_seed(0)
    state = build("pspnet-r18-spatial-w1", 3).state_dict()
    del state["colour.head.4.bias"]
    torch.save({"state_dict": {f"module.{name}": value for name, value in state.items()}}, weights)
    ran = cli("export", out, *arguments)
    assert (ran.code, ran.err) == (0, "")
    lines = [line.strip() for line in ran.out.splitlines()]
    assert lines[0] == "Weights: 143 of 144 taken (stsem)"
    assert lines[1] == "1 not in the file, unchanged: colour.head.4.bias"
    assert "train the network before you judge it" in lines[2]


def test_the_list() -> None:
    """Every name, and sizes that are published; for it, torch is not even loaded."""
    code = (
        "import sys; from stsem.cli import main\nsys.argv = ['stsem', 'export', '--list']\n"
        "try: main.stsem()\nexcept SystemExit as end: assert end.code == 0\nassert 'torch' not in sys.modules"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    lines = {line.split("|")[1].strip(): line for line in ran.stdout.splitlines()}
    assert ZOO.keys() <= lines.keys()
    assert "46.7" in lines["pspnet-r50-spatial"]


@pytest.mark.parametrize(("arguments", "sentence"), [
    ((), "takes OUT.onnx, --sidecar, and either"),
    (("net.onnx", "--sidecar", "like.toml"), "takes OUT.onnx, --sidecar, and either"),
    (("net.pt", "--sidecar", "like.toml", "--architecture", "pspnet-r18"), "must end in .onnx"),
    (("net.onnx", "--sidecar", "like.toml", "--checkpoint", "a.pt", "--weights", "b.pt"), "--weights needs --arch"),
    (("net.onnx", "--sidecar", "none.toml", "--architecture", "pspnet-r18"), "none.toml cannot be read"),
    (("net.onnx", "--sidecar", "like.toml", "--architecture", "pspnet"), "no architecture 'pspnet'"),
    (("net.onnx", "--sidecar", "like.toml", "--architecture", "pspnet-r18-w1", "--uncertainty", "1"), "2 or more"),
])  # fmt: skip
def test_what_cannot_be_exported(
    cli: Cli, sidecar: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], sentence: str
) -> None:
    """One sentence."""
    monkeypatch.chdir(sidecar.parent)
    ran = cli("export", *arguments)
    assert ran.code != 0
    assert sentence in ran.sentence
