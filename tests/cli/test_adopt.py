"""`stsem adopt`, as typed; what it makes of graphs is in tests/models/test_adopt.py."""

from pathlib import Path

import pytest

pytest.importorskip("onnx", reason="the extra 'train' is not installed")
pytest.importorskip("torch", reason="the extra 'train' is not installed")

from onnx import TensorProto, helper

from stsem.errors import NetworkError
from stsem.inference.network import load_network

from .conftest import Cli

pytestmark = pytest.mark.torch
SIDECAR = """# mine
size = [16, 12]
mean = [0.0, 0.0, 0.0]
std = [1.0, 1.0, 1.0]
classes = ["red", "green", "blue"]
"""


@pytest.fixture
def theirs(home: Path) -> Path:
    """Three scores, the channels themselves, in half precision; and two more outputs."""
    kind = TensorProto.FLOAT16
    nodes = [helper.make_node("Relu", ["pixels"], [name]) for name in ("out", "aux")]
    graph = helper.make_graph(
        nodes, "net", [helper.make_tensor_value_info("pixels", kind, ["batch", 3, "h", "w"])],
        [helper.make_tensor_value_info(name, kind, None) for name in ("out", "aux")],
    )  # fmt: skip
    path = home / "theirs.onnx"
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    path.write_bytes(model.SerializeToString())
    (home / "mine.toml").write_text(SIDECAR)
    return path


def test_a_network_is_adopted(cli: Cli, theirs: Path) -> None:
    """It loads as any network; a sidecar beside it is left as it was written, another one is copied."""
    ran = cli("adopt", theirs, "mine.onnx", "--sidecar", "mine.toml", "--output", "out")
    assert (ran.code, ran.err) == (0, "")
    assert "image as 'pixels', float16 (1, 3, 12, 16)" in ran.out
    assert "3 classes, 16x12" in ran.out
    assert load_network("mine.onnx").sidecar.classes.names == ("red", "green", "blue")
    assert Path("mine.toml").read_text() == SIDECAR
    assert cli("adopt", theirs, "copy.onnx", "--sidecar", "mine.toml", "--output", "out").code == 0
    assert load_network("copy.onnx").sidecar == load_network("mine.onnx").sidecar


@pytest.mark.parametrize(("arguments", "code", "sentence"), [
    (("mine.onnx", "--sidecar", "mine.toml"), 1, "several outputs: 'out', 'aux'; choose one with --output NAME"),
    (("mine.onnx", "--sidecar", "mine.toml", "--output", "x"), 1, "no output 'x': 'out', 'aux'"),
    (("mine.onnx", "--sidecar", "none.toml"), 1, "none.toml cannot be read"),
    (("mine.onnx", "--sidecar", "mine.toml", "--output", "out", "--input", "image=a"), 1, "no input 'a' for the image"),
    (("mine.onnx", "--sidecar", "mine.toml", "--layout", "hwc"), 2, "no layout 'hwc'; choose nchw"),
    (("mine.pt", "--sidecar", "mine.toml"), 2, "must end in .onnx and be another one"),
    (("theirs.onnx", "--sidecar", "mine.toml"), 2, "must end in .onnx and be another one"),
    (("no/mine.onnx", "--sidecar", "mine.toml", "--output", "out"), 1, "cannot be written to no/mine.onnx"),
])  # fmt: skip
def test_what_cannot_be(cli: Cli, theirs: Path, arguments: tuple[str, ...], code: int, sentence: str) -> None:
    """One sentence."""
    ran = cli("adopt", theirs, *arguments)
    assert ran.code == code
    assert sentence in ran.sentence


def test_what_was_there_stays_until_the_new_one_is_checked(
    cli: Cli, theirs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where the adopted network turns out not to load."""

    def refuse(path: Path) -> None:
        raise NetworkError("It does not load.")

    Path("old.onnx").write_bytes(b"old")
    Path("old.toml").write_text("# old")
    monkeypatch.setattr("stsem.inference.network.load_network", refuse)
    ran = cli("adopt", theirs, "old.onnx", "--sidecar", "mine.toml", "--output", "out")
    assert (ran.code, ran.sentence) == (1, "It does not load.")
    assert (Path("old.onnx").read_bytes(), Path("old.toml").read_text()) == (b"old", "# old")
    assert sorted(path.name for path in Path().iterdir()) == ["mine.toml", "old.onnx", "old.toml", "theirs.onnx"]


def test_a_replay_points_to_it(cli: Cli, theirs: Path, tiny_log: Path) -> None:
    """A file as it came from elsewhere is refused in a sentence that says what helps."""
    theirs.with_suffix(".toml").write_text(SIDECAR)
    assert (
        "`stsem adopt` makes such a file fit"
        in cli("replay", tiny_log, "--model", theirs, "--clock", "offline").sentence
    )
