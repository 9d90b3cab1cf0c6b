"""A network that takes depth, replayed: what reaches it, what waits for it, what is said where there is none."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from stsem.log.log import open_log
from tests.made_up_walk import DELAYS_NS, write_walk

from .conftest import Cli, report, rows

onnx = pytest.importorskip("onnx", reason="the extra 'train' is not installed")

WIDTH, HEIGHT = 48, 32
SIDECAR = f"""size = [{WIDTH}, {HEIGHT}]
mean = [0.0, 0.0, 0.0]
std = [1.0, 1.0, 1.0]
classes = ["wall", "floor", "door"]

[depth]
unit = "metres"
"""


@pytest.fixture
def network(home: Path) -> Path:
    """A door where it is known to be 2 m away, a floor where depth is unknown; colour has no say."""
    from onnx import TensorProto, helper

    def constant(name: str, kind: int, shape: list[int], values: list[float]) -> onnx.NodeProto:
        return helper.make_node("Constant", [], [name], value=helper.make_tensor(name, kind, shape, values))

    nodes = [
        constant("slopes", TensorProto.FLOAT, [1, 3, 1, 1], [0, 0, 0.4]),
        constant("offsets", TensorProto.FLOAT, [1, 3, 1, 1], [0, 0.6, 0]),
        constant("nothing", TensorProto.FLOAT, [], [0]), constant("axes", TensorProto.INT64, [1], [1]),
        helper.make_node("Mul", ["image", "nothing"], ["black"]), helper.make_node("Mul", ["depth", "slopes"], ["far"]),
        helper.make_node("Add", ["black", "far"], ["scores"]), helper.make_node("Add", ["scores", "offsets"], ["all"]),
        helper.make_node("ArgMax", ["all"], ["ids"], axis=1, keepdims=0),
        helper.make_node("Cast", ["ids"], ["labels"], to=TensorProto.UINT8),
        helper.make_node("ReduceMax", ["all", "axes"], ["confidence"], keepdims=0),
    ]  # fmt: skip
    graph = helper.make_graph(
        nodes, "net",
        [helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, channels, HEIGHT, WIDTH])
         for name, channels in (("image", 3), ("depth", 1))],
        [helper.make_tensor_value_info("labels", TensorProto.UINT8, [1, HEIGHT, WIDTH]),
         helper.make_tensor_value_info("confidence", TensorProto.FLOAT, [1, HEIGHT, WIDTH])],
    )  # fmt: skip
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=9)
    (home / "net.onnx").write_bytes(model.SerializeToString())
    (home / "net.toml").write_text(SIDECAR)
    return home / "net.onnx"


@pytest.mark.parametrize("map_", ["on", "off"])
def test_depth_reaches_the_network(replay: Cli, network: Path, tmp_path: Path, map_: str) -> None:
    """Also where no map asks for it. The fourth frame has none: unknown all over, and it is said; the frames that have
    it arrive with it. A run that reads its answers back is the same."""
    log = write_walk(tmp_path / "log.mcap", frames=6, depth=lambda i: i != 3)
    arguments = (log, "--model", network, "--mode", "per-frame", "--map", map_, "--rate", "0.5")
    ran = replay(*arguments, "--out", "r")
    assert ran.code == 0
    assert "1 of 6 frames have no depth, which the network net.onnx takes" in ran.err
    assert "Inputs of the network net.onnx: image, depth." in ran.out
    document = report("r")
    assert document["identity"]["model_inputs"] == ["image", "depth"]
    (run,) = document["runs"]
    assert run["outcomes"]["segmented"] == 6
    with open_log([log]) as opened:
        truths = [opened.truth(index) for index in range(6)]
    expected = np.full((64, 96), 2)
    expected[:4] = 1  # the walk's depth is unknown there
    matrix = np.zeros((3, 3), np.int64)
    for index, truth in enumerate(truths):
        assert truth is not None
        answer, known = expected if index != 3 else np.ones_like(expected), truth != 255
        np.add.at(matrix, (truth[known], answer[known]), 1)
    assert run["offline"]["pixel_accuracy"] == pytest.approx(np.trace(matrix) / matrix.sum(), abs=1e-12)
    waits = {DELAYS_NS["depth" if index != 3 else "color"] for index in range(6)}
    arrivals = [int(row["arrival_ns"]) - int(row["stamp_ns"]) for row in rows("r")]
    assert set(arrivals) == waits
    assert arrivals.index(DELAYS_NS["color"]) == 3
    assert replay(*arguments, "--out", "again").code == 0
    assert report("again")["digest"] == document["digest"]


def test_a_log_without_depth_is_refused(replay: Cli, network: Path, tmp_path: Path) -> None:
    """Before anything is measured or computed."""
    log = write_walk(tmp_path / "log.mcap", frames=3, depth=None)
    ran = replay(log, "--model", network, "--out", "r")
    assert ran.code == 1
    assert "net takes depth, but log has no depth channel" in ran.sentence
    assert "--topic depth=TOPIC" in ran.sentence
    assert not Path("r").exists()


def test_costs_are_measured_with_depth(cli: Cli, network: Path, tiny_log: Path) -> None:
    """A profile for the network can be made on a log."""
    ran = cli("costs", "measure", tiny_log, "--out", "costs.json", "--model", network, "--samples", 1, "--seconds", 0.1)
    assert ran.code == 0
    assert "segment@2" in ran.out


@pytest.mark.parametrize(("depth", "said"), [
    (lambda i: True, "net would be given image, depth\n"),
    (lambda i: i != 3, "net would be given image, depth; 1 of 6 frames have no depth"),
    (None, "net would be given image, depth, but the log has no depth that can be used: a replay with it is refused"),
])  # fmt: skip
def test_inspect_says_what_the_network_would_be_given(
    cli: Cli, network: Path, tmp_path: Path, depth: Callable[[int], bool] | None, said: str
) -> None:
    """In the text, the JSON, and the command to replay."""
    log = write_walk(tmp_path / "log.mcap", frames=6, depth=depth)
    ran = cli("inspect", log, "--model", "net.onnx")
    assert ran.code == 0
    assert f"Network: {said}" in ran.out
    assert ran.out.strip().endswith("--model net.onnx")
    given = json.loads(cli("inspect", log, "--model", "net.onnx", "--json").out)["network"]
    assert given == {"name": "net", "inputs": ["image", "depth"]}
    assert "Network:" not in cli("inspect", log).out
