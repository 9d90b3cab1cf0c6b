"""Prediction, SLAM and asynchronous keyframes on logs that show nothing, next to nothing, or stop in between."""

from pathlib import Path
from typing import Any

import pytest

from tests.made_up_walk import write_walk

from .conftest import Cli, report

MODES = ("--model", "oracle", "--mode", "keyframe,keyframe-async", "--keyframes", "every:4")
METHODS = ("hold", "homography", "homography-chained", "flow", "depth")
FRAMES = 12


def runs(folder: str, frames: int = FRAMES) -> list[dict[str, Any]]:
    """The runs of a report, every frame of them accounted for."""
    found: list[dict[str, Any]] = report(folder)["runs"]
    assert [sum(run["outcomes"].values()) for run in found] == [frames, frames]
    return found


@pytest.mark.parametrize("method", METHODS)
def test_black_images(replay: Cli, home: Path, method: str) -> None:
    """Nothing to follow and nothing to match: labels stay where they are, or go by the depth and poses of the log."""
    log = write_walk(home / "black.mcap", dark=lambda index: True)
    assert replay(log, *MODES, "--propagation", method, "--out", "r").code == 0
    for run in runs("r"):
        assert run["offline"]["n"] == FRAMES
        assert run["strata"]["propagated"]["pixel_accuracy"] > 0.5


def test_slam_in_the_dark(replay: Cli, home: Path) -> None:
    """A flat wall without light: lost, said, and found again with the light; predictions go on by flow meanwhile."""
    log = write_walk(home / "dark.mcap", dark=lambda index: 3 <= index < 8)
    ran = replay(log, *MODES, "--propagation", "depth", "--pose", "slam", "--keyframes", "coverage", "--out", "r")
    assert ran.code == 0
    for run in runs("r"):
        found = run["trajectory"]
        assert (found["lost"], found["n"], found["relocalised"]) == (5, FRAMES - 5, 1)
        assert found["tracked_share"] == pytest.approx((FRAMES - 5) / FRAMES)
        assert run["remarks"]["no depth or pose: by flow"] >= 3


@pytest.mark.parametrize("pose", ["log", "slam"])
@pytest.mark.parametrize("size", [(16, 12), (2000, 4), (1, 300)], ids=["16x12", "2000x4", "1x300"])
def test_images_too_small_for_points(replay: Cli, home: Path, size: tuple[int, int], pose: str) -> None:
    """No point has room in a strip; predictions without one hold the keyframe, and SLAM has depth at most."""
    log = write_walk(home / "small.mcap", size=size, frames=6)
    for method in METHODS:
        assert replay(log, *MODES, "--propagation", method, "--pose", pose, "--out", "r").code == 0
        assert all(run["offline"]["n"] == 6 for run in runs("r", 6))


def test_a_pause_of_a_minute(replay: Cli, home: Path) -> None:
    """A policy that looks at time takes a keyframe behind it, and SLAM goes on where the view is the same."""
    log = write_walk(home / "paused.mcap", pause_ns=60 * 10**9)
    flags = ("--propagation", "depth", "--pose", "slam", "--keyframes", "coverage:0.5")
    assert replay(log, *MODES, *flags, "--out", "r").code == 0
    for run in runs("r"):
        assert run["keyframe_reasons"]["time"] == 1
        assert FRAMES // 2 in run["keyframes"]
        assert run["trajectory"]["lost"] == 0


@pytest.mark.parametrize(
    ("end", "why"), [("0.2", "fewer than 3 poses have a counterpart in the log"), ("1.2", "all poses lie on one line")]
)
def test_why_there_is_no_error_of_the_trajectory(replay: Cli, home: Path, tiny_log: Path, end: str, why: str) -> None:
    """One reason, the one that holds."""
    assert replay(tiny_log, *MODES, "--pose", "slam", "--clock", "offline", "--end", end, "--out", "r").code == 0
    for run in report("r")["runs"]:
        assert run["trajectory"]["ate_rmse_m"] is None
        assert run["not_measured"]["trajectory.ate_rmse_m"].startswith(why)


def test_a_log_cut_off_in_the_middle(replay: Cli, home: Path) -> None:
    """All of it at once, on what is left: exit code 3, and every frame that is left has its outcome."""
    log = write_walk(home / "whole.mcap", frames=40)
    (home / "cut.mcap").write_bytes(log.read_bytes()[: log.stat().st_size // 2])
    ran = replay(
        "cut.mcap", *MODES, "--propagation", "depth", "--pose", "slam", "--cores", "1", "--queue", "fifo:3",
        "--count-decode", "--annotate", "--repeat", "2", "--out", "r",
    )  # fmt: skip
    assert ran.code == 3
    assert "truncated 1" in ran.err
    frames = report("r")["input"]["logs"][0]["frames"]
    assert 5 < frames < 40
    assert all(run["trajectory"]["tracked_share"] == 1 for run in runs("r", frames))


def test_three_modes_with_their_own_differences(replay: Cli, home: Path, tiny_log: Path) -> None:
    """The number beside a mode is the difference of that mode."""
    flags = ("--model", "oracle", "--mode", "both,keyframe-async", "--no-offline", "--map", "off")
    ran = replay(tiny_log, *flags, "--out", "r")
    rates = [run["throughput"]["output_hz"] for run in report("r")["runs"]]
    (line,) = (line for line in ran.out.splitlines() if line.startswith("output rate"))
    assert line.split()[-2:] == [f"{rate - rates[0]:+.2f}" for rate in rates[1:]]
