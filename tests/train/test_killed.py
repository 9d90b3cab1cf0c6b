"""A training that is killed, SIGKILL, and started again ends with the weights of one that was not."""

import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

torch = pytest.importorskip("torch", reason="the extra 'train' is not installed")

from stsem.train.checkpoint import read_checkpoint
from stsem.train.job import Job
from stsem.train.stages import train_stage

from .squares import SCRATCH, SIDECAR, write_squares

pytestmark = pytest.mark.torch
ROOT = Path(__file__).parents[2]
RECIPE = replace(SCRATCH, iterations=10, crop=(41, 41), checkpoint_every=3, report_every=1)
JOB = Job("pspnet-r18-spatial-w1", "colour", SIDECAR, RECIPE, seed=1)


def test_killed_at_several_moments(tmp_path: Path) -> None:
    """In the middle of writing the first checkpoint, and between two."""
    write_squares(tmp_path / "pairs")
    for moment, left in (("save:3", None), ("step:8", 6)):
        command = [sys.executable, str(Path(__file__).with_name("killed.py"))]
        ended = subprocess.run([*command, tmp_path / "pairs", tmp_path / "killed", moment], check=False, cwd=ROOT,
                               env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True)  # fmt: skip
        assert ended.returncode == -signal.SIGKILL, ended.stderr.decode()
        path = tmp_path / "killed" / "checkpoint.pt"
        assert (read_checkpoint(path)["iteration"] if path.exists() else None) == left
    pairs = write_squares(tmp_path / "pairs")
    again, whole = (read_checkpoint(train_stage(JOB, pairs, None, tmp_path / name, lambda _: None))
                    for name in ("killed", "whole"))  # fmt: skip
    assert again["losses"] == whole["losses"]
    assert all(torch.equal(again["mean"][key], whole["mean"][key]) for key in whole["mean"])
    assert sorted(file.name for file in (tmp_path / "killed").iterdir()) == ["checkpoint.pt", "curves.csv"]
