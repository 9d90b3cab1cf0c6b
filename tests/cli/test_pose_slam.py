"""`--pose slam`: poses from the images themselves, beside the log's."""

import json
import re
import sys
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from stsem.cli import main
from stsem.metrics.tum import parse
from stsem.pose import Trajectory
from tests.made_up_walk import write_walk

from .conftest import Cli, report, rows

TINY = Path(__file__).resolve().parents[2] / "logs" / "tiny-a.mcap"
KEYFRAME = ("--model", "oracle", "--mode", "keyframe", "--keyframes", "every:5", "--no-plots")
FRAMES, SECONDS = 16, "1.6"
RUNS = {
    "log": (TINY, "--propagation", "depth", "--pose", "log", "--clock", "offline"),
    "slam": (TINY, "--propagation", "depth", "--pose", "slam"),
    "beside": (TINY, "--propagation", "hold", "--pose", "slam", "--no-offline"),
    "blind": (Path("blind.mcap"), "--propagation", "depth", "--pose", "slam", "--clock", "offline"),
}


@pytest.fixture(scope="module")
def folders(made_up_costs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of the reports of `RUNS`; `blind` is the same log without its poses."""
    home = tmp_path_factory.mktemp("slam")
    without_poses(TINY, home / "blind.mcap")
    for name, (log, *flags) in RUNS.items():
        clock = () if "--clock" in flags else ("--costs", made_up_costs)
        words = ["stsem", "replay", home / log, *KEYFRAME, "--end", SECONDS, *flags, *clock, "--out", home / name]
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(sys, "argv", [str(word) for word in words])
            patch.setenv("STSEM_CACHE", str(home / "cache"))
            with pytest.raises(SystemExit) as end:
                main.stsem()
        assert end.value.code in (0, None), name
    return home


def without_poses(source: Path, target: Path) -> None:
    """Copy a log message by message, all but its transforms."""
    with source.open("rb") as stream, target.open("wb") as out:
        reader, writer = make_reader(stream), Writer(out)
        writer.start("", "tests")
        channels: dict[int, int] = {}
        for record in reader.iter_metadata():
            writer.add_metadata(record.name, record.metadata)
        for schema, channel, message in reader.iter_messages():
            if schema is None or "Transform" in schema.name or "Pose" in schema.name:
                continue
            if channel.id not in channels:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(channel.topic, channel.message_encoding, number)
            writer.add_message(channels[channel.id], message.log_time, message.data, message.publish_time)
        writer.finish()


def trajectory(folder: Path) -> Trajectory:
    """trajectory.txt."""
    return parse((folder / "trajectory.txt").read_text().splitlines())


def run(folder: Path) -> dict[str, Any]:
    """The only run of a report."""
    (found,) = report(folder)["runs"]
    return dict(found)


def test_both_sources_side_by_side(folders: Path) -> None:
    """A rendered walk is followed to a few centimetres, and predictions by its depth are as good as with true poses."""
    by_slam, by_log = run(folders / "slam"), run(folders / "log")
    found = by_slam["trajectory"]
    assert (found["pose"], found["tracked_share"], found["lost"], found["n"]) == ("slam", 1.0, 0, FRAMES)
    assert found["keyframes"] >= 2
    assert 0 < found["ate_rmse_m"] < 0.05
    assert found["n_second"] > 0
    log, slam = found["sides"]
    assert (log["pose"], log["used"], slam["pose"], slam["used"]) == ("log", False, "slam", True)
    assert log["poses"] == slam["poses"] == FRAMES
    assert slam["path_m"] == pytest.approx(log["path_m"], rel=0.05)
    assert log["offline_miou"] == by_log["offline"]["miou"]
    assert slam["offline_miou"] == by_slam["offline"]["miou"]
    assert slam["offline_miou"] == pytest.approx(log["offline_miou"], abs=0.03)
    text = (folders / "slam" / "report.md").read_text()
    assert len(re.findall(r"^\| log +\| keyframe +\| +16 ", text, re.MULTILINE)) == 1
    assert "RPE over 1 s, m" in text


def test_errors_are_those_of_evo(folders: Path) -> None:
    """The two trajectory.txt, judged by evo: `evo_ape tum log/trajectory.txt slam/trajectory.txt -a`."""
    files, metrics, sync = (
        pytest.importorskip(f"evo.{name}") for name in ("tools.file_interface", "core.metrics", "core.sync")
    )
    wanted, found = sync.associate_trajectories(
        *(files.read_tum_trajectory_file(str(folders / pose / "trajectory.txt")) for pose in ("log", "slam"))
    )
    found.align(wanted)
    judge = metrics.APE(metrics.PoseRelation.translation_part)
    judge.process_data((wanted, found))
    rmse = judge.get_statistic(metrics.StatisticsType.rmse)
    assert run(folders / "slam")["trajectory"]["ate_rmse_m"] == pytest.approx(rmse, abs=1e-8)  # nine digits in a file
    assert len(trajectory(folders / "log")) == len(trajectory(folders / "slam")) == FRAMES


def test_tracking_is_on_the_path_where_predictions_need_it(folders: Path) -> None:
    """By depth an answer waits for its pose; else `track` works beside the path. The network has one core."""
    on, beside = run(folders / "slam"), run(folders / "beside")
    assert "track" in on["stages_inside"]
    assert "track" not in beside["stages_inside"]
    assert beside["latency_ms"]["stages"]["track"]["service"]["n"] == FRAMES
    assert "track (beside the path)" in (folders / "beside" / "report.md").read_text()
    assert len([row for row in rows(folders / "beside") if row["track_service_ns"]]) == FRAMES  # the dropped ones, too
    for found in (on, beside):
        assert sum(found["outcomes"].values()) == FRAMES
        assert found["latency_ms"]["stages"]["segment"]["service"]["max"] == 180.0  # that of one core
    errors = ("ate_rmse_m", "rpe_translation_m", "keyframes", "loops", "tracked_share")
    assert [beside["trajectory"][key] for key in errors] == [on["trajectory"][key] for key in errors]
    assert (folders / "slam" / "map.ply").stat().st_size > 100_000


def test_the_log_without_its_poses_gives_the_same_answers(folders: Path) -> None:
    """They are the truth that SLAM is judged by, and nothing else."""
    found, seeing = run(folders / "blind"), run(folders / "slam")
    assert found["trajectory"]["ate_rmse_m"] is None
    assert found["not_measured"]["trajectory.ate_rmse_m"] == "the log has no poses to compare with"
    assert [side["pose"] for side in found["trajectory"]["sides"]] == ["slam"]
    assert found["offline"] == seeing["offline"]
    name = "trajectory.txt"
    assert (folders / "blind" / name).read_bytes() == (folders / "slam" / name).read_bytes()


def test_same_bytes_twice(replay: Cli, home: Path) -> None:
    """Promise P1 with SLAM on the path."""
    arguments = ("--propagation", "depth", "--pose", "slam", "--end", "0.6", "--repeat", "2", "--out", "r")
    assert replay(TINY, *KEYFRAME[:-1], *arguments).code == 0


def test_work_beside_the_answers_that_is_not_done_is_said(replay: Cli, home: Path) -> None:
    """Tracking slower than the camera: frames that nobody had tracked, and keyframes that waited for it."""
    samples = {"segment@1": [10**7], "register@1": [10**6], "propagate@1": [10**6], "fuse@1": [10**6]}
    modes = ("--model", "oracle", "--mode", "per-frame", "--no-offline", "--no-plots", "--pose", "slam")
    for track_ms, said in ((20, []), (150, ["fell behind: 5 of 16 frames", "6 of 16 keyframes are not in the map"])):
        profile = {"schema": "stsem-costs/1", "machine": "m", "samples_ns": samples | {"track@1": [track_ms * 10**6]}}
        (home / "costs.json").write_text(json.dumps(profile))
        assert replay(TINY, *modes, "--end", SECONDS, "--costs", "costs.json", "--out", "r").code == 0
        warnings = report("r")["warnings"]
        assert [any(text in warning for warning in warnings) for text in said] == [True] * len(said)
        assert len([warning for warning in warnings if warning.startswith("per-frame")]) == len(said)


@pytest.mark.parametrize(
    ("made", "why"),
    [
        ({"depth": None}, "the log has no depth channel that can be used"),
        ({"distortion": (0.1, 0.0, 0.0, 0.0, 0.0)}, None),
    ],
    ids=["no depth", "a lens that is undone"],
)
def test_without_depth_slam_is_off_and_the_rest_runs(
    replay: Cli, home: Path, tmp_path: Path, made: dict[str, Any], why: str | None
) -> None:
    """One sentence; every frame is answered all the same."""
    log = write_walk(tmp_path / "walk.mcap", **made)
    ran = replay(log, *KEYFRAME[:-1], "--pose", "slam", "--clock", "offline", "--out", "r")
    found = run(Path("r"))
    assert found["outcomes"]["segmented"] + found["outcomes"]["propagated"] == 12
    assert ran.code == 0
    if why is None:
        assert "SLAM is off" not in ran.err
    else:
        assert ran.err.strip() == f"Note: SLAM is off, and frames have no pose: {why}."
        assert (found["trajectory"], found["map"]) == (None, None)
        assert found["not_measured"]["trajectory"] == found["not_measured"]["map"] == why
        assert not Path("r/trajectory.txt").exists()


def test_nothing_to_go_by_is_said_frame_by_frame(replay: Cli, home: Path, tmp_path: Path) -> None:
    """Depth of a few frames only: the others are lost or tracked by points, and all of them are counted."""
    log = write_walk(tmp_path / "walk.mcap", depth=lambda index: index < 3)
    assert replay(log, *KEYFRAME[:-1], "--pose", "slam", "--clock", "offline", "--out", "r").code == 0
    found = run(Path("r"))["trajectory"]
    assert found["tracked_share"] is not None
    assert found["lost"] + found["sides"][-1]["poses"] == 12
