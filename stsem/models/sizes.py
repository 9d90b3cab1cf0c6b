"""What the networks of the zoo cost, as kept in sizes.csv: to be listed without torch and without building one.

`stsem.models.cost` counts the rows; `python -m stsem.models.cost` writes the file again, and a test compares.
"""

import csv
import io
from collections.abc import Iterable
from dataclasses import dataclass, fields
from pathlib import Path

from tabulate import tabulate

SIDE = 473
"""Pixels a side, the paper's figure for PSPNet on ResNet-50; 48 k - 7."""
CLASSES = 13
KEPT = Path(__file__).with_name("sizes.csv")


@dataclass(frozen=True)
class Size:
    """A network of the zoo at its paper's width, for `CLASSES` classes and an image of `SIDE` x `SIDE`.

    Args:
        name: in the zoo.
        parameters: weights that an answer needs.
        auxiliary: further weights, of heads that serve the loss alone.
        multiply_adds: of convolutions and matrix products for one answer.
        paper: authors and year, title, figure.
    """

    name: str
    parameters: int
    auxiliary: int
    multiply_adds: int
    paper: str


_COLUMNS = tuple(field.name for field in fields(Size))


def written(sizes: Iterable[Size]) -> str:
    """Sizes as the text of sizes.csv."""
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    table.writerow(_COLUMNS)
    table.writerows([getattr(size, column) for column in _COLUMNS] for size in sizes)
    return text.getvalue()


def kept() -> tuple[Size, ...]:
    """The rows of sizes.csv, in the order of the zoo."""
    with KEPT.open(encoding="utf-8", newline="") as file:
        return tuple(
            Size(row["name"], int(row["parameters"]), int(row["auxiliary"]), int(row["multiply_adds"]), row["paper"])
            for row in csv.DictReader(file)
        )


def table() -> str:
    """Every network of the zoo as a table in Markdown."""
    rows = [
        (size.name, f"{size.parameters / 1e6:.1f}", f"{size.auxiliary / 1e6:.1f}", f"{size.multiply_adds / 1e9:.0f}",
         size.paper)
        for size in kept()
    ]  # fmt: skip
    heads = ("name", "M parameters", "M auxiliary", f"G multiply-adds at {SIDE}", "paper")
    return tabulate(rows, heads, tablefmt="pipe", disable_numparse=True, colalign=("left", *["right"] * 3, "left"))
