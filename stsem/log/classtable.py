"""Class tables: from messages, metadata, attachments or files to a ClassSet, and label images to its ids."""

import json
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from stsem.classes import NO_LABEL, ClassSet, Colour, Labels
from stsem.errors import ClassTableError
from stsem.log.remark import Remark

METADATA = "stsem.classes"
ATTACHMENT = "classes.json"
FORMS = 'a list of names, {"names": [...]}, {id: name} or {name: "#rrggbb id"}'
_PALETTE = re.compile(r"#([0-9a-fA-F]{6})(?:\s+(\d+))?")
_UNKNOWN = 254
"""Stands for ids and colours outside the table until they are counted; with 255 classes it is the last one's id."""
OUTSIDE = 65535
"""What an id becomes in a label image that 16 bits cannot hold."""


@dataclass(frozen=True)
class ClassTable:
    """What a log says about its label images.

    Args:
        classes: in the order of their raw ids.
        raw_ids: the id that each class has in the label images, ascending.
        ignored: raw ids that mean "ignore this pixel", beside 255; one that 16 bits cannot hold stands for all such.
        source: where it was found, for people.
    """

    classes: ClassSet
    raw_ids: tuple[int, ...]
    ignored: tuple[int, ...]
    source: str

    @property
    def meaning(self) -> tuple[str, ...]:
        """All that decides which class a pixel of a label image has, as text; equal for tables that say the same."""
        return str(self.classes), str(self.raw_ids), str(self.ignored)

    @property
    def colour_of(self) -> dict[int, Colour]:
        """Raw id -> colour; empty without colours."""
        return dict(zip(self.raw_ids, self.classes.colours, strict=False))


class Translator:
    """Label images as they stand in the log to labels in the ids of `table.classes`."""

    def __init__(self, table: ClassTable) -> None:
        self._table = table
        self._unknown = _UNKNOWN if len(table.classes) <= _UNKNOWN else NO_LABEL
        self._by_id: dict[int, Labels] = {}
        self._by_colour: Labels | None = None

    def __call__(self, raw: npt.NDArray[Any]) -> tuple[Labels, int]:
        """((H, W) uint8 labels, number of pixels whose id or colour is in no table: they become NO_LABEL).

        Args:
            raw: (H, W) uint8 or uint16 ids, or (H, W, 3) uint8 RGB.

        Raises:
            ValueError: colours came, but the class table has none.
        """
        if raw.ndim == 3:
            labels = self._colours()[_packed(raw)]
        elif raw.dtype == np.uint8:
            labels = np.asarray(cv2.LUT(raw, self._ids(256)), np.uint8)
        else:
            labels = self._ids(1 << 16).take(raw, mode="wrap")
        unknown = labels == self._unknown
        count = int(np.count_nonzero(unknown))
        if count and self._unknown != NO_LABEL:
            labels[unknown] = NO_LABEL
        elif count and raw.ndim == 2:
            count -= int(np.isin(raw, self._silent()).sum())
        return labels, count

    def _ids(self, size: int) -> Labels:
        if size not in self._by_id:
            lut = np.full(size, self._unknown, np.uint8)
            lut[[raw for raw in self._silent() if raw < size]] = NO_LABEL
            for own, raw in enumerate(self._table.raw_ids):
                if raw < size:
                    lut[raw] = own
            self._by_id[size] = lut
        return self._by_id[size]

    def _silent(self) -> list[int]:
        """Raw ids that are ignored and not counted as unknown."""
        return [raw if 0 <= raw < OUTSIDE else OUTSIDE for raw in (NO_LABEL, *self._table.ignored)]

    def _colours(self) -> Labels:
        if not self._table.classes.colours:
            raise ValueError(f"labels are colours, but the class table ({self._table.source}) has none")
        if self._by_colour is None:
            lut = np.full(1 << 24, self._unknown, np.uint8)
            for own, (r, g, b) in enumerate(self._table.classes.colours):
                lut[r << 16 | g << 8 | b] = own
            self._by_colour = lut
        return self._by_colour


def _packed(rgb: npt.NDArray[np.uint8]) -> npt.NDArray[np.int32]:
    wide = rgb.astype(np.int32)
    return wide[:, :, 0] << 16 | wide[:, :, 1] << 8 | wide[:, :, 2]


def find_table(
    classes_file: Path | None,
    messages: Mapping[int, str] | None,
    metadata: Mapping[str, Mapping[str, str]],
    attachments: Mapping[str, bytes],
) -> tuple[ClassTable | None, list[str]]:
    """(the class table, warnings): of `classes_file`, else of the messages, the metadata record, the attachment.

    Colours are taken from whichever of them has the same names and colours.

    Raises:
        ClassTableError: one of them is no class table.
    """
    if classes_file is not None:
        return read_file(classes_file), []
    tables: list[ClassTable] = []
    if messages:
        tables.append(from_names(messages, {}, (), "LabelInfo messages"))
    if METADATA in metadata:
        tables.append(parse(dict(metadata[METADATA]), f"metadata {METADATA}"))
    if ATTACHMENT in attachments:
        tables.append(_parse_json(attachments[ATTACHMENT], f"attachment {ATTACHMENT}"))
    if not tables:
        return None, []
    first = tables[0]
    same = [t for t in tables if t.classes.names == first.classes.names and t.raw_ids == first.raw_ids]
    warnings: list[str] = [
        Remark(
            "truth-two-tables",
            f"The {t.source} names other classes than the {first.source}, which is used (--classes FILE for another).",
        )
        for t in tables
        if t not in same
    ]
    coloured = next((t.classes.colours for t in same if t.classes.colours), ())
    ignored = tuple(sorted({raw for t in same for raw in t.ignored}))
    return replace(first, classes=ClassSet(first.classes.names, coloured), ignored=ignored), warnings


def read_file(path: Path) -> ClassTable:
    """A class table from a JSON or TOML file.

    Raises:
        ClassTableError: the file is missing, is neither, or holds no class table.
    """
    try:
        data = path.read_bytes()
    except OSError as err:
        raise ClassTableError(f"The class table {path} cannot be read ({err.strerror}); give --classes FILE.") from err
    if path.suffix.lower() != ".toml":
        return _parse_json(data, str(path))
    try:
        return parse(tomllib.loads(data.decode()), str(path))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as err:
        raise ClassTableError(f"The class table {path} is not TOML ({err}); mend the file.") from err


def read_class_map(path: Path) -> dict[str, str]:
    """A class map from TOML, name -> name: `"office chair" = "chair"`.

    Raises:
        ClassTableError: it cannot be read or is none.
    """
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as err:
        raise ClassTableError(f"The class map {path} cannot be read: {err.strerror or err}.") from err
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as err:
        raise ClassTableError(f"The class map {path} is not valid TOML: {err}.") from err
    if bad := [key for key, value in table.items() if not isinstance(value, str)]:
        raise ClassTableError(f'The class map {path} gives no class name for {bad[0]!r}; write it as name = "name".')
    return table


def _parse_json(data: bytes, source: str) -> ClassTable:
    try:
        document = json.loads(data)
    except (ValueError, RecursionError) as err:
        raise ClassTableError(f"The class table {source} is not JSON ({err}); it should hold {FORMS}.") from err
    return parse(document, source)


def parse(document: Any, source: str) -> ClassTable:
    """A class table from plain data: a list of names, {"names": ...}, {id: name} or {name: "#rrggbb id"}.

    Raises:
        ClassTableError: it is none of these.
    """
    try:
        if isinstance(document, dict) and "names" in document:
            ignore = document.get("ignore_id", NO_LABEL)
            colours = document.get("colours", document.get("colors")) or []
            names = _by_id(document["names"])
            given = {i: _colour(c) for i, c in (enumerate(colours) if isinstance(colours, list) else colours.items())}
            return from_names(names, {int(i): c for i, c in given.items()}, (int(ignore),), source)
        if isinstance(document, dict) and document and not all(str(key).isdecimal() for key in document):
            return _from_palette(document, source)
        return from_names(_by_id(document), {}, (), source)
    except (TypeError, ValueError, AttributeError, KeyError, ArithmeticError) as err:
        raise ClassTableError(f"The class table {source} cannot be read ({err}); it should hold {FORMS}.") from err


def from_names(
    names: Mapping[int, str], colours: Mapping[int, Colour], ignored: tuple[int, ...], source: str
) -> ClassTable:
    """A class table from raw id -> name; ids in `ignored` and 255 are no classes.

    Raises:
        ClassTableError: no class is left, two have one name, or an id is not in 0..65535.
    """
    raw_ids = tuple(sorted(raw for raw in names if raw not in (NO_LABEL, *ignored)))
    if any(not 0 <= raw < 1 << 16 for raw in raw_ids):
        raise ClassTableError(f"The class table {source} has the id {raw_ids[-1]}, but ids go from 0 to 65535.")
    try:
        own = tuple(colours[raw] for raw in raw_ids) if all(raw in colours for raw in raw_ids) else ()
        return ClassTable(ClassSet(tuple(names[raw] for raw in raw_ids), own), raw_ids, ignored, source)
    except ClassTableError as err:
        raise ClassTableError(f"The class table {source} cannot be used: {err}") from err


def _by_id(names: Any) -> dict[int, str]:
    items = enumerate(names) if isinstance(names, list) else names.items()
    table = {int(raw): name for raw, name in items}
    if not all(isinstance(name, str) for name in table.values()):
        raise ValueError("a name is not a text")
    return table


def _from_palette(document: Mapping[str, Any], source: str) -> ClassTable:
    """{name: "#rrggbb id"} or {name: id}; without an id the order counts."""
    names: dict[int, str] = {}
    colours: dict[int, Colour] = {}
    for position, (name, value) in enumerate(document.items()):
        match = _PALETTE.fullmatch(str(value).strip())
        raw = int(match[2] or position) if match else int(value)
        if raw in names:
            raise ValueError(f"{names[raw]!r} and {name!r} have the same id {raw}")
        names[raw] = name
        if match:
            colours[raw] = _colour(f"#{match[1]}")
    return from_names(names, colours, (), source)


def _colour(value: Any) -> Colour:
    r, g, b = bytes.fromhex(value.lstrip("#")) if isinstance(value, str) else value
    if not all(isinstance(x, int) and 0 <= x <= 255 for x in (r, g, b)):
        raise ValueError(f"{value!r} is not a colour")
    return r, g, b
