"""What docs/logs.md says about inspect is what inspect says."""

import re
import shutil
from pathlib import Path

import pytest

from stsem.log.doctor.checks import CHECKS

from .conftest import Cli

ROOT = Path(__file__).parents[2]
SECTION = re.compile(r"^## What inspect says\n(.*?)(?=^## |\Z)", re.DOTALL | re.MULTILINE)
SHOWN = re.compile(r"```\n\$ stsem inspect (\S+)\n(.*?)```", re.DOTALL)
SHARED = ("7scenes-kitchen-a.mcap", "camvid-0016E5-15hz.mcap", "replica-floor1.mcap")


def section() -> str:
    found = SECTION.search((ROOT / "docs" / "logs.md").read_text())
    assert found
    return found[1]


def shown() -> dict[str, str]:
    return dict(SHOWN.findall(section()))


def test_the_table_of_findings_is_the_table_of_checks() -> None:
    rows = re.findall(r"^\| `(\S+)` \| (.*?) \| (.*?) \|$", section(), re.MULTILINE)
    assert rows == [(check.name, check.when, check.do or "nothing: a note") for check in CHECKS]


def test_the_rendered_log(cli: Cli, home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "120")
    shutil.copy(ROOT / "logs" / "office.mcap", home)
    assert cli("inspect", "office.mcap").out == shown()["office.mcap"]


@pytest.mark.shared_logs
@pytest.mark.parametrize("name", SHARED)
def test_the_shared_logs(cli: Cli, shared_logs: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.chdir(shared_logs)
    assert cli("inspect", name).out == shown()[name]


def test_flags_that_findings_name_exist(cli: Cli, wide_terminal: None) -> None:
    known = set(re.findall(r"--[a-z-]+", cli("replay", "--help").out + cli("convert", "--help").out))
    named = {flag for check in CHECKS for flag in re.findall(r"--[a-z-]+", check.do)}
    assert named
    assert named <= known
