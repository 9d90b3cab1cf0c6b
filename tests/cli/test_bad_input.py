"""Bad input: one clear sentence on stderr, the right exit code, never a traceback, never a report."""

import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from .conftest import Cli


def no_report(home: Path) -> bool:
    """Whether nothing that looks like a report, whole or half, lies in the current folder."""
    return not [*home.rglob("report.json"), *home.rglob(".*.[0-9]*")]


def png_named_mcap(folder: Path) -> Path:
    path = folder / "picture.mcap"
    path.write_bytes(bytes(cv2.imencode(".png", np.zeros((8, 8, 3), np.uint8))[1]))
    return path


def empty_file(folder: Path) -> Path:
    path = folder / "empty.mcap"
    path.touch()
    return path


def empty_folder(folder: Path) -> Path:
    path = folder / "recording"
    path.mkdir()
    return path


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda folder: folder / "missing.mcap", ["There is no file", "missing.mcap", "give"]),
        (empty_folder, ["recording", "no .mcap file", "give"]),
        (empty_file, ["empty.mcap", "empty"]),
        (png_named_mcap, ["picture.mcap", "MCAP"]),
    ],
    ids=["missing", "empty folder", "empty file", "a PNG"],
)
def test_no_log(replay: Cli, home: Path, make: Callable[[Path], Path], words: list[str]) -> None:
    """Whatever is not a recording is named and refused, by the replay and by the inspection."""
    path = make(home)
    ran = replay(path)
    assert ran.code == 1
    assert all(word in ran.sentence for word in words), ran.sentence
    assert ran.out == ""
    assert no_report(home)


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["--topic", "color=/nowhere"], 1, ["/nowhere", "/camera/color"]),
        (["--topic", "labels=/pose"], 1, ["/pose"]),
        (["--topic", "colour=/camera/color"], 2, ["colour", "did you mean 'color'?"]),
        (["--topic", "color"], 2, ["role=topic", "'color'"]),
        (["--classes", "nowhere.json"], 1, ["nowhere.json", "class table"]),
        (["--class-map", "nowhere.toml"], 1, ["nowhere.toml", "class map"]),
        (["--config", "nowhere.toml"], 2, ["nowhere.toml"]),
        (["--costs", "nowhere.json"], 1, ["nowhere.json", "profile"]),
        (["--model", "nowhere.onnx"], 1, ["nowhere.onnx"]),
        (["--model", "defualt"], 1, ["defualt", "default", "oracle"]),
        (["--mode", "keyframes"], 2, ["keyframes", "per-frame"]),
        (["--mode", ","], 2, ["No mode", "per-frame"]),
        (["--clock", "wall"], 2, ["clock", "real-time", "wall"]),
        (["--backend", "tensorrt"], 2, ["backend", "onnxruntime", "tensorrt"]),
        (["--backend", "tensorrt", "--model", "oracle"], 2, ["backend", "onnxruntime", "tensorrt"]),
        (["--class-map", "nowhere.toml", "--model", "oracle"], 1, ["nowhere.toml", "class map"]),
        (["--map", "maybe"], 2, ["map", "on or off", "'maybe'"]),
        (["--set", "map=2"], 2, ["map", "on or off", "2"]),
        (["--precision", "f16"], 2, ["precision", "f32", "f16"]),
        (["--precision", "bf16"], 2, ["bf16", "onnxruntime", "--backend openvino"]),
        (["--pose", "gps"], 2, ["pose", "log", "slam", "gps"]),
        (["--propagation", "magic"], 2, ["magic", "homography"]),
        (["--keyframes", "every:0"], 2, ["every:0", "every:N"]),
        (["--keyframes", "every:" + "9" * 30], 2, ["keyframe policy"]),
        (["--keyframes", "sometimes"], 2, ["sometimes", "paper"]),
        (["--queue", "fifo:0"], 2, ["fifo:0", "lossless"]),
        (["--queue", "fifo:x"], 2, ["fifo:x", "queue rule"]),
        (["--rate", "0"], 2, ["rate", "1/1000"]),
        (["--rate", "fast"], 2, ["rate", "fast", "3/2"]),
        (["--rate", "inf"], 2, ["rate", "inf"]),
        (["--cores", "0"], 2, ["cores", "0"]),
        (["--deadline-ms", "-1"], 2, ["deadline_ms", "-1"]),
        (["--deadline-ms", "inf"], 2, ["deadline_ms", "inf"]),
        (["--set", "keyframe_time_s=inf"], 2, ["keyframe_time_s", "inf"]),
        (["--set", "keyframe_rotation=inf"], 2, ["keyframe_rotation", "inf"]),
        (["--set", "keyframe_rotation=nan"], 2, ["keyframe_rotation", "nan"]),
        (["--set", "keyframe_rotatoin=1"], 2, ["keyframe_rotatoin", "did you mean 'keyframe_rotation'?"]),
        (["--set", "seed"], 2, ["key=value", "seed"]),
        (["--set", "mode.x=1"], 2, ["mode"]),
        (["--set", "topic.color=/camera/color", "--set", "topic=5"], 2, ["topic", "5"]),
        (["--set", "topic.colour=/camera/color"], 2, ["topic", "colour"]),
        (["--set", "seed=-1"], 2, ["seed", "-1"]),
        (["--set", "seed=x"], 2, ["seed", "x"]),
        (["--set", "map=maybe"], 2, ["map", "maybe"]),
        (["--repeat", "0"], 2, ["repeat", "0"]),
        (["--depth-registered", "perhaps"], 2, ["depth_registered", "perhaps"]),
        (["--start", "2", "--end", "1"], 2, ["window", "1 s", "2 s"]),
        (["--start", "1000"], 2, ["--start 1000", "1.100 s"]),
        (["--start", "1e300"], 2, ["start", "1e+300"]),
        (["--start", "inf"], 2, ["start", "inf"]),
        (["--start", "nan"], 2, ["start", "nan"]),
        (["--start", "soon"], 2, ["--start", "number"]),
        (["--strat", "1"], 2, ["--strat", "--start"]),
        (["--costs", "measured", "--sustainable"], 2, ["--sustainable", "auto"]),
        (["--costs", "measured", "--count-decode"], 2, ["--count-decode", "auto"]),
    ],
    ids=lambda value: " ".join(value)[:40] if isinstance(value, list) else None,
)
def test_arguments_that_cannot_be(
    replay: Cli, home: Path, tiny_log: Path, arguments: list[str], code: int, words: list[str]
) -> None:
    """Each is one sentence that says what came and what can be; nothing is written."""
    ran = replay(tiny_log, *arguments)
    assert all(word in ran.sentence for word in words), ran.sentence
    assert len(ran.sentence) < 400
    assert ran.code == code
    assert no_report(home)


def test_no_log_at_all(replay: Cli) -> None:
    """The command says what is missing."""
    ran = replay()
    assert ran.code == 2
    assert "LOG" in ran.sentence


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("mode = 'keyframe'\nqueu = 'latest'\n", ["queu", "stsem.toml", "did you mean 'queue'?"]),
        ("mode = keyframe\n", ["stsem.toml", "not valid TOML"]),
        ("[mode]\nx = 1\n", ["mode"]),
        ("topic = 'color'\n", ["topic"]),
        ("cores = 'two'\n", ["cores", "two"]),
    ],
    ids=["unknown key", "no TOML", "table", "no table", "wrong type"],
)
def test_configuration_file(replay: Cli, home: Path, tiny_log: Path, text: str, words: list[str]) -> None:
    """A typo in stsem.toml is a usage error that names the file or the key."""
    (home / "stsem.toml").write_text(text)
    ran = replay(tiny_log)
    assert ran.code == 2
    assert all(word in ran.sentence for word in words), ran.sentence


def test_environment(replay: Cli, tiny_log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A misspelt variable is no silent default."""
    monkeypatch.setenv("STSEM_QUEU", "latest")
    ran = replay(tiny_log)
    assert ran.code == 2
    assert "queu" in ran.sentence
    assert "did you mean 'queue'?" in ran.sentence


@pytest.mark.parametrize("target", ["file", "file/below"])
def test_unwritable_output(replay: Cli, home: Path, tiny_log: Path, target: str) -> None:
    """A place below a file cannot be written, and that is said before the replay."""
    (home / "file").write_text("mine")
    ran = replay(tiny_log, "--model", "oracle", "--out", target)
    assert ran.code == 1
    assert target in ran.sentence
    assert "--out" in ran.sentence
    assert (home / "file").read_text() == "mine"


@pytest.mark.parametrize("place", ["reports", "reports/tiny"])
def test_default_output_is_a_file(
    replay: Cli, home: Path, tiny_log: Path, place: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`reports` may be a file, too: said before the log is even opened."""
    monkeypatch.delattr("stsem.cli.session.open_log")
    (home / place).parent.mkdir(exist_ok=True)
    (home / place).write_text("mine")
    ran = replay(tiny_log, "--model", "oracle")
    assert ran.code == 1
    assert place in ran.sentence
    assert "--out" in ran.sentence
    assert (home / place).read_text() == "mine"


def test_folder_of_others(replay: Cli, home: Path, tiny_log: Path) -> None:
    """A folder that is no report is left alone."""
    (home / "thesis").mkdir()
    (home / "thesis" / "chapter.txt").write_text("mine")
    ran = replay(tiny_log, "--model", "oracle", "--out", "thesis")
    assert ran.code == 1
    assert "thesis" in ran.sentence
    assert [p.name for p in (home / "thesis").iterdir()] == ["chapter.txt"]


def test_cache_below_a_file(replay: Cli, home: Path, tiny_log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A cache folder that cannot be made names the variable."""
    (home / "file").write_text("mine")
    monkeypatch.setenv("STSEM_CACHE", str(home / "file" / "cache"))
    ran = replay(tiny_log)
    assert ran.code == 1
    assert "STSEM_CACHE" in ran.sentence


def test_two_logs_of_one_name(replay: Cli, home: Path, tiny_log: Path) -> None:
    """Two reports never land in one folder."""
    for folder in ("a", "b"):
        (home / folder).mkdir()
        (home / folder / "log.mcap").write_bytes(tiny_log.read_bytes())
    ran = replay("a/log.mcap", "b/log.mcap", "--model", "oracle", "--out", "both")
    assert ran.code == 2
    assert "log" in ran.sentence
    assert no_report(home)


def test_every_verb_refuses_alike(cli: Cli, home: Path, tiny_log: Path) -> None:
    """One sentence from the other verbs, too."""
    profile = home / "p.json"
    profile.write_text(json.dumps({"schema": "stsem-costs/1", "machine": "m", "samples_ns": {"segment@2": [5]}}))
    for code, *arguments in (
        (1, "inspect", "missing.mcap"),
        (2, "inspect", tiny_log, "--topic", "color"),
        (2, "gate", "missing"),
        (1, "costs", "scale", "missing.json", "--out", "x.json", "--by", "2"),
        (2, "costs", "scale", profile, "--out", "x.json", "--by", "twice"),
        (1, "costs", "scale", profile, "--out", "x.json", "--by", "nothing=2"),
        (1, "costs", "scale", profile, "--out", "p.json/x.json", "--by", "2"),
        (1, "costs", "measure", "missing.mcap", "--out", "x.json"),
        (2, "costs", "measure", tiny_log, "--out", "x.json", "--propagation", "magic"),
        (2, "costs", "measure", tiny_log, "--out", "x.json", "--backend", "tensorrt"),
        (2, "synth", "x.mcap", "--size", "big"),
        (2, "synth", "x.mcap", "--size", "²x32"),
        (2, "nonsense"),
    ):
        ran = cli(*arguments)
        assert (ran.code, ran.sentence != "") == (code, True), (arguments, ran)
