"""inspect, cache, costs and gate, as typed."""

import json
from pathlib import Path

import pytest

from stsem.replay import calibrate
from stsem.sim.profile import load_profile

from .conftest import Cli, report


def test_inspect(cli: Cli, tiny_log: Path, home: Path) -> None:
    """Tables for people, JSON for programs; a cut file is inspected as far as it goes."""
    ran = cli("inspect", tiny_log)
    assert (ran.code, ran.err) == (0, "")
    assert all(word in ran.out for word in ("/camera/color", "RawImage", "96x64", "wall", "10.00"))
    found = json.loads(cli("inspect", tiny_log, "--json").out)
    assert found["used"]["color"] == "/camera/color"
    (home / "cut.mcap").write_bytes(tiny_log.read_bytes()[:-5000])
    ran = cli("inspect", "cut.mcap")
    assert ran.code == 3
    assert "truncated" in ran.out


def test_cache(replay: Cli, cli: Cli, tiny_log: Path, tmp_path: Path) -> None:
    """What a run keeps is shown and cleared."""
    assert "0 files" in cli("cache", "show").out
    assert replay(tiny_log, "--end", "0.2", "--mode", "per-frame").code == 0
    assert f"{tmp_path / 'cache'}: 3 files" in cli("cache", "show").out  # two frames and what they stand for
    assert "Removed 3 files" in cli("cache", "clear").out
    assert "0 files" in cli("cache", "show").out


def test_auto_costs(cli: Cli, home: Path, tiny_log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Measured once on this machine, kept, and used again: two runs, one digest."""
    monkeypatch.setattr(calibrate, "_BATCH_NS", 10**6)
    monkeypatch.setattr(calibrate, "_OTHER_WORK", 1e9)
    for name, said in (("a", True), ("b", False)):
        ran = cli("replay", tiny_log, "--model", "oracle", "--end", "0.5", "--no-plots", "--out", name)
        assert ran.code == 0
        assert ("Measuring what the stages cost" in ran.err) == said
    first, second = report("a"), report("b")
    assert first["digest"] == second["digest"]
    assert first["identity"]["costs"] == "auto"
    assert first["identity"]["costs_disturbed"] is False


def test_costs_measure_and_scale(cli: Cli, home: Path, tiny_log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A profile for use elsewhere, ten times slower; it runs every mode on one core and on two."""
    monkeypatch.setattr(calibrate, "_BATCH_NS", 10**6)
    monkeypatch.setattr(calibrate, "_OTHER_WORK", 1e9)
    ran = cli("costs", "measure", tiny_log, "--out", "here.json", "--samples", "3", "--seconds", "5")
    assert ran.code == 0
    here = load_profile(home / "here.json")
    stages = {"segment@1", "segment@2", "register@1", "propagate@1", "decode@1", "fuse@1", "track@1"}
    assert set(here.samples_ns) == stages
    assert all(len(samples) <= 3 for samples in here.samples_ns.values())
    assert cli("costs", "scale", "here.json", "--out", "slow.json", "--by", "10", "--by", "fuse=1/2").code == 0
    slow = load_profile(home / "slow.json")
    assert slow.samples("segment", 2)[0] == 10 * here.samples("segment", 2)[0]
    assert slow.samples("fuse", 1)[0] == pytest.approx(here.samples("fuse", 1)[0] / 2, abs=1)
    for cores in (1, 2):
        ran = cli(
            "replay", tiny_log, "--model", "oracle", "--costs", "slow.json", "--cores", cores, "--count-decode",
            "--no-plots",
        )  # fmt: skip
        assert ran.code == 0


def test_measured_costs_are_a_look(cli: Cli, home: Path, tiny_log: Path) -> None:
    """Every job's own duration: the report says that it does not repeat."""
    ran = cli("replay", tiny_log, "--costs", "measured", "--no-plots", "--out", "r")
    assert ran.code == 0
    assert "does not repeat" in ran.err
    document = report("r")
    assert document["identity"]["costs_sha256"] is None
    assert all(sum(run["outcomes"].values()) == 12 for run in document["runs"])


def test_a_planted_regression_fails_the_gate(replay: Cli, cli: Cli, home: Path, tiny_log: Path) -> None:
    """Same code passes; a slower network, other keyframes and another log do not, each with its exit code."""
    assert replay(tiny_log, "--model", "oracle", "--out", "base").code == 0
    assert cli("gate", "base", "--write-baseline", "baseline.json").code == 0
    assert replay(tiny_log, "--model", "oracle", "--out", "same").code == 0
    assert cli("gate", "same", "--baseline", "baseline.json").code == 0
    assert (
        replay(tiny_log, "--model", "oracle", "--propagation", "hold", "--keyframes", "every:6", "--out", "x").code == 0
    )
    ran = cli("gate", "x", "--baseline", "baseline.json", "--no-exact")
    assert ran.code == 4
    assert "offline" in ran.out
    assert replay(tiny_log, "--model", "oracle", "--end", "0.9", "--out", "window").code == 0
    assert cli("gate", "window", "--baseline", "baseline.json").code == 5


def test_reports_replace_reports(replay: Cli, home: Path, tiny_log: Path) -> None:
    """--out twice: the second report stands alone, nothing of the first is left."""
    assert replay(tiny_log, "--model", "oracle", "--out", "r").code == 0
    (home / "r" / "stray.txt").write_text("of the first")
    assert replay(tiny_log, "--model", "oracle", "--clock", "offline", "--out", "r").code == 0
    assert not (home / "r" / "stray.txt").exists()
    assert not (home / "r" / "trace.json").exists()
    assert [path.name for path in home.iterdir()] == ["r"]
