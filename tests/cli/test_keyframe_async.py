"""`--mode keyframe-async`: no answer waits for the network."""

import json
from pathlib import Path
from typing import Any

import pytest

from stsem.sim.profile import CostProfile
from tests.made_up_walk import write_walk

from .conftest import Cli, report, rows

MS = 1_000_000
EVERY = ("--model", "oracle", "--keyframes", "every:2")


@pytest.fixture
def slow(home: Path) -> Path:
    """A profile whose network takes four periods of the log."""
    costs = {"segment@1": 400, "segment@2": 400, "register@1": 9, "propagate@1": 3, "fuse@1": 20, "track@1": 30}
    path = home / "slow.json"
    CostProfile("slow", {name: (ms * MS,) for name, ms in costs.items()}).save(path)
    return path


def jobs(folder: Path, mode: str, stage: str) -> list[tuple[int, int]]:
    """(start, end) in nanoseconds of the jobs of a stage in trace.json."""
    events = json.loads((folder / "trace.json").read_bytes())["traceEvents"]
    args = (event["args"] for event in events if event["ph"] == "X" and event["args"]["mode"] == mode)
    return [(a["start_ns"], a["start_ns"] + a["duration_ns"]) for a in args if a["stage"] == stage]


def test_every_answer_in_time(replay: Cli, home: Path, slow: Path, tmp_path: Path) -> None:
    """30 frames at 10 Hz: answered within a period from the first keyframe on, beside a network of four periods."""
    log = write_walk(tmp_path / "walk.mcap", frames=30)
    modes = ("--mode", "both,keyframe-async")
    assert replay(log, *EVERY, *modes, "--costs", slow, "--out", "r").code == 0
    document = report("r")
    per_frame, keyframe, run = document["runs"]
    beside, outcomes = run["background"], run["outcomes"]
    assert (per_frame["background"], keyframe["background"]) == (None, None)
    assert outcomes["propagated"] + outcomes["no_source"] == 30
    assert outcomes["no_source"] < 6
    assert run["latency_ms"]["from_arrival"]["max"] < 100
    assert "segment" not in run["stages_inside"]
    assert beside["chosen"] == beside["finished"] + beside["replaced"] + beside["unfinished"] == 15
    assert beside["replaced"] > 3
    assert len(run["keyframes"]) == sum(run["keyframe_reasons"].values()) == beside["finished"]
    network = jobs(home / "r", "keyframe-async", "segment")
    assert len(network) == beside["finished"] + bool(beside["unfinished"])
    predicting = jobs(home / "r", "keyframe-async", "propagate")
    assert sum(any(a < start and end < b for a, b in network) for start, end in predicting) > 15
    table = [row for row in rows("r") if row["mode"] == "keyframe-async"]
    chosen = [row for row in table if row["reason"]]
    assert [int(row["frame"]) for row in chosen] == list(range(0, 30, 2))
    assert {row["outcome"] for row in chosen} == {"no_source", "propagated"}
    assert {int(row["keyframe"]) for row in table if row["keyframe"]} <= set(run["keyframes"])


def test_age(replay: Cli, home: Path, slow: Path, tiny_log: Path) -> None:
    """By age: every delivered answer once, none younger than the network takes; the report says it in words."""
    assert replay(tiny_log, *EVERY, "--mode", "keyframe-async", "--costs", slow, "--out", "r").code == 0
    (run,) = report("r")["runs"]
    beside = run["background"]
    ages = {int(row["frame"]): int(row["distance_frames"]) for row in rows("r") if row["distance_frames"]}
    assert sum(row["n"] for row in beside["by_age"]) == len(ages) == run["outcomes"]["propagated"]
    assert [row["frames"] for row in beside["by_age"]] == sorted(set(ages.values()))
    assert min(ages.values()) >= 4
    assert beside["age_ms"]["n"] == len(ages)
    assert beside["age_ms"]["mean"] == pytest.approx(100 * sum(ages.values()) / len(ages), rel=0.01)
    text = (home / "r" / "report.md").read_text()
    assert "segment (beside the path)" in text
    assert "By age, keyframe-async" in text
    assert f"{beside['replaced']} lost their place before the network to a newer choice" in text


@pytest.mark.parametrize(
    ("flags", "said"),
    [((), True), (("--keyframes", "coverage"), True), (("--propagation", "flow"), False),
     (("--keyframes", "every:2"), False)],
)  # fmt: skip
def test_what_the_profile_does_not_know(
    replay: Cli, home: Path, tiny_log: Path, flags: tuple[str, ...], said: bool
) -> None:
    """Policy and method match points, each with a keyframe of its own; no profile was measured with two."""
    base = ("--model", "oracle", "--mode", "keyframe-async", "--no-offline", "--propagation", "homography", *flags)
    assert replay(tiny_log, *base, "--out", "r").code == 0
    assert any("registers a frame to two keyframes" in text for text in report("r")["warnings"]) == said


def test_offline_it_equals_keyframe(replay: Cli, home: Path, tiny_log: Path) -> None:
    """Nothing waits without a clock: keyframes are answered by the network, and nothing differs but the name."""
    modes = ("--mode", "keyframe,keyframe-async", "--clock", "offline")
    assert replay(tiny_log, *EVERY, *modes, "--propagation", "flow", "--out", "r").code == 0
    one, other = report("r")["runs"]
    assert {**other, "mode": "keyframe"} == one
    names = ("keyframe", "keyframe-async")
    first, second = ([{**row, "mode": ""} for row in rows("r") if row["mode"] == name] for name in names)
    assert first == second


@pytest.mark.parametrize("propagation", ["homography", "depth"])
def test_with_slam(replay: Cli, home: Path, slow: Path, tmp_path: Path, propagation: str) -> None:
    """Poses from SLAM, beside the path or on it; keyframes go into the map with them; the same bytes twice."""
    log = write_walk(tmp_path / "walk.mcap", frames=20)
    flags = ("--mode", "keyframe-async", "--pose", "slam", "--propagation", propagation, "--repeat", "2")
    assert replay(log, *EVERY, *flags, "--costs", slow, "--out", "r").code == 0
    (run,) = report("r")["runs"]
    assert ("track" in run["stages_inside"]) == (propagation == "depth")
    assert run["latency_ms"]["from_arrival"]["max"] < 100
    assert sum(run["outcomes"].values()) == 20
    assert run["outcomes"]["propagated"] > 10


def test_rate_that_it_sustains(replay: Cli, home: Path, slow: Path, tmp_path: Path) -> None:
    """Far above the network's: answers are as fast as register and propagate."""
    log = write_walk(tmp_path / "walk.mcap", frames=40)
    flags = ("--mode", "both,keyframe-async", "--map", "off", "--no-offline", "--sustainable")
    assert replay(log, *EVERY, *flags, "--costs", slow, "--out", "r").code == 0
    rates = [run["throughput"]["sustainable_hz"] for run in report("r")["runs"]]
    assert rates[2] > 60
    assert all(rate is None or rate < 6 for rate in rates[:2])


def test_costs_of_the_network_on_one_core(replay: Cli, home: Path, tiny_log: Path) -> None:
    """A profile without them, and a trace of another mode, are errors that say what to do."""
    samples: dict[str, Any] = {"segment@2": (90 * MS,), "register@1": (MS,), "propagate@1": (MS,), "fuse@1": (MS,)}
    CostProfile("two cores", samples).save(home / "two.json")
    wrong = replay(tiny_log, *EVERY, "--mode", "keyframe-async", "--costs", "two.json", "--out", "r")
    assert wrong.code == 1
    assert "no 'segment@1'" in wrong.sentence
    assert "stsem costs measure" in wrong.sentence
    assert replay(tiny_log, *EVERY, "--mode", "keyframe", "--costs", "two.json", "--out", "traced").code == 0
    foreign = replay(tiny_log, *EVERY, "--mode", "keyframe-async", "--costs", "traced/trace.json", "--out", "r")
    assert foreign.code == 1
    assert "no jobs of the mode 'keyframe-async'" in foreign.sentence


def test_one_core(replay: Cli, home: Path, slow: Path, tiny_log: Path) -> None:
    """It runs, answers wait, and the report says so."""
    assert replay(tiny_log, *EVERY, "--mode", "keyframe-async", "--costs", slow, "--cores", "1", "--out", "r").code == 0
    document = report("r")
    assert any("needs two cores" in said for said in document["warnings"])
    assert sum(document["runs"][0]["outcomes"].values()) == 12
