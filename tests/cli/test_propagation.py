"""`--propagation`: every method from the command line to the report."""

import json
from pathlib import Path

import pytest

from stsem.stages.propagate import PROPAGATIONS
from tests.made_up_walk import write_walk

from .conftest import Cli, report, rows

TINY = Path(__file__).resolve().parents[2] / "logs" / "tiny-a.mcap"
OFFLINE = ("--model", "oracle", "--mode", "keyframe", "--keyframes", "every:6", "--clock", "offline", "--no-plots")


@pytest.mark.parametrize("method", PROPAGATIONS)
def test_every_method(replay: Cli, home: Path, method: str) -> None:
    """Scores at every distance, twice the same bytes; what is covered is said by all but `hold`, and more right."""
    assert replay(TINY, *OFFLINE, "--propagation", method, "--repeat", "2", "--out", "r").code == 0
    (run,) = report("r")["runs"]
    told = method != "hold"
    assert [row["frames"] for row in run["by_distance"]] == [0, 1, 2, 3, 4, 5]
    assert [row["covered"] is not None for row in run["by_distance"]] == [False] + 5 * [told]
    assert ("covered" in run["strata"]) == (run["covered"] is not None) == told
    shares = [float(row["covered_share"]) for row in rows("r") if row["covered_share"]]
    assert len(shares) == 25 * told
    if told:
        assert run["covered"] == pytest.approx(sum(shares) / len(shares))
        assert run["strata"]["covered"]["pixel_accuracy"] > run["strata"]["propagated"]["pixel_accuracy"]
        assert (Path("r") / "report.md").read_text().count("of the pixels of predicted answers are covered") == 1


def test_real_time(replay: Cli, home: Path, tiny_log: Path, made_up_costs: Path) -> None:
    """Methods that follow the image register even where the policy does not ask; a frame waits for its depth and pose.

    A profile that was not measured with the method is said to be foreign. What answers rest on is said without an
    offline pass, too.
    """
    common = ("--model", "oracle", "--keyframes", "every:6", "--costs", made_up_costs, "--map", "off", "--no-plots",
              "--no-offline")  # fmt: skip
    for method, inside, said in (
        ("hold", ["segment", "propagate"], True), ("homography", ["register", "segment", "propagate"], False),
        ("flow", ["register", "segment", "propagate"], True), ("depth", ["register", "segment", "propagate"], True),
    ):  # fmt: skip
        assert replay(tiny_log, *common, "--propagation", method, "--out", method).code == 0
        document = report(method)
        assert document["runs"][1]["stages_inside"] == inside
        foreign = f"measured with --propagation homography (register: points), but the run used {method}"
        assert any(foreign in warning for warning in document["warnings"]) == said
        evidence = "`keyframe`, as delivered: "
        assert (evidence in (Path(method) / "report.md").read_text()) == (method != "hold")


def test_a_profile_names_its_method(replay: Cli, home: Path, tiny_log: Path) -> None:
    """Then nothing is said where it fits, and the method's own name where it does not."""
    samples = {"segment@2": [10**7], "register@1": [10**6], "propagate@1": [10**6], "fuse@1": [10**6]}
    made_for = {"propagation": "flow", "register": "points and the method's own"}
    costs = {"schema": "stsem-costs/1", "machine": "m", "made_for": made_for, "samples_ns": samples}
    (home / "flow.json").write_text(json.dumps(costs))
    for method, said in (("flow", False), ("depth", True)):
        ran = replay(
            tiny_log, "--model", "oracle", "--costs", "flow.json", "--propagation", method, "--no-plots", "--out", "r"
        )
        assert ran.code == 0
        assert any("measured with --propagation flow" in warning for warning in report("r")["warnings"]) == said


def test_depth_where_a_frame_has_none(replay: Cli, home: Path, tmp_path: Path) -> None:
    """Frames without depth are predicted by flow, and counted; none is incomplete."""
    log = write_walk(tmp_path / "gappy.mcap", depth=lambda i: i not in (2, 3, 8))
    assert replay(log, *OFFLINE, "--propagation", "depth", "--out", "r").code == 0
    (run,) = report("r")["runs"]
    assert run["remarks"] == {"no depth or pose: by flow": 3}
    assert [row["frame"] for row in rows("r") if row["remark"].startswith("no depth")] == ["2", "3", "8"]
    assert run["outcomes"]["incomplete"] == 0


def test_depth_needs_depth(replay: Cli, home: Path, tmp_path: Path) -> None:
    """A log without: one sentence; but not where every frame goes through the network."""
    log = write_walk(tmp_path / "flat.mcap", depth=lambda i: False)
    ran = replay(log, *OFFLINE, "--propagation", "depth")
    assert ran.code == 1
    assert "--propagation depth takes depth" in ran.sentence
    assert "no depth channel" in ran.sentence
    assert "choose another propagation" in ran.sentence
    log_of_modes = ("--model", "oracle", "--mode", "per-frame", "--clock", "offline", "--no-plots", "--out", "r")
    assert replay(log, *log_of_modes, "--propagation", "depth").code == 0
