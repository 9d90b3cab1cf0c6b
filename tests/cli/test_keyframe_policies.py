"""`--keyframes coverage` and `budget`: from the command line to the report."""

from pathlib import Path

import pytest

from .conftest import Cli, report, rows

TINY = Path(__file__).resolve().parents[2] / "logs" / "tiny-a.mcap"
COMMON = ("--model", "oracle", "--mode", "keyframe", "--map", "off", "--no-plots", "--out", "r")
OFFLINE = (*COMMON, "--clock", "offline")


@pytest.mark.parametrize("method", ["homography", "flow", "depth"])
def test_coverage(replay: Cli, home: Path, method: str) -> None:
    """More keyframes for a larger share, twice the same bytes; no prediction rests on much less than was asked for."""
    counts = []
    for share in ("0.6", "0.9"):
        asked = ("--keyframes", f"coverage:{share}", "--propagation", method, "--set", "keyframe_time_s=100")
        assert replay(TINY, *OFFLINE, *asked, "--repeat", "2").code == 0
        (run,) = report("r")["runs"]
        assert set(run["keyframe_reasons"]) == {"first", "coverage"}
        counts.append(len(run["keyframes"]))
        covered = [float(row["covered_share"]) for row in rows("r") if row["covered_share"]]
        assert min(covered) > float(share) - 0.15
    assert counts[0] < counts[1]


def test_the_time_ends_what_coverage_does_not(replay: Cli, home: Path) -> None:
    """At 10 Hz and half a second every sixth frame."""
    asked = ("--keyframes", "coverage:0.001", "--propagation", "flow", "--set", "keyframe_time_s=0.5")
    assert replay(TINY, *OFFLINE, *asked).code == 0
    (run,) = report("r")["runs"]
    assert run["keyframe_reasons"] == {"first": 1, "time": 4}


@pytest.mark.parametrize("method", ["hold", "homography", "depth"])
def test_budget(replay: Cli, home: Path, made_up_costs: Path, method: str) -> None:
    """Three seconds at two a second, with any method, on the clock too: six keyframes, give or take the burst."""
    asked = ("--keyframes", "budget:2", "--propagation", method)
    for clock in (("--clock", "offline"), ("--costs", made_up_costs)):
        assert replay(TINY, *COMMON, *asked, *clock, "--repeat", "2").code == 0
        (run,) = report("r")["runs"]
        assert set(run["keyframe_reasons"]) == {"first", "budget"}
        assert 3 <= len(run["keyframes"]) <= 9


def test_what_nobody_can_tell(replay: Cli, home: Path, made_up_costs: Path) -> None:
    """One sentence before anything runs; no matter where every frame goes through the network."""
    for policy, extra in (("coverage", ()), ("coverage:0.8", ("--queue", "lossless"))):
        ran = replay(TINY, *OFFLINE, "--keyframes", policy, "--propagation", "hold", *extra)
        assert ran.code == 2
        assert (
            f"--keyframes {policy} asks how much a prediction covers, which --propagation hold cannot" in ran.sentence
        )
    for policy in ("coverage", "budget:2"):
        depth = ("--propagation", "depth", "--keyframes", policy)
        ran = replay(TINY, *COMMON, "--costs", made_up_costs, *depth, "--sustainable")
        assert ran.code == 2
        assert "--sustainable decides keyframes without images" in ran.sentence
    per_frame = ("--model", "oracle", "--mode", "per-frame", "--clock", "offline", "--no-plots", "--out", "r")
    assert replay(TINY, *per_frame, "--keyframes", "coverage", "--propagation", "hold").code == 0


def test_a_profile_says_whether_coverage_was_in_it(replay: Cli, home: Path, made_up_costs: Path) -> None:
    """Telling the coverage is a part of `register`; a profile without it is said to be foreign."""
    assert replay(TINY, *COMMON, "--costs", made_up_costs, "--keyframes", "coverage",
                  "--propagation", "homography").code == 0  # fmt: skip
    said = "but the run used homography (register: points and coverage)"
    assert any(said in warning for warning in report("r")["warnings"])
