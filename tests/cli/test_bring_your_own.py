"""docs/bring-your-own-network.md, followed literally: its files are written, its commands run, its output compared."""

import re
import runpy
import shlex
import shutil
import warnings
from dataclasses import dataclass
from pathlib import Path

import pytest

pytest.importorskip("torch", reason="the extra 'train' is not installed")
pytest.importorskip("onnx", reason="the extra 'train' is not installed")

from .conftest import Cli, Ran, report

pytestmark = pytest.mark.torch
ROOT = Path(__file__).parents[2]
DOCUMENT = (ROOT / "docs" / "bring-your-own-network.md").read_text(encoding="utf-8")
_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_NAME = re.compile(r"# (\S+)\n")
_EXIT = re.compile(r"\(exit code (\d)\)")


@dataclass(frozen=True)
class Step:
    """A command as typed, lines that its output has, and its exit code."""

    command: tuple[str, ...]
    shown: tuple[str, ...]
    code: int


def steps(block: str) -> list[Step]:
    """What a console block asks for."""
    found = []
    for part in block.split("$ ")[1:]:
        command, *lines = part.strip().splitlines()
        codes = [int(match[1]) for line in lines if (match := _EXIT.fullmatch(line))]
        shown = tuple(line for line in lines if not _EXIT.fullmatch(line))
        found.append(Step(tuple(shlex.split(command)), shown, codes[0] if codes else 0))
    return found


def run(step: Step, cli: Cli) -> Ran:
    """In this process; `python FILE` too."""
    program, *arguments = step.command
    if program == "python":
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # torch's exporter deprecates its own internals
            runpy.run_path(arguments[0], run_name="__main__")
        return Ran(0, "", "")
    return cli(*arguments) if program == "stsem" else cli("replay", *arguments)


def test_the_document(cli: Cli, home: Path) -> None:
    """Every block, in order."""
    shutil.copy(ROOT / "logs" / "tiny-a.mcap", home)
    count = 0
    for language, block in _BLOCK.findall(DOCUMENT):
        if language != "console":
            name = _NAME.match(block)
            assert name, f"a block without a file name: {block[:60]}"
            Path(name[1]).write_text(block, encoding="utf-8")
            continue
        for step in steps(block):
            ran = run(step, cli)
            assert ran.code == step.code, f"{step.command}: {ran.err}"
            assert [line for line in step.shown if line not in ran.out] == [], ran.out
            count += 1
    assert count == len(re.findall(r"^\$ ", DOCUMENT, re.MULTILINE)) == 7
    runs = report("reports/adopted")["runs"]
    assert all(run["outcomes"]["segmented"] >= 1 for run in runs)
    assert runs[0]["offline"]["miou"] > 0
