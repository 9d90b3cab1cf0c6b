"""The whole line, from a log to its report, through the command."""

import json
import signal
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest

from .conftest import Cli, report, rows


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


def test_a_trace_gives_its_timing_again(replay: Cli, home: Path, tiny_log: Path) -> None:
    """--costs trace.json reproduces the schedule to the nanosecond; another log or machine is refused."""
    assert replay(tiny_log, "--model", "oracle", "--out", "first").code == 0
    assert replay(tiny_log, "--model", "oracle", "--costs", "first/trace.json", "--out", "second").code == 0
    assert (home / "first" / "trace.json").read_bytes() == (home / "second" / "trace.json").read_bytes()
    assert (home / "first" / "frames.csv").read_bytes() == (home / "second" / "frames.csv").read_bytes()
    medians = [
        [run["latency_ms"]["from_arrival"]["p50"] for run in report(name)["runs"]] for name in ("first", "second")
    ]
    assert medians == [[None, None], [None, None]]  # four samples make no median, replayed from a trace or not
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


@pytest.mark.parametrize(
    ("number", "how"),
    [
        (signal.SIGINT, "Interrupted"),
        (signal.SIGTERM, "Ended by SIGTERM"),
        (signal.SIGHUP, "Ended by SIGHUP"),
    ],
)
def test_interrupted(tiny_log: Path, made_up_costs: Path, tmp_path: Path, number: int, how: str) -> None:
    """Ctrl-C in mid-replay, or a job that is ended: exit code 1, one sentence, no half-written report."""
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
        process.send_signal(number)
        out, err = process.communicate(timeout=60)
    assert process.returncode == 1
    assert out == ""
    assert err == f"stsem: {how}; nothing half-written is left behind.\n"
    assert list(tmp_path.rglob("*")) == []
