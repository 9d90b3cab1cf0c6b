"""Promise P1: the same log, config and costs give the same bytes, and a replay that does not is caught."""

import json
import os
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

from .conftest import Cli, report, rows

COMMANDS = Path(sys.executable).parent


@pytest.fixture(scope="module")
def twins(tiny_log: Path, made_up_costs: Path, tmp_path_factory: pytest.TempPathFactory) -> list[tuple[Path, str]]:
    """(folder, stdout) of two processes with other thread settings, hash seeds, time zones and empty caches."""
    found, costs = [], tmp_path_factory.mktemp("costs") / "depth.json"
    made_for = {"propagation": "depth", "register": "points and the method's own"}
    costs.write_text(json.dumps(json.loads(made_up_costs.read_text()) | {"made_for": made_for}))
    for n, threads in enumerate(("1", "4")):
        home = tmp_path_factory.mktemp("home")
        environment = os.environ | {
            "STSEM_CACHE": str(home / "cache"), "OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads,
            "OPENCV_FOR_THREADS_NUM": threads, "PYTHONHASHSEED": str(n), "TZ": ("UTC", "Asia/Tokyo")[n],
        }  # fmt: skip
        ran = subprocess.run(
            [COMMANDS / "stsem-replay", tiny_log, "--costs", costs, "--mode", "both,keyframe-async"],
            env=environment, check=True, capture_output=True, text=True, timeout=300, cwd=home,
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

    def moody(self: Inferencer, frame: Any) -> Output:
        calls.append(1)
        answer = honest(self, frame)
        if len(calls) != 3:
            return answer
        return Output(np.full_like(answer.labels, 2 if (answer.labels == 0).any() else 0), answer.confidence)

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
