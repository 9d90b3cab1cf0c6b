"""The whole line, from a log to its report, through the command."""

import csv
import io
import json
import os
import signal
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stsem.document.difference import first_differences, repeatable_files
from stsem.frame import Frame, Segmentation
from stsem.stages.segment import OracleSegmenter
from tests.made_up_walk import write_walk

from .conftest import Cli

COMMANDS = Path(sys.executable).parent


def report(folder: Path | str) -> dict[str, Any]:
    """report.json as plain data."""
    document: dict[str, Any] = json.loads((Path(folder) / "report.json").read_bytes())
    return document


def rows(folder: Path | str) -> list[dict[str, str]]:
    """frames.csv."""
    return list(csv.DictReader(io.StringIO((Path(folder) / "frames.csv").read_text())))


@pytest.fixture(scope="module")
def twins(tiny_log: Path, made_up_costs: Path, tmp_path_factory: pytest.TempPathFactory) -> list[tuple[Path, str]]:
    """(folder, stdout) of two processes with other thread settings, hash seeds, time zones and empty caches."""
    found = []
    for n, threads in enumerate(("1", "4")):
        home = tmp_path_factory.mktemp("home")
        environment = os.environ | {
            "STSEM_CACHE": str(home / "cache"), "OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads,
            "OPENCV_FOR_THREADS_NUM": threads, "PYTHONHASHSEED": str(n), "TZ": ("UTC", "Asia/Tokyo")[n],
        }  # fmt: skip
        ran = subprocess.run(
            [COMMANDS / "stsem-replay", tiny_log, "--costs", made_up_costs], env=environment, check=True,
            capture_output=True, text=True, timeout=300, cwd=home,
        )  # fmt: skip
        assert ran.stderr == ""
        (folder,) = (home / "reports" / "tiny").iterdir()
        found.append((folder, ran.stdout))
    return found


def test_the_report_is_complete(twins: list[tuple[Path, str]]) -> None:
    """Every file of DESIGN 9 in a folder named by log, config and digest; the table and its place on stdout."""
    folder, out = twins[0]
    document = report(folder)
    assert folder.name == f"{document['config_hash'][:8]}-{document['digest'][:8]}"
    assert {p.name for p in folder.iterdir()} == {
        "report.json", "report.md", "report.html", "frames.csv", "trace.json", "trajectory.txt", "map.ply", "plots",
    }  # fmt: skip
    assert len(list((folder / "plots").glob("*.png"))) >= 5
    assert all(p.read_bytes().startswith(b"\x89PNG") for p in (folder / "plots").iterdir())
    assert "per-frame" in out
    assert "keyframe" in out
    assert f"reports/tiny/{folder.name}/report.html" in out
    assert "<script" not in (folder / "report.html").read_text()
    assert str(folder.parents[2]) not in json.dumps({k: v for k, v in document.items() if k != "host"})


def test_same_bytes_whatever_the_threads(twins: list[tuple[Path, str]]) -> None:
    """Promise P1: every file that it lists, the digest, and the table in the terminal."""
    (one, first_out), (other, second_out) = twins
    first, second = repeatable_files(one), repeatable_files(other)
    assert {"report.json", "frames.csv", "trace.json", "trajectory.txt", "map.ply"} < set(first)
    assert sum(name.startswith("plots/") for name in first) >= 5
    assert first_differences(first, second) == ()
    assert report(one)["digest"] == report(other)["digest"]
    assert first_out == second_out


def test_the_report_says_what_was_done(replay: Cli, home: Path, tiny_log: Path) -> None:
    """The keys that outside programs rely on, and sums that must hold."""
    assert replay(tiny_log, "--model", "oracle", "--out", "r", "--seed", "3").code == 0
    document = report("r")
    assert (document["state"], document["accuracy_state"], document["verdict"]["exit_code"]) == ("valid", "measured", 0)
    assert document["config"]["seed"] == 3
    assert "out" not in document["config"]
    assert document["input"]["classes"] == ["wall", "floor", "door"]
    (log,) = document["input"]["logs"]
    assert (log["frames"], log["frames_with_truth"], log["name"]) == (12, 12, "tiny")
    assert [run["mode"] for run in document["runs"]] == ["per-frame", "keyframe"]
    for run in document["runs"]:
        assert sum(run["outcomes"].values()) == 12
        assert len(run["keyframes"]) == run["outcomes"]["segmented"]
        scores = [run[name]["miou"] for name in ("offline", "delivered", "streaming")]
        parts = run["loss"]
        assert parts["scheduling"] == pytest.approx(scores[0] - scores[1], abs=1e-15)
        assert parts["staleness"] == pytest.approx(scores[1] - scores[2], abs=1e-15)
        total = parts["network"] + parts["prediction"] + parts["scheduling"] + parts["staleness"]
        assert total == pytest.approx(1 - scores[2], abs=1e-12)
    assert document["runs"][0]["offline"]["miou"] == 1.0
    table = rows("r")
    for run in document["runs"]:
        found = Counter(row["outcome"] for row in table if row["mode"] == run["mode"])
        assert found == {name: n for name, n in run["outcomes"].items() if n}


def test_json_on_stdout(replay: Cli, home: Path, tiny_log: Path) -> None:
    """--json prints the document alone; where the report is goes to stderr."""
    ran = replay(tiny_log, "--model", "oracle", "--out", "r", "--json")
    assert ran.code == 0
    assert ran.out.encode() == (home / "r" / "report.json").read_bytes()
    assert "r/report.html" in ran.err


def test_config_reaches_the_run_from_every_source(
    replay: Cli, home: Path, tiny_log: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """stsem.toml < STSEM_* < --set < flags."""
    (home / "stsem.toml").write_text("model = 'oracle'\nseed = 1\nqueue = 'fifo:1'\ncores = 3\nrate = 0.5\n")
    monkeypatch.setenv("STSEM_SEED", "2")
    monkeypatch.setenv("STSEM_QUEUE", "fifo:2")
    monkeypatch.setenv("STSEM_CORES", "4")
    ran = replay(tiny_log, "--out", "r", "--set", "queue=fifo:3", "--set", "cores=5", "--cores", "6")
    assert ran.code == 0
    found = report("r")["config"]
    assert [found[key] for key in ("model", "rate", "seed", "queue", "cores")] == ["oracle", "1/2", 2, "fifo:3", 6]


def test_repeat_passes(replay: Cli, home: Path, tiny_log: Path) -> None:
    """The same bytes three times."""
    assert replay(tiny_log, "--model", "oracle", "--repeat", "3", "--out", "r").code == 0


def test_repeat_names_frame_and_field(replay: Cli, home: Path, tiny_log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One pixel of one frame in the second replay is found."""
    asked: Counter[int] = Counter()
    honest = OracleSegmenter.segment

    def moody(self: OracleSegmenter, frame: Frame) -> Segmentation:
        answer, asked[frame.index] = honest(self, frame), asked[frame.index] + 1
        if frame.index != 4 or asked[4] == 1:
            return answer
        labels = answer.labels.copy()
        labels[40, 50] = (labels[40, 50] + 1) % 3
        return Segmentation(labels)

    monkeypatch.setattr(OracleSegmenter, "segment", moody)
    ran = replay(tiny_log, "--model", "oracle", "--mode", "per-frame", "--repeat", "2", "--out", "r")
    assert ran.code == 1
    assert "Replay 2 differs" in ran.sentence
    assert "report.json: runs[0]." in ran.sentence
    assert "frames.csv: per-frame, frame 4, offline_pixel_accuracy" in ran.sentence


def test_repeat_never_reads_the_cache(replay: Cli, home: Path, tiny_log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A network that does not repeat would hide behind its first answers."""
    from stsem.inference.inferencer import Inferencer, Output

    honest, calls = Inferencer.compute, []

    def moody(self: Inferencer, image: Any, previous: Any) -> Output:
        calls.append(1)
        answer = honest(self, image, previous)
        return Output((answer.labels + (len(calls) == 3)).astype(np.uint8), answer.confidence)

    monkeypatch.setattr(Inferencer, "compute", moody)
    ran = replay(tiny_log, "--mode", "per-frame", "--end", "0.2", "--repeat", "2", "--out", "r")
    assert len(calls) == 4
    assert ran.code == 1
    assert "Replay 2 differs" in ran.sentence


def test_warm_and_cold_caches(replay: Cli, home: Path, tiny_log: Path) -> None:
    """Computed, read back, or without a cache: the same bytes."""
    for name, *more in (("cold",), ("warm",), ("without", "--no-cache")):
        assert replay(tiny_log, "--end", "0.5", "--out", name, *more).code == 0
    cold, warm, without = (repeatable_files(home / name) for name in ("cold", "warm", "without"))
    assert first_differences(cold, warm) == ()
    assert first_differences(cold, without) == ()


def test_the_order_of_modes_and_logs(replay: Cli, home: Path, tiny_log: Path, tmp_path: Path) -> None:
    """Results depend on neither."""
    other = write_walk(tmp_path / "other.mcap", frames=5)
    assert replay(tiny_log, other, "--model", "oracle", "--mode", "keyframe,per-frame", "--out", "a").code == 0
    assert replay(other, tiny_log, "--model", "oracle", "--mode", "both", "--out", "b").code == 0
    for name in ("tiny", "other"):
        first, second = repeatable_files(home / "a" / name), repeatable_files(home / "b" / name)
        assert first_differences(first, second) == ()
    alone = home / "alone"
    assert replay(tiny_log, "--model", "oracle", "--mode", "keyframe", "--out", alone).code == 0
    (run,) = report(alone)["runs"]
    together = report(home / "a" / "tiny")["runs"][1]
    assert rows(alone) == [row for row in rows(home / "a" / "tiny") if row["mode"] == "keyframe"]
    assert {k: v for k, v in run.items() if k != "loss"} == {k: v for k, v in together.items() if k != "loss"}


def test_a_log_without_truth(replay: Cli, home: Path) -> None:
    """No score, no zero: accuracy is not measured, latency and throughput are."""
    path = write_walk(home / "blind.mcap", truth=None)
    ran = replay(path, "--out", "r")
    assert ran.code == 0
    assert "not measured" in ran.out
    document = report("r")
    assert (document["state"], document["accuracy_state"]) == ("valid", "not measured")
    assert "no label channel" in document["accuracy_reason"]
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
    assert all(run["outcomes"]["undecodable"] == 2 for run in document["runs"])
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
    for more in ([], ["--clock", "offline"]):
        ran = replay(path, "--model", "oracle", "--start", "0.4", "--out", "r", *more)
        document = report("r")
        assert (ran.code, document["state"], document["accuracy_state"]) == (5, "invalid", "not measured")
        assert [run["outcomes"]["undecodable"] for run in document["runs"]] == [4, 4]
        assert "was answered" in document["verdict"]["text"]
        assert all(run[name] is None for run in document["runs"] for name in ("offline", "delivered", "streaming"))
        assert not [row for row in document["comparison"]["rows"] if "miou" in row["metric"]]


def test_nothing_decodable_at_all(replay: Cli, home: Path) -> None:
    """Not even the size of the images is known: refused in one sentence."""
    path = write_walk(home / "broken.mcap", frames=4, broken=frozenset(range(4)))
    ran = replay(path, "--model", "oracle")
    assert ran.code in (1, 5)
    assert "/camera/color" in ran.sentence


def test_a_trace_gives_its_timing_again(replay: Cli, home: Path, tiny_log: Path) -> None:
    """--costs trace.json reproduces the schedule to the nanosecond; another log or machine is refused."""
    assert replay(tiny_log, "--model", "oracle", "--out", "first").code == 0
    assert replay(tiny_log, "--model", "oracle", "--costs", "first/trace.json", "--out", "second").code == 0
    assert (home / "first" / "trace.json").read_bytes() == (home / "second" / "trace.json").read_bytes()
    assert (home / "first" / "frames.csv").read_bytes() == (home / "second" / "frames.csv").read_bytes()
    ran = replay(tiny_log, "--model", "oracle", "--costs", "first/trace.json", "--cores", "1")
    assert (ran.code, "segment@1" in ran.sentence) == (1, True)
    ran = replay(tiny_log, "--model", "oracle", "--costs", "first/trace.json", "--count-decode")
    assert (ran.code, "decode@1" in ran.sentence) == (1, True)


def test_slow_costs_drop_frames_and_lose_none(replay: Cli, home: Path, tiny_log: Path) -> None:
    """Ten times slower than real time under every queue rule: every frame has its outcome."""
    samples = {"segment@2": [10**9], "register@1": [8 * 10**6], "propagate@1": [10**6], "fuse@1": [2 * 10**7]}
    (home / "slow.json").write_text(json.dumps({"schema": "stsem-costs/1", "machine": "m", "samples_ns": samples}))
    for queue, drops in (("latest", True), ("fifo:2", True), ("lossless", False)):
        ran = replay(tiny_log, "--model", "oracle", "--costs", "slow.json", "--queue", queue, "--out", "r")
        assert ran.code == 0
        for run in report("r")["runs"]:
            assert sum(run["outcomes"].values()) == 12
            assert (run["outcomes"]["dropped_busy"] > 0) == drops
            assert run["throughput"]["deadline_misses"] == 12


def test_sustainable(replay: Cli, home: Path, tiny_log: Path) -> None:
    """With 50 ms of network, per-frame sustains about 20 Hz (a little more, the log being short), keyframes more."""
    samples = {"segment@2": [5 * 10**7], "register@1": [10**6], "propagate@1": [10**6], "fuse@1": [10**6]}
    (home / "flat.json").write_text(json.dumps({"schema": "stsem-costs/1", "machine": "m", "samples_ns": samples}))
    ran = replay(tiny_log, "--model", "oracle", "--costs", "flat.json", "--map", "off", "--sustainable", "--out", "r")
    assert ran.code == 0
    per_frame, keyframe = (run["throughput"]["sustainable_hz"] for run in report("r")["runs"])
    assert 20.0 <= per_frame < 22.5
    assert keyframe > per_frame


def test_a_distorted_camera_makes_no_map(replay: Cli, home: Path) -> None:
    """Equation 3 needs straight rays: no map, and the report says why."""
    path = write_walk(home / "fisheye.mcap", frames=4, distortion=(0.1, 0.0, 0.0, 0.0, 0.0))
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


def test_help_is_light() -> None:
    """--help loads nothing that takes time."""
    code = (
        "import sys; from stsem.cli import main\nsys.argv = ['stsem-replay', '--help']\n"
        "try: main.stsem_replay()\nexcept SystemExit as end: assert end.code == 0\n"
        "heavy = {'cv2', 'onnxruntime', 'torch', 'pandas', 'matplotlib', 'scipy', 'numpy', 'pydantic', 'mcap'}\n"
        "print(sorted(heavy & set(sys.modules)), file=sys.stderr)"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    assert ran.stderr.strip() == "[]"
    assert "--keyframes" in ran.stdout


def test_interrupted(tiny_log: Path, made_up_costs: Path, tmp_path: Path) -> None:
    """Ctrl-C in mid-replay: exit code 1, one sentence, no half-written report."""
    code = (
        "import sys\nfrom stsem.cli import main\nfrom stsem.stages import segment\n"
        "honest = segment.OracleSegmenter.segment\n"
        "def slow(self, frame):\n"
        "    if frame.index == 3:\n"
        "        print('now', flush=True)\n"
        "        import threading; threading.Event().wait(60)\n"
        "    return honest(self, frame)\n"
        "segment.OracleSegmenter.segment = slow\n"
        f"sys.argv = ['stsem-replay', {str(tiny_log)!r}, '--model', 'oracle', '--costs', {str(made_up_costs)!r}]\n"
        "main.stsem_replay()\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "now\n"
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    assert process.returncode == 1
    assert out == ""
    assert err == "stsem: Interrupted; no half-written report is left behind.\n"
    assert list(tmp_path.rglob("*")) == []
