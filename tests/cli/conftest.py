"""The commands, called in this process and in a folder of their own."""

import csv
import io
import json
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from typer import rich_utils

from stsem.cli import main


@dataclass(frozen=True)
class Ran:
    """What a command left: exit code, stdout, stderr."""

    code: int
    out: str
    err: str

    @property
    def sentence(self) -> str:
        """The one line on stderr without the command's name; fails unless it is exactly one."""
        lines = self.err.strip().splitlines()
        assert len(lines) == 1, self.err
        assert lines[0].startswith("stsem: "), lines[0]
        assert "defect of stsem" not in lines[0], lines[0]
        return lines[0].removeprefix("stsem: ")


Cli = Callable[..., Ran]


def report(folder: Path | str) -> dict[str, Any]:
    """report.json as plain data."""
    document: dict[str, Any] = json.loads((Path(folder) / "report.json").read_bytes())
    return document


def rows(folder: Path | str) -> list[dict[str, str]]:
    """frames.csv."""
    return list(csv.DictReader(io.StringIO((Path(folder) / "frames.csv").read_text())))


@pytest.fixture
def wide_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """A terminal wide enough for no line to be broken, without colours."""
    monkeypatch.setattr(rich_utils, "MAX_WIDTH", 400)  # typer reads TERMINAL_WIDTH once, on import
    monkeypatch.setenv("NO_COLOR", "1")


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty current folder with an empty cache beside it."""
    folder = tmp_path / "home"
    folder.mkdir()
    monkeypatch.chdir(folder)
    monkeypatch.setenv("STSEM_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("COLUMNS", "120")  # what is printed does not depend on the terminal that the tests run in
    return folder


@pytest.fixture
def cli(home: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Cli:
    """Runs `stsem ARGUMENTS`."""

    def run(*arguments: object) -> Ran:
        monkeypatch.setattr(sys, "argv", ["stsem", *map(str, arguments)])
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            main.stsem()
        caught = capsys.readouterr()
        code = end.value.code
        return Ran(code if isinstance(code, int) else int(bool(code)), caught.out, caught.err)

    return run


@pytest.fixture
def replay(cli: Cli, made_up_costs: Path) -> Cli:
    """Runs `stsem replay ARGUMENTS` with the made-up costs and without plots."""

    def run(*arguments: object) -> Ran:
        costs = () if "--costs" in arguments or "--clock" in arguments else ("--costs", made_up_costs)
        return cli("replay", *arguments, *costs, "--no-plots")

    return run
