"""docs/precision.md promises what the table of backends holds."""

import re
from pathlib import Path

from stsem.inference.backends import BACKENDS, PRECISIONS

TEXT = (Path(__file__).resolve().parents[2] / "docs" / "precision.md").read_text(encoding="utf-8")


def test_the_table_is_the_table_of_backends() -> None:
    rows = [
        [cell.strip(" `") for cell in line.strip("|").split("|")] for line in TEXT.splitlines() if line.startswith("|")
    ]
    header, _, *body = rows
    assert header[0] == "backend"
    assert set(header[1:]) == set(PRECISIONS)
    promised = {row[0]: {p for p, said in zip(header[1:], row[1:], strict=True) if said == "yes"} for row in body}
    assert promised == {name: set(row.precisions) for name, row in BACKENDS.items()}


def test_every_flag_shown_can_be() -> None:
    shown = re.findall(r"--backend (\S+)", TEXT), re.findall(r"--precision (\S+)", TEXT)
    assert set(shown[0]) - {"`"} <= set(BACKENDS)
    assert {word.strip("`") for word in shown[1]} <= set(PRECISIONS)
