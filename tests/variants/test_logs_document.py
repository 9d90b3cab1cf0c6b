"""docs/logs.md lists every variant, no more and no less; and what is refused is refused in these words."""

import re
from contextlib import ExitStack
from pathlib import Path

import pytest
from document import tables
from refusal_rows import REFUSALS, Refusal
from test_variants import opened
from variants_table import VARIANTS

from stsem.errors import StsemError
from stsem.log.log import Log

LOGS = Path(__file__).parents[2] / "docs" / "logs.md"


def written() -> dict[str, list[str]]:
    """Heading -> lines of the table below it, of the document."""
    found: dict[str, list[str]] = {}
    heading = ""
    for line in LOGS.read_text(encoding="utf-8").splitlines():
        if begins := re.fullmatch(r"#+ (.+)", line):
            heading = begins[1]
        elif line.startswith("|"):
            found.setdefault(heading, []).append(line)
    return found


@pytest.mark.parametrize("heading", tables())
def test_the_document_has_the_table_of_variants(heading: str) -> None:
    """`document.py` prints the tables as they should be."""
    assert written()[heading] == tables()[heading]


def test_every_variant_stands_in_one_row_and_no_other_table_names_any() -> None:
    listed = [line.split("|")[1].strip(" `") for table in tables().values() for line in table[2:]]
    assert sorted(listed) == sorted([*VARIANTS, *(refusal.variant.name for refusal in REFUSALS)])
    assert set(written()) == {*tables(), "What a log may hold", "What may be damaged", "What inspect says"}


@pytest.mark.parametrize("refusal", REFUSALS, ids=[refusal.variant.name for refusal in REFUSALS])
def test_what_is_refused(refusal: Refusal, tmp_path: Path) -> None:
    with ExitStack() as stack:
        if refusal.kind == "error":
            with pytest.raises(StsemError) as error:
                opened(refusal.variant, tmp_path, stack)
            assert str(error.value).startswith(refusal.says)
            return
        check_partly_used(opened(refusal.variant, tmp_path, stack), refusal)


def check_partly_used(log: Log, refusal: Refusal) -> None:
    """Everything else is read as ever."""
    indices = range(len(log.plans))
    loaded = list(log.frames(indices, depth=True, previous=False, truth=True))
    assert [one.index for one in loaded if one.frame is not None] == list(indices)
    if refusal.kind == "warning":
        assert any(said.startswith(refusal.says) for said in log.info.warnings)
    elif refusal.kind == "damage":
        assert str(log.info.damage) == refusal.says
    else:
        assert getattr(log.info.choice, refusal.says) is None
        assert all((one.frame.depth if refusal.says == "depth" else one.truth) is None for one in loaded if one.frame)
