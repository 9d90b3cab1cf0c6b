"""Files named on the command line that are not what they should be: one clear sentence each."""

import struct
from pathlib import Path

import pytest

from tests.made_up_walk import write_walk

from .conftest import Cli
from .test_bad_input import no_report


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("c.json", "{", ["c.json", "JSON"]),
        ("c.json", '["wall", "Wall"]', ["c.json", "same name"]),
        ("c.toml", "0 = ", ["c.toml", "TOML"]),
        ("c.json", "17", ["c.json", "names"]),
    ],
)  # fmt: skip
def test_broken_class_table(replay: Cli, home: Path, tiny_log: Path, name: str, text: str, words: list[str]) -> None:
    """--classes with something that is no class table."""
    (home / name).write_text(text)
    ran = replay(tiny_log, "--classes", name)
    assert ran.code == 1
    assert all(word in ran.sentence for word in words), ran.sentence


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("nonsense = 'wall'\n", ["nonsense", "class map"]),
        ("wall = 'nonsense'\n", ["nonsense", "class map"]),
        ("wall = 3\n", ["wall", "class map"]),
        ("wall = \n", ["map.toml", "TOML"]),
    ],
)
def test_class_map(replay: Cli, home: Path, tiny_log: Path, text: str, words: list[str]) -> None:
    """A class map must name classes that exist."""
    (home / "map.toml").write_text(text)
    ran = replay(tiny_log, "--class-map", "map.toml")
    assert ran.code == 1
    assert all(word in ran.sentence for word in words), ran.sentence


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("garbage", ["costs.json", "not JSON"]),
        ("[]", ["costs.json", "schema"]),
        ('{"schema": "stsem-costs/2"}', ["costs.json", "stsem-costs/1", "stsem-costs/2"]),
        ('{"schema": "stsem-costs/1", "machine": "m", "samples_ns": {"segment": [1]}}', ["stage@cores", "segment"]),
        ('{"schema": "stsem-costs/1", "machine": "m", "samples_ns": {"segment@2": [0]}}', ["segment@2"]),
        ('{"schema": "stsem-costs/1", "machine": "m", "samples_ns": {"register@1": [1]}}', ["segment@2", "measure"]),
        ('{"otherData": {"schema": "stsem-trace/1"}, "traceEvents": [{}]}', ["costs.json", "damaged"]),
        ('{"otherData": {"schema": "stsem-trace/1"}, "traceEvents": []}', ["per-frame", "trace"]),
    ],
    ids=["garbage", "list", "schema", "key", "zero", "stage missing", "trace damaged", "trace empty"],
)
def test_costs(replay: Cli, home: Path, tiny_log: Path, text: str, words: list[str]) -> None:
    """A profile that is none, or lacks what this run needs."""
    (home / "costs.json").write_text(text)
    ran = replay(tiny_log, "--model", "oracle", "--costs", "costs.json")
    assert ran.code == 1
    assert all(word in ran.sentence for word in words), ran.sentence
    assert no_report(home)


def test_binary_costs(replay: Cli, home: Path, tiny_log: Path) -> None:
    """A file that is not even text."""
    (home / "costs.json").write_bytes(struct.pack("<8d", *range(8)) + b"\xff\xfe")
    ran = replay(tiny_log, "--costs", "costs.json")
    assert ran.code == 1
    assert "costs.json" in ran.sentence


def test_oracle_without_truth(replay: Cli, home: Path) -> None:
    """The oracle says what it lacks: a channel, a table, or a labelled frame."""
    for name, options, word in (
        ("none.mcap", {"truth": None}, "no label channel"), ("table.mcap", {"names": None}, "no class table"),
    ):  # fmt: skip
        ran = replay(write_walk(home / name, frames=3, **options), "--model", "oracle")  # type: ignore[arg-type]
        assert ran.code == 1
        assert word in ran.sentence
        assert "--model" in ran.sentence


def test_networks(replay: Cli, home: Path, tiny_log: Path) -> None:
    """An ONNX file without a sidecar, one that is no ONNX, and one with other inputs."""
    shipped = Path(__file__).parents[2] / "stsem" / "inference" / "networks"
    sidecar = next(iter(sorted(shipped.glob("*.toml")))).read_text()
    (home / "net.onnx").write_bytes(b"not a network")
    assert "sidecar" in replay(tiny_log, "--model", "net.onnx").sentence
    (home / "net.toml").write_text(sidecar)
    ran = replay(tiny_log, "--model", "net.onnx")
    assert (ran.code, "net.onnx" in ran.sentence) == (1, True)
    (home / "net.toml").write_text(sidecar.replace("classes", "clases", 1))
    assert "did you mean 'classes'?" in replay(tiny_log, "--model", "net.onnx").sentence


def test_other_inputs(replay: Cli, home: Path, tiny_log: Path) -> None:
    """The names of the inputs that came and that were expected."""
    from onnx import TensorProto, helper

    shape = [1, 3, 8, 8]
    port = helper.make_tensor_value_info("pixels", TensorProto.FLOAT, shape)
    out = helper.make_tensor_value_info("logits", TensorProto.FLOAT, shape)
    graph = helper.make_graph([helper.make_node("Relu", ["pixels"], ["logits"])], "net", [port], [out])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
    (home / "net.onnx").write_bytes(model.SerializeToString())
    (home / "net.toml").write_text("size=[8,8]\nmean=[0,0,0]\nstd=[1,1,1]\nclasses=['wall','floor','door']\n")
    ran = replay(tiny_log, "--model", "net.onnx")
    assert ran.code == 1
    assert all(word in ran.sentence for word in ("net.onnx", "'pixels'", "'image'")), ran.sentence
