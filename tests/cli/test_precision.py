"""`--backend`, `--precision` and `stsem quantize`, as typed."""

import importlib.util
from pathlib import Path

import pytest

from stsem.inference.backends import BACKENDS
from tests.made_up_network import write_network

from .conftest import Cli, report

TINY = Path(__file__).resolve().parents[2] / "logs" / "tiny-a.mcap"
OFFLINE = ("--clock", "offline", "--no-plots", "--map", "off", "--mode", "per-frame")
OPENVINO = importlib.util.find_spec("openvino") is not None


@pytest.fixture
def network(cli: Cli, home: Path) -> Path:
    """A small network and its variant, made by the command."""
    path = write_network(home / "net.onnx")
    ran = cli("quantize", path, "--log", TINY, "--frames", "6")
    assert (ran.code, ran.err) == (0, "")
    assert "Variant: " in ran.out
    assert "from 6 frames" in ran.out
    assert "--precision int8" in ran.out
    return path


@pytest.mark.parametrize(
    ("backend", "precision"), [(name, precision) for name, row in BACKENDS.items() for precision in row.precisions]
)
def test_a_replay_by_every_backend_in_every_precision(
    replay: Cli, cli: Cli, network: Path, backend: str, precision: str
) -> None:
    """Twice the same bytes; the report says what computed, a gate against the reference says so in its first line."""
    if backend == "openvino" and not OPENVINO:
        pytest.skip("the extra 'openvino' is not installed")
    ran = replay(TINY, "--model", network, "--backend", backend, "--precision", precision, *OFFLINE,
                 "--out", "a", "--repeat", "2")  # fmt: skip
    if precision == "bf16" and ran.code == 2:
        assert "does not compute in bf16" in ran.sentence
        return
    assert (ran.code, ran.err) == (0, "")
    identity = report("a")["identity"]
    assert (identity["backend"], identity["precision"], identity["model"]) == (backend, precision, "net.onnx")
    assert {"onnxruntime", backend} <= identity["versions"].keys()
    assert ("openvino" in identity["versions"]) == (backend == "openvino")
    assert (f"It ran in {precision} by {backend}." in ran.out) == (precision != "f32")
    if (backend, precision) == ("onnxruntime", "f32"):
        return
    assert replay(TINY, "--model", network, *OFFLINE, "--out", "reference").code == 0
    ref, got = (report(folder)["runs"][0]["offline"]["pixel_accuracy"] for folder in ("reference", "a"))
    assert got == pytest.approx(ref, abs=0.01)
    gated = cli("gate", "a", "--baseline", "reference", "--no-timing", "--limit", "offline.miou=5")
    said = f"The report is in {precision} by {backend}, the baseline in f32 by onnxruntime."
    assert said in gated.out.splitlines()[0]
    if precision == "int8":
        assert report("reference")["identity"]["model_sha256"] != identity["model_sha256"]
        assert "model file" in gated.out


def test_costs_of_another_precision_are_named(replay: Cli, cli: Cli, network: Path) -> None:
    """A profile of f32 under a network in int8 is a mixture that the report must own up to."""
    measured = cli(
        "costs", "measure", TINY, "--model", network, "--samples", "2", "--seconds", "0.1", "--out", "f32.json"
    )
    assert measured.code == 0
    arguments = (TINY, "--model", network, "--costs", "f32.json", "--no-plots", "--map", "off", "--mode", "per-frame")
    assert "cost profile was measured with" not in replay(*arguments, "--out", "a").err
    ran = replay(*arguments, "--precision", "int8", "--out", "b")
    assert ran.code == 0
    said = "The cost profile was measured with onnxruntime f32, but the network ran with onnxruntime int8"
    assert said in ran.err
    assert said in " ".join(report("b")["warnings"])


def test_int8_without_a_variant(replay: Cli, home: Path) -> None:
    """One sentence that names the command; nothing is written."""
    network = write_network(home / "net.onnx")
    ran = replay(TINY, "--model", network, "--precision", "int8", *OFFLINE, "--out", "a")
    assert ran.code == 1
    assert f"stsem quantize {network} --log LOG" in ran.sentence
    assert not Path("a").exists()


def test_quantize_refuses(cli: Cli, home: Path) -> None:
    network = write_network(home / "net.onnx", depth=True)
    for arguments, code, words in (
        (("none.onnx", "--log", TINY), 1, "no network file none.onnx"),
        ((network,), 2, "--log"),
        ((network, "--log", "none.mcap"), 1, "none.mcap"),
        ((network, "--log", TINY, "--log", TINY), 2, "given twice"),
        ((network, "--log", TINY, "--frames", "1"), 2, "--frames"),
    ):
        ran = cli("quantize", *arguments)
        assert (ran.code, words in ran.sentence) == (code, True), ran.err
    assert sorted(path.name for path in home.iterdir()) == ["net.onnx", "net.toml"]
