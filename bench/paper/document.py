"""The tables as Markdown, in files of their own and in docs/paper-tables.md between its markers."""

import re
from collections.abc import Iterable
from pathlib import Path

from bench.paper.markdown import PARTS
from bench.paper.results import collect, load
from stsem.aside import aside
from stsem.errors import UsageError

ROOT = Path(__file__).resolve().parents[2]
DOCUMENT = ROOT / "docs" / "paper-tables.md"
COMMITTED = ROOT / "bench" / "paper" / "results"


def write_tables(out: Path, data: str, tables: Iterable[str]) -> list[Path]:
    """`OUT/NAME-table1.md` and so on, from the results under `out`; the files written."""
    found = load(out / "results" / data)
    written = []
    for table in tables:
        path = out / f"{data}-{table}.md"
        _write(path, PARTS[table](collect(found)) + "\n" if found else "Nothing has been measured yet.\n")
        written.append(path)
    return written


def publish(out: Path, data: str) -> int:
    """Results under `out` into the tree, and the document's parts from all that is there then.

    Returns:
        How many results.

    Raises:
        UsageError: there are none.
    """
    found = sorted((out / "results" / data).glob("*.json"))
    if not found:
        raise UsageError(f"There is no result of {data!r} under {out}; train its cells first.")
    folder = COMMITTED / data
    folder.mkdir(parents=True, exist_ok=True)
    for path in found:
        _write(folder / path.name, path.read_text(encoding="utf-8"))
    _write(DOCUMENT, filled(DOCUMENT.read_text(encoding="utf-8"), COMMITTED))
    return len(found)


def filled(text: str, results: Path) -> str:
    """A document whose parts between `<!-- DATA PART -->` and `<!-- end -->` are made anew.

    Args:
        text: Markdown.
        results: holds a folder of results for each data set.

    Raises:
        UsageError: a marker names a part that there is not.
    """

    def part(match: re.Match[str]) -> str:
        data, name = match["data"], match["part"]
        if name not in PARTS:
            raise UsageError(f"The document has a marker for {name!r}; parts are {', '.join(PARTS)}.")
        found = load(results / data)
        inside = PARTS[name](collect(found)) if found else "Nothing has been measured yet."
        return f"<!-- {data} {name} -->\n{inside}\n<!-- end -->"

    return _MARKED.sub(part, text)


_MARKED = re.compile(r"<!-- (?P<data>\w+) (?P<part>\w+) -->\n.*?<!-- end -->", re.DOTALL)


def _write(path: Path, text: str) -> None:
    unfinished = aside(path)
    unfinished.write_text(text, encoding="utf-8")
    unfinished.replace(path)
