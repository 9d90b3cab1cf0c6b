"""The curves of a training as a table: loss, rate and what validation gave."""

import csv
import io
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from stsem.aside import aside
from stsem.errors import OutputError
from stsem.train.recipe import Recipe

COLUMNS = ("iteration", "loss", "rate", "validation_miou", "validation_pixel_accuracy")


@dataclass
class Record:
    """What a training has seen.

    Args:
        losses: mean loss of every iteration.
        validations: iteration -> (mIoU, pixel accuracy) of the averaged weights.
    """

    losses: list[float] = field(default_factory=list)
    validations: dict[int, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class Point:
    """A row.

    Args:
        iteration: iterations done.
        loss: mean since the row before.
        rate: learning rate of the last of them.
        validation: (mIoU, pixel accuracy) of the averaged weights, where they were judged then.
    """

    iteration: int
    loss: float
    rate: float
    validation: tuple[float, float] | None


def points(record: Record, recipe: Recipe) -> list[Point]:
    """A point every `report_every` iterations, at every validation, and at the end of what is there."""
    done = len(record.losses)
    ends = sorted({*range(recipe.report_every, done + 1, recipe.report_every), *record.validations, done} - {0})
    return [
        Point(end, float(np.mean(record.losses[begin:end])), recipe.rate_at(end - 1), record.validations.get(end))
        for begin, end in zip((0, *ends), ends, strict=False)
    ]


def write_csv(path: Path, rows: list[Point]) -> None:
    """`curves.csv`, aside and renamed. Raises OutputError."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for row in rows:
        scores = ["", ""] if row.validation is None else [f"{score:.6f}" for score in row.validation]
        writer.writerow([row.iteration, f"{row.loss:.6f}", f"{row.rate:.6e}", *scores])
    unfinished = aside(path)
    try:
        unfinished.write_text(text.getvalue(), encoding="utf-8")
        unfinished.replace(path)
    except OSError as err:
        raise OutputError(f"The curves {path} cannot be written: {err.strerror or err}.") from err


def read_csv(path: Path) -> list[Point]:
    """What `write_csv` wrote; nothing where there is no such file."""
    if not path.is_file():
        return []
    with path.open(encoding="utf-8", newline="") as file:
        return [
            Point(int(row["iteration"]), float(row["loss"]), float(row["rate"]), _scores(row))
            for row in csv.DictReader(file)
        ]


def _scores(row: dict[str, str]) -> tuple[float, float] | None:
    miou, accuracy = row["validation_miou"], row["validation_pixel_accuracy"]
    return (float(miou), float(accuracy)) if miou else None
