"""The classes of NYU's 40 that ScanNet evaluates, and the way to them from the raw ids of its label images."""

import csv
from pathlib import Path

from stsem.classes import ClassSet
from stsem.convert.imagefiles import read_text
from stsem.errors import ConversionError

CLASSES = ClassSet(
    names=("wall", "floor", "cabinet", "bed", "chair", "sofa", "table", "door", "window", "bookshelf", "picture",
           "counter", "desk", "curtain", "refrigerator", "shower curtain", "toilet", "sink", "bathtub",
           "other furniture"),
    colours=((174, 199, 232), (152, 223, 138), (31, 119, 180), (255, 187, 120), (188, 189, 34), (140, 86, 75),
             (255, 152, 150), (214, 39, 40), (197, 176, 213), (148, 103, 189), (196, 156, 148), (23, 190, 207),
             (247, 182, 210), (219, 219, 141), (255, 127, 14), (158, 218, 229), (44, 160, 44), (112, 128, 144),
             (227, 119, 194), (82, 84, 163)),
)  # fmt: skip
NYU40_IDS = (1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 14, 16, 24, 28, 33, 34, 36, 39)
"""The nyu40 id of each of the 20 classes that ScanNet evaluates."""


def raw_ids(path: Path, source: Path) -> dict[int, int]:
    """Raw id -> id in `CLASSES`, from the columns `id` and `nyu40id` of `scannetv2-labels.combined.tsv`.

    Raises:
        ConversionError: it cannot be read, or has no such columns of whole numbers.
    """
    rows = csv.DictReader(read_text(path, source).splitlines(), delimiter="\t", quoting=csv.QUOTE_NONE)
    try:
        if not {"id", "nyu40id"} <= set(rows.fieldnames or ()):
            raise ValueError("its first line does not name them")
        pairs = [(int(row["id"]), int(row["nyu40id"])) for row in rows if row["nyu40id"]]
    except (ValueError, TypeError, csv.Error) as err:
        raise ConversionError(f"{path} has no whole numbers in the columns id and nyu40id ({err}).") from err
    own = {nyu40: i for i, nyu40 in enumerate(NYU40_IDS)}
    return {raw: own[nyu40] for raw, nyu40 in pairs if nyu40 in own and 0 <= raw < 1 << 16}
