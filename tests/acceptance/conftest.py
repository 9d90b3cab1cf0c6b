"""The command in this process, in a folder of its own."""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from stsem.cli import main

Report = dict[str, Any]
Replay = Callable[..., tuple[int, Report]]


@pytest.fixture
def replay(tmp_path: Path, made_up_costs: Path, monkeypatch: pytest.MonkeyPatch) -> Replay:
    """Runs `stsem-replay ARGUMENTS` with made-up costs and without plots; (exit code, report.json)."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("STSEM_CACHE", str(tmp_path / "cache"))

    def run(*arguments: object) -> tuple[int, Report]:
        costs = () if "--clock" in arguments else ("--costs", made_up_costs)
        monkeypatch.setattr(
            sys, "argv", ["stsem-replay", *map(str, (*arguments, *costs, "--no-plots", "--out", tmp_path / "report"))]
        )
        with pytest.raises(SystemExit) as end:
            main.stsem_replay()
        assert isinstance(end.value.code, int)
        return end.value.code, json.loads((tmp_path / "report" / "report.json").read_bytes())

    return run
