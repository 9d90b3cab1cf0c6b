"""Documents keep what they promise: nothing left to fill in, no link into nowhere, no package that is not required."""

import re
import tomllib
from pathlib import Path

import pytest

from stsem.replay import documents

ROOT = Path(__file__).parents[1]
FOLDERS = ("docs", "stsem", "tests", "bench", "ci", "logs")
WRITTEN = sorted({*ROOT.glob("*.md"), *(path for folder in FOLDERS for path in (ROOT / folder).rglob("*.md"))})
LINKED = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
_LINK = re.compile(r"\]\(\s*<?([^)\s>]+)")
_ELSEWHERE = ("http://", "https://", "mailto:", "#")
_PLACEHOLDERS = ("@@", "TABLE_")


def named(path: Path) -> str:
    return str(path.relative_to(ROOT))


def links(path: Path) -> list[str]:
    """Targets of the links to files of the project, without anchors."""
    text = re.sub(r"^```.*?^```", "", path.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    return [target.partition("#")[0] for target in _LINK.findall(text) if not target.startswith(_ELSEWHERE)]


@pytest.mark.parametrize("path", WRITTEN, ids=named)
def test_nothing_is_left_to_fill_in(path: Path) -> None:
    left = [line for line in path.read_text(encoding="utf-8").splitlines() if any(p in line for p in _PLACEHOLDERS)]
    assert left == []


@pytest.mark.parametrize("path", LINKED, ids=named)
def test_every_link_leads_somewhere(path: Path) -> None:
    assert [target for target in links(path) if not (path.parent / target).exists()] == []


def test_links_are_found() -> None:
    """The README has some, to files and to folders; the checks above do look at something."""
    assert {"CONTRIBUTING.md", "docs/metrics.md"} <= set(links(ROOT / "README.md"))
    assert {"README.md", "CONTRIBUTING.md", "CHANGELOG.md"} <= set(map(named, WRITTEN))


def test_reported_versions_are_of_required_packages() -> None:
    """A report names versions; a package that an installation may lack would be an error there."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    required = {re.split(r"[^A-Za-z0-9._-]", entry)[0] for entry in project["dependencies"]}
    assert documents._PACKAGES
    assert set(documents._PACKAGES) <= required
