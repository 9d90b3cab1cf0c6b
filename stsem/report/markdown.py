"""report.md: for a terminal, a pull request or a wiki; pictures are linked from plots/."""

import re

from tabulate import tabulate

from stsem.report.outline import Block, Code, Figure, Folded, Items, Outline, Table, Text

_BADGES = {"valid": "**VALID**", "lossy": "**LOSSY INPUT**", "invalid": "**INVALID**"}


def markdown(report: Outline) -> str:
    """The whole report in GitHub's Markdown, without HTML except folded parts."""
    state = f"{_BADGES[report.state]} · accuracy {report.accuracy_state} · digest `{report.digest[:12]}`"
    parts = [f"# stsem: {_safe(report.title)}", state, *map(_safe, report.lead)]
    if report.warnings:
        parts.append("\n".join(f"- Warning: {_safe(warning)}" for warning in report.warnings))
    for section in report.sections:
        parts += [f"## {section.title}", *(_block(block) for block in section.blocks)]
    return "\n\n".join(parts) + "\n"


def _block(block: Block) -> str:
    match block:
        case Table():
            return _table(block)
        case Text(text):
            return _safe(text)
        case Items(items):
            return "\n".join(f"- {_safe(item)}" for item in items)
        case Figure(name, alternative):
            return f"![{alternative}](plots/{name}.png)"
        case Code(text):
            fence = "`" * max(3, 1 + max(map(len, re.findall("`+", text)), default=0))
            return f"{fence}\n{text}\n{fence}"
        case Folded(title, blocks):
            inner = "\n\n".join(_block(inside) for inside in blocks)
            return f"<details><summary>{title}</summary>\n\n{inner}\n\n</details>"


def _safe(text: str) -> str:
    """`text` in which no name can become HTML, a link or a picture."""
    return text.replace("<", "&lt;").replace("](", "]\\(")


def _table(table: Table) -> str:
    bold = [[f"**{cell}**" if row.total and cell else cell for cell in row.cells] for row in table.rows]
    text = tabulate(
        [[_safe(cell).replace("|", "\\|") for cell in row] for row in bold],
        [column.name for column in table.columns],
        tablefmt="pipe",
        disable_numparse=True,
        colalign=["right" if column.number else "left" for column in table.columns],
    )
    notes = "\n".join(f"- {_safe(note)}" for note in table.notes)
    return f"{text}\n\n{notes}" if notes else text
