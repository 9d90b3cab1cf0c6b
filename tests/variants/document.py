"""The tables of docs/logs.md, as the table of variants and that of refusals want them.

`PYTHONPATH=.:tests/log python tests/variants/document.py` prints them.
"""

from collections.abc import Iterable

from refusal_rows import REFUSALS, Refusal
from variant import Variant
from variants_table import SECTIONS

KINDS = {
    "error": "error: {}", "warning": "warning: {}", "damage": "damage, state `lossy`: {}",
    "unused": "not used for {}",
}  # fmt: skip


def tables() -> dict[str, list[str]]:
    """Heading -> lines of the table below it."""
    found = {heading: variant_lines(rows) for heading, rows in SECTIONS.items()}
    return {**found, "What stsem refuses, and what it says": refusal_lines(REFUSALS)}


def variant_lines(variants: Iterable[Variant]) -> list[str]:
    """Name, what differs, what is equal."""
    rows = [(f"`{v.name}`", v.how, str(v.equal)) for v in variants]
    return lines("variant", "the log", "equal to `plain`", rows=rows)


def refusal_lines(refusals: Iterable[Refusal]) -> list[str]:
    """Name, what came, what is said."""
    rows = [(f"`{r.variant.name}`", r.variant.how, KINDS[r.kind].format(r.says)) for r in refusals]
    return lines("variant", "what came", "what stsem says", rows=rows)


def lines(*heads: str, rows: Iterable[tuple[str, ...]]) -> list[str]:
    """A table in Markdown."""
    texts = [heads, ("---",) * len(heads), *rows]
    return ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in texts]


if __name__ == "__main__":
    for heading, table in tables().items():
        print(f"## {heading}\n", *table, sep="\n", end="\n\n")
