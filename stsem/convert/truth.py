"""What becomes of the label images of a data set: by its own table of ids, or by a class table that was stated."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from stsem.classes import NO_LABEL, ClassSet, Colour, Labels
from stsem.convert.recording import Options
from stsem.log.classtable import ClassTable, Translator, read_file


@dataclass(frozen=True, eq=False)
class Truth:
    """How label images become labels.

    Args:
        classes: names.
        labels: from raw ids (H, W) or colours (H, W, 3) to (H, W) uint8 in the order of the names, 255 ignored.
        colour_of: raw id -> colour of a stated class table; a png whose palette paints others holds colours, not ids.
    """

    classes: ClassSet
    labels: Callable[[npt.NDArray[Any]], Labels]
    colour_of: Mapping[int, Colour] = field(default_factory=dict)


def truth_of(options: Options, classes: ClassSet, raw_ids: Mapping[int, int], notes: list[str]) -> Truth:
    """Labels by `raw_ids`, raw id -> id in `classes`, everything else ignored; or by the user's class table.

    Raises:
        ClassTableError: the user's class table cannot be used.
    """
    if options.classes_file is not None:
        return stated_truth(options.classes_file, notes)
    table = np.full(1 << 16, NO_LABEL, np.uint8)
    for raw, own in raw_ids.items():
        table[raw] = own

    def labels(raw: npt.NDArray[Any]) -> Labels:
        if raw.ndim != 2:
            raise ValueError("it holds colours, but ids were expected")
        return np.asarray(table[raw], np.uint8)

    return Truth(classes, labels)


def stated_truth(classes_file: Path, notes: list[str]) -> Truth:
    """Labels by the user's class table.

    Raises:
        ClassTableError: it cannot be used.
    """
    return table_truth(read_file(classes_file), notes)


def table_truth(table: ClassTable, notes: list[str]) -> Truth:
    """Labels by a class table; a note says how many pixels have an id or colour that it does not have."""
    translate, place = Translator(table), len(notes)
    frames = pixels = 0

    def labels(raw: npt.NDArray[Any]) -> Labels:
        nonlocal frames, pixels
        found, unknown = translate(raw)
        if unknown:
            frames, pixels = frames + 1, pixels + unknown
            said = f"{pixels} pixels in {frames} label images have an id or colour outside the class table: ignored."
            notes[place : place + (frames > 1)] = [said]
        return found

    return Truth(table.classes, labels, table.colour_of)
