"""What docs/logs.md says in tables and examples is what the reader knows and takes."""

import re
from pathlib import Path

import pytest

from stsem.log.classtable import read_file
from stsem.log.container.damage import KINDS

TEXT = (Path(__file__).parents[2] / "docs" / "logs.md").read_text(encoding="utf-8")


def section(title: str) -> str:
    found = re.search(rf"^## {title}\n(.*?)(?=^## |\Z)", TEXT, re.DOTALL | re.MULTILINE)
    assert found
    return found[1]


def test_every_kind_of_damage_has_a_row() -> None:
    """In the order of KINDS."""
    rows = re.findall(r"^\| (`.*?`) \| (?:.+?) \| (?:.+?) \|$", section("What may be damaged"), re.MULTILINE)
    assert tuple(kind for row in rows for kind in re.findall(r"`(\w+)`", row)) == KINDS


EXAMPLES = re.findall(r"^```(json|toml)\n(.*?)```$", section("A class table of your own"), re.DOTALL | re.MULTILINE)
TAKEN = [
    (("wall", "floor", "chair"), (0, 1, 2), (), (255,)),
    (("wall", "floor", "chair"), (1, 2, 7), (), (255,)),
    (("wall", "floor"), (1, 2), ((120, 120, 120), (80, 50, 50)), (0,)),
    (("wall", "floor"), (1, 2), ((120, 120, 120), (80, 50, 50)), (255,)),
    (("wall", "floor", "chair"), (0, 1, 2), ((120, 120, 120), (80, 50, 50), (204, 68, 85)), (200,)),
    (("wall", "floor"), (1, 2), ((120, 120, 120), (80, 50, 50)), (255,)),
]


@pytest.mark.parametrize(("example", "taken"), list(zip(EXAMPLES, TAKEN, strict=True)))
def test_an_example_of_a_class_table(tmp_path: Path, example: tuple[str, str], taken: tuple[object, ...]) -> None:
    """Names, ids, colours, ignored ids; without any, 255 is ignored all the same."""
    path = tmp_path / f"classes.{example[0]}"
    path.write_text(example[1])
    table = read_file(path)
    ignored = tuple({*table.ignored} or {255})
    assert (table.classes.names, table.raw_ids, table.classes.colours, ignored) == taken
