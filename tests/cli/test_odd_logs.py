"""Logs that are short, damaged, without truth or without depth: replayed as far as they go, and said so."""

from pathlib import Path

import pytest

from tests.made_up_walk import write_walk

from .conftest import Cli, report, rows


def test_a_log_without_truth(replay: Cli, home: Path) -> None:
    """No score, no zero: accuracy is not measured, latency and throughput are."""
    path = write_walk(home / "blind.mcap", truth=None)
    ran = replay(path, "--out", "r")
    assert ran.code == 0
    assert "not measured" in ran.out
    document = report("r")
    assert (document["state"], document["accuracy_state"]) == ("valid", "not measured")
    assert "no label channel" in document["accuracy_reason"]
    assert len(document["runs"]) == 2
    for run in document["runs"]:
        assert run["offline"] is run["delivered"] is run["streaming"] is run["loss"] is None
        assert "no label channel" in run["not_measured"]["offline"]
        assert run["latency_ms"]["from_arrival"]["max"] > 0
        assert run["throughput"]["output_hz"] > 0


def test_offline_without_truth_measures_nothing(replay: Cli, home: Path) -> None:
    """Neither accuracy nor timing: exit code 5, and the verdict is in the file."""
    path = write_walk(home / "blind.mcap", truth=None, frames=4)
    ran = replay(path, "--clock", "offline", "--out", "r")
    assert ran.code == 5
    document = report("r")
    assert document["state"] == "invalid"
    assert document["verdict"]["exit_code"] == 5
    assert "label channel" in document["verdict"]["text"]


def test_no_class_in_common_is_not_zero(replay: Cli, home: Path) -> None:
    """Foreign classes leave accuracy unmeasured, with both lists named."""
    path = write_walk(home / "foreign.mcap", frames=4, names={0: "kelp", 1: "coral", 2: "squid"})
    assert replay(path, "--out", "r").code == 0
    document = report("r")
    assert document["accuracy_state"] == "not measured"
    assert "kelp" in document["accuracy_reason"]
    assert "--class-map" in document["accuracy_reason"]
    (home / "map.toml").write_text("wall = 'kelp'\n")
    assert replay(path, "--class-map", "map.toml", "--out", "r").code == 0
    document = report("r")
    assert document["accuracy_state"] == "measured"
    assert sorted(document["input"]["classes_unknown_to_network"]) == ["coral", "squid"]


def test_window(replay: Cli, home: Path, tiny_log: Path) -> None:
    """--start and --end are half-open seconds from the first colour stamp."""
    assert replay(tiny_log, "--model", "oracle", "--start", "0.3", "--end", "0.8", "--out", "r").code == 0
    document = report("r")
    assert document["input"]["logs"][0]["frames"] == 5
    assert document["input"]["logs"][0]["window_s"] == [0.3, 0.8]
    stamps = [int(row["log_stamp_ns"]) for row in rows("r") if row["mode"] == "keyframe"]
    assert [(stamp - 1_700_000_000 * 10**9) // 10**8 for stamp in stamps] == [3, 4, 5, 6, 7]


@pytest.mark.parametrize("frames", [1, 2])
def test_very_short_logs(replay: Cli, home: Path, frames: int) -> None:
    """One frame has no period and two have no jitter; both are reports."""
    path = write_walk(home / "short.mcap", frames=frames)
    for more in ([], ["--clock", "offline"]):
        assert replay(path, "--model", "oracle", "--out", "r", *more).code == 0
        document = report("r")
        assert [sum(run["outcomes"].values()) for run in document["runs"]] == [frames, frames]
        assert document["runs"][0]["offline"]["pixel_accuracy"] == 1.0


def test_costs_cannot_be_measured_on_one_frame(cli: Cli, home: Path) -> None:
    """--costs auto says what to do instead."""
    ran = cli("replay", write_walk(home / "short.mcap", frames=1), "--no-plots")
    assert ran.code == 1
    assert "two decodable frames" in ran.sentence
    assert "--costs" in ran.sentence


def test_damaged_frames(replay: Cli, home: Path) -> None:
    """Frames that cannot be decoded are counted and survived: exit code 3."""
    path = write_walk(home / "broken.mcap", broken=frozenset({2, 5}))
    ran = replay(path, "--model", "oracle", "--out", "r", "--queue", "lossless", "--rate", "0.1")
    assert ran.code == 3
    assert "undecodable 2" in ran.err
    document = report("r")
    assert document["state"] == "lossy"
    assert document["input"]["logs"][0]["damage"]["counts"] == {"undecodable": {"/camera/color": 2}}
    assert [run["outcomes"]["undecodable"] for run in document["runs"]] == [2, 2]
    assert document["runs"][0]["outcomes"]["segmented"] == 10


def test_a_truncated_file(replay: Cli, home: Path, tiny_log: Path) -> None:
    """What can be read is replayed, and the state says lossy."""
    (home / "cut.mcap").write_bytes(tiny_log.read_bytes()[: tiny_log.stat().st_size * 2 // 3])
    ran = replay("cut.mcap", "--model", "oracle", "--out", "r")
    assert ran.code == 3
    assert "truncated" in ran.err
    document = report("r")
    assert (document["state"], document["verdict"]["exit_code"]) == ("lossy", 3)
    assert "truncated" in document["input"]["logs"][0]["damage"]["counts"]


def test_nothing_decodable_in_the_window(replay: Cli, home: Path) -> None:
    """Nothing measured is no score of 0: state invalid, exit code 5."""
    path = write_walk(home / "broken.mcap", frames=8, broken=frozenset(range(4, 8)))
    for more, compared in (([], ["throughput.processed_share"]), (["--clock", "offline"], [])):
        ran = replay(path, "--model", "oracle", "--start", "0.4", "--out", "r", *more)
        document = report("r")
        assert (ran.code, document["state"], document["accuracy_state"]) == (5, "invalid", "not measured")
        assert [run["outcomes"]["undecodable"] for run in document["runs"]] == [4, 4]
        assert "was answered" in document["verdict"]["text"]
        scores = [run[name] for run in document["runs"] for name in ("offline", "delivered", "streaming")]
        assert scores == [None] * 6
        assert [row["metric"] for row in document["comparison"]["rows"]] == compared


def test_nothing_decodable_at_all(replay: Cli, home: Path) -> None:
    """Not even the size of the images is known: refused in one sentence."""
    path = write_walk(home / "broken.mcap", frames=4, broken=frozenset(range(4)))
    ran = replay(path, "--model", "oracle")
    assert ran.code == 5
    assert "No image of /camera/color can be decoded" in ran.sentence


def test_a_distorted_camera_is_straightened_and_makes_a_map(replay: Cli, home: Path) -> None:
    """Distortion is undone before anything is measured, and the report says so."""
    path = write_walk(home / "lens.mcap", frames=4, distortion=(0.1, 0.0, 0.0, 0.0, 0.0))
    assert replay(path, "--model", "oracle", "--out", "r").code == 0
    assert (home / "r" / "map.ply").exists()
    assert report("r")["runs"][0]["offline"]["pixel_accuracy"] == 1.0
    assert any("(plumb_bob) is undone" in warning for warning in report("r")["warnings"])


def test_a_lens_that_is_not_understood_makes_no_map(replay: Cli, home: Path) -> None:
    """Equation 3 needs straight rays: no map, and the report says why; the rest runs on the images as they are."""
    path = write_walk(home / "odd.mcap", frames=4, distortion=(0.1, 0.0, 0.0))
    assert replay(path, "--model", "oracle", "--out", "r").code == 0
    run = report("r")["runs"][1]
    assert run["map"] is None
    assert "distortion" in run["not_measured"]["map"]
    assert not (home / "r" / "map.ply").exists()


def test_missing_depth_disables_the_map_for_that_frame(replay: Cli, home: Path) -> None:
    """An optional channel with gaps is counted, and nobody waits for it."""
    path = write_walk(home / "gaps.mcap", frames=6, depth=lambda i: i % 2 == 0)
    ran = replay(path, "--model", "oracle", "--mode", "per-frame", "--rate", "0.1", "--out", "r")
    assert ran.code == 0
    (run,) = report("r")["runs"]
    assert run["outcomes"]["incomplete"] == 0
    assert run["stages_disabled"] == {"fuse": 3}


def test_a_broken_label_image_is_no_truth(replay: Cli, home: Path) -> None:
    """The oracle's choice moves on; the frame is not judged, and the log counts as damaged."""
    path = write_walk(home / "labels.mcap", frames=8, broken_labels=frozenset({0, 4}))
    arguments = ("--model", "oracle", "--keyframes", "every:4", "--clock", "offline", "--out", "r")
    assert replay(path, *arguments).code == 3
    document = report("r")
    assert document["input"]["logs"][0]["damage"]["counts"] == {"undecodable": {"/gt/labels": 2}}
    per_frame, keyframe = document["runs"]
    assert per_frame["outcomes"]["no_source"] == 2
    assert per_frame["offline"]["n"] == 6
    assert keyframe["keyframes"] == [1, 5]
    assert keyframe["keyframes_moved"] == 1
    assert next(row["outcome"] for row in rows("r") if row["mode"] == "keyframe") == "no_source"
