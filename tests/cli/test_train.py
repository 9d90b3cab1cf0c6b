"""`stsem train`, as typed: from a log to a network that is replayed."""

import errno
import os
import re
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

pytest.importorskip("torch", reason="the extra 'train' is not installed")
pytest.importorskip("onnx", reason="the extra 'train' is not installed")

from stsem.cli import stagebar, training
from stsem.train.checkpoint import file_sha256, read_checkpoint
from stsem.train.job import Job
from stsem.train.machine import DEVICES, PRECISIONS
from stsem.train.recipe import RECIPES
from stsem.train.stages import train_stage
from tests.train.squares import SCRATCH, SIDECAR, short, write_squares

from .conftest import Cli, report

pytestmark = pytest.mark.torch
LOGS = Path(__file__).parents[2] / "logs"
SMALL = ("--iterations", "3", "--batch", "2", "--crop", "40x40", "--precision", "f32")


def test_from_a_log_to_a_replay(cli: Cli, home: Path) -> None:
    """Three stages, curves, an ONNX file with its sidecar, and a closing line that is a command which works."""
    arguments = ("train", LOGS / "tiny-a.mcap", "--validation", LOGS / "tiny-b.mcap", "--architecture", "pspnet-r18-w1",
                 "--out", "net", "--size", "89x41", *SMALL)  # fmt: skip
    ran = cli(*arguments)
    assert ran.code == 0, ran.err
    assert "The crop 40x40 becomes 41x41: the sides of pspnet-r18-w1 are 48 k - 7." in ran.err
    for stage, iterations in (("colour", 3), ("difference", 3), ("fused", 1)):
        assert re.search(rf"^{iterations}/{iterations}, loss \d\.\d+, rate .*, validation mIoU", ran.err, re.MULTILINE)
        rows = (home / "net" / stage / "curves.csv").read_text().splitlines()
        assert rows[0].startswith("iteration,loss,rate,validation_miou")
        assert len(rows) == 1 + iterations
        assert (home / "net" / stage / "curves.png").read_bytes().startswith(b"\x89PNG")
    command = ran.out.splitlines()[-1].partition("Replay:")[2].split()
    assert command[:3] == ["stsem", "replay", str(LOGS / "tiny-b.mcap")]
    replayed = cli(*command[1:], "--clock", "offline", "--mode", "per-frame", "--out", "report", "--no-plots")
    assert replayed.code == 0, replayed.err
    run = report("report")["runs"][0]
    assert (run["outcomes"]["segmented"], run["offline"]["pixel_accuracy"] > 0) == (40, True)


def test_stopped_by_ctrl_c(cli: Cli, home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Exit code 130, one sentence, and the same command goes on to what it would have been."""
    arguments = (
        "train",
        LOGS / "tiny-a.mcap",
        "--architecture",
        "fcn-32s-w1",
        "--out",
        "net",
        "--size",
        "64x64",
        *SMALL,
    )
    with monkeypatch.context() as patch:
        patch.setattr(training, "shown", _interrupting)
        ran = cli(*arguments)
    assert ran.code == 130
    assert ran.err.strip().splitlines()[-1] == (
        "stsem: The stage colour was stopped after 2 of 3 iterations. The same command goes on from there."
    )
    assert cli(*arguments).code == 0
    assert cli(*arguments[:5], "other", *arguments[6:]).code == 0
    nets = [(home / folder / "fcn-32s-w1.onnx").read_bytes() for folder in ("net", "other")]
    assert nets[0] == nets[1]


@contextmanager
def _interrupting(job: Any) -> Iterator[Any]:
    yield lambda now: os.kill(os.getpid(), signal.SIGINT) if now.iteration == 1 else None


def test_from_given_weights(cli: Cli, home: Path) -> None:
    """Those of a stage for other classes: what was taken is said, and the recipe's wish is met."""
    job = Job("pspnet-r18-spatial-w1", "colour", SIDECAR, short(SCRATCH, 1))
    weights = train_stage(job, write_squares(home / "pairs", 2), None, home / "first", lambda _: None)
    second = ("train", LOGS / "tiny-a.mcap", "--out", "second", "--recipe", "paper", "--size", "41x41",
              "--architecture", "pspnet-r18-spatial-w1", *SMALL)  # fmt: skip
    ran = cli(*second, "--weights", weights)
    assert ran.code == 0, ran.err
    assert "140 of 144 taken" in ran.err
    assert "4 made for other classes, unchanged: colour.head.4.weight" in ran.err
    assert "presumes weights" not in ran.err
    without = cli(*second)
    assert without.code == 1
    assert "of another training: the weights to begin with differ." in without.err
    assert "The recipe paper presumes weights that were trained elsewhere" in without.err


def test_help_names_every_choice(cli: Cli, wide_terminal: None) -> None:
    """Beside its option; and the architecture and recipe that are taken without one."""
    lines = cli("train", "--help").out.splitlines()
    for option, choices in (("--recipe", RECIPES), ("--device", DEVICES), ("--precision", PRECISIONS)):
        (line,) = (line for line in lines if re.match(rf"\W*{option}(?!\S)", line))
        assert all(re.search(rf"\b{choice}\b", line) for choice in choices)


@pytest.mark.parametrize(("arguments", "code", "sentence"), [
    (("none.mcap",), 1, "none.mcap"),
    (("empty",), 1, "The folder empty holds no log"),
    ((LOGS / "tiny-a.mcap", "--architecture", "pspnet"), 2, "no architecture 'pspnet'"),
    ((LOGS / "tiny-a.mcap", "--recipe", "fast"), 2, "no recipe 'fast'; choose paper or scratch"),
    ((LOGS / "tiny-a.mcap", "--crop", "big"), 2, "--crop takes WIDTHxHEIGHT"),
    ((LOGS / "tiny-a.mcap", "--iterations", "0"), 2, "iterations = 0; it must be at least 1"),
    ((LOGS / "tiny-a.mcap", "--stages", "colour,sound"), 2, "has colour, difference, fused"),
    ((LOGS / "tiny-a.mcap", "--size", "100x100"), 2, "use 89x89"),
    ((LOGS / "tiny-a.mcap", "--device", "tpu"), 2, "--device takes auto, cpu, cuda"),
    ((LOGS / "tiny-a.mcap", "--workers", "0"), 2, "at least 1"),
    ((LOGS / "tiny-a.mcap", "--validation", LOGS / "tiny-a.mcap"), 2, "was given twice"),
    ((LOGS / "tiny-a.mcap", "--validation", "copy.mcap"), 2, "trained on and validated with"),
    ((LOGS / "tiny-a.mcap", "--class-map", "none.toml"), 1, "none.toml cannot be read"),
    ((LOGS / "tiny-a.mcap", "--weights", "none.pth"), 1, "none.pth"),
    ((LOGS / "tiny-a.mcap", "--out", "copy.mcap"), 1, "copy.mcap"),
    ((LOGS / "tiny-a.mcap", "--batch", "1", "--crop", "41x41"), 1, "Batches of one view"),
])  # fmt: skip
def test_what_cannot_be_trained(cli: Cli, home: Path, arguments: tuple[object, ...], code: int, sentence: str) -> None:
    """One sentence, after at most a few notes."""
    (home / "empty").mkdir()
    (home / "copy.mcap").write_bytes((LOGS / "tiny-a.mcap").read_bytes())
    ran = cli("train", *arguments)
    last = ran.err.strip().splitlines()[-1]
    assert (ran.code, ran.out) == (code, "")
    assert sentence in last
    assert last.startswith("stsem: ")
    assert "defect" not in last


def test_a_stage_without_those_before_it_begins_at_random(cli: Cli, home: Path) -> None:
    """And says so; a batch of one ends it here."""
    common = (LOGS / "tiny-a.mcap", "--architecture", "pspnet-r18-w1", "--batch", "1", "--crop", "41x41")
    said = {stages: cli("train", *common, "--stages", stages).err for stages in ("colour", "difference", "fused")}
    assert "begins with random weights" not in said["colour"]
    assert "The stage difference begins with random weights: --stages leaves out colour.\n" in said["difference"]
    assert "stage fused begins with random weights: --stages leaves out colour and difference.\n" in said["fused"]


def test_a_stage_goes_on_from_the_one_that_an_earlier_command_finished(cli: Cli, home: Path) -> None:
    """Colour, then difference, which starts from it; a colour stream of other numbers is not taken."""
    common = ("train", LOGS / "tiny-a.mcap", "--architecture", "pspnet-r18-w1", "--size", "41x41", "--out", "net")
    assert cli(*common, *SMALL, "--stages", "colour").code == 0
    other = cli(*common, *SMALL, "--stages", "difference", "--batch", "1")
    assert (
        "The stage difference begins with random weights: --stages leaves out colour, and what net has of it is not "
        "finished, or of another training.\n" in other.err
    )
    after = cli(*common, *SMALL, "--stages", "difference")
    assert (after.code, "random weights" in after.err) == (0, False), after.err
    assert "The colour stream is the finished one in net/colour/checkpoint.pt.\n" in after.err
    colour, difference = (home / "net" / stage / "checkpoint.pt" for stage in ("colour", "difference"))
    assert read_checkpoint(difference)["starts"] == {"colour": file_sha256(colour)}


def test_validation_without_truth_is_refused(cli: Cli, home: Path) -> None:
    """It would be judged as nothing, at the end of a long training."""
    for kind, content in (("images", np.zeros((8, 9, 3), np.uint8)), ("labels", np.full((8, 9), 255, np.uint8))):
        (home / "blank" / kind).mkdir(parents=True)
        cv2.imwrite(str(home / "blank" / kind / "0.png"), content)
    (home / "blank" / "classes.txt").write_text("wall\nfloor")
    ran = cli("train", LOGS / "tiny-a.mcap", "--validation", home / "blank", "--out", "net", *SMALL)
    assert ran.code == 2
    assert "No pixel of the validation data has a label that is learned; give data with truth." in ran.err


def test_a_picture_that_cannot_be_written_stops_nothing(cli: Cli, home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nor does it hide why a training stopped."""
    monkeypatch.setattr(stagebar, "write_aside", _full)
    ran = cli("train", LOGS / "tiny-a.mcap", "--architecture", "fcn-32s-w1", "--out", "net", "--size", "64x64", *SMALL)
    assert ran.code == 0, ran.err
    assert "curves.png cannot be written: No space left on device." in ran.err
    assert (home / "net" / "fcn-32s-w1.onnx").exists()


def _full(path: Path, data: bytes) -> None:
    raise OSError(errno.ENOSPC, "No space left on device")
