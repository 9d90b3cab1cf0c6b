"""Where two replays of one log first differ: the field, the frame and the column, or the byte."""

import csv
import io
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from typing import Any

from stsem.document.canonical import OUTSIDE_DIGEST

REPEATABLE = ("report.json", "frames.csv", "trace.json", "trajectory.txt", "map.ply", "plots/*.png")
"""What is the same byte for byte for the same log, configuration, costs and installation (DESIGN 3)."""

_MISSING = object()


@dataclass(frozen=True)
class Difference:
    """The first place where two things differ.

    Args:
        where: a path such as `report.json: runs[1].offline.miou`, or `frames.csv: keyframe, frame 17, outcome`.
        first, second: the two values, as text.
    """

    where: str
    first: str
    second: str

    def __str__(self) -> str:
        return f"{self.where}: {self.first} against {self.second}"


def first_field(a: Any, b: Any, path: str = "") -> Difference | None:
    """The first differing field of two JSON values, depth first in the order of `a`; None when they are equal."""
    if isinstance(a, dict) and isinstance(b, dict):
        keys = [*a, *(key for key in b if key not in a)]
        pairs: Iterator[tuple[str, Any, Any]] = (
            (f"{path}.{key}" if path else str(key), a.get(key, _MISSING), b.get(key, _MISSING)) for key in keys
        )
    elif isinstance(a, list | tuple) and isinstance(b, list | tuple):
        pairs = ((f"{path}[{i}]", x, y) for i, (x, y) in enumerate(zip_longest(a, b, fillvalue=_MISSING)))
    else:
        same = a is b or (type(a) is type(b) and a == b)
        return None if same else Difference(path or "the whole", _shown(a), _shown(b))
    return next((found for where, x, y in pairs if (found := first_field(x, y, where))), None)


def _shown(value: Any) -> str:
    if value is _MISSING:
        return "nothing"
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= 80 else text[:77] + "..."


def first_report_field(a: bytes, b: bytes) -> Difference | None:
    """The first differing field of two report.json, `host` and `digest` aside."""
    first, second = (
        {key: value for key, value in json.loads(data).items() if key not in OUTSIDE_DIGEST} for data in (a, b)
    )
    return first_field(first, second)


def first_frame(a: bytes, b: bytes) -> Difference | None:
    """The first differing frame and column of two frames.csv; None when they are equal."""
    first, second = (list(csv.reader(io.StringIO(data.decode()))) for data in (a, b))
    header = first[0] if first else []
    if header != (second[0] if second else []):
        return Difference("header", ",".join(header), ",".join(second[0] if second else []))
    for line, (x, y) in enumerate(zip_longest(first[1:], second[1:]), start=2):
        if x is None or y is None:
            return Difference(f"line {line}", *("nothing" if row is None else ",".join(row) for row in (x, y)))
        for column, one, other in zip(header, x, y, strict=True):
            if one != other:
                row = dict(zip(header, x, strict=True))
                place = f"{row.get('mode', '')}, frame {row.get('frame', line)}, {column}"
                return Difference(place, one or "nothing", other or "nothing")
    return None


def first_byte(a: bytes, b: bytes) -> Difference | None:
    """The first differing byte of two files; None when they are equal."""
    if a == b:
        return None
    at = next((i for i, (x, y) in enumerate(zip(a, b, strict=False)) if x != y), min(len(a), len(b)))
    first, second = (f"0x{data[at]:02x}" if at < len(data) else "the end" for data in (a, b))
    return Difference(f"byte {at}", first, second)


_COMPARERS = {"report.json": first_report_field, "frames.csv": first_frame}


def first_differences(a: Mapping[str, bytes], b: Mapping[str, bytes]) -> tuple[Difference, ...]:
    """The first difference of every repeatable file of two replays, name -> bytes; empty when all are equal."""
    found = []
    for name in [*a, *(name for name in b if name not in a)]:
        if name not in a or name not in b:
            found.append(Difference(name, *("there" if name in files else "missing" for files in (a, b))))
        elif difference := _COMPARERS.get(name, first_byte)(a[name], b[name]):
            found.append(Difference(f"{name}: {difference.where}", difference.first, difference.second))
    return tuple(found)


def repeatable_files(folder: Path) -> dict[str, bytes]:
    """Relative name -> bytes of every file of a report folder that must repeat, report.json first."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for pattern in REPEATABLE
        for path in sorted(folder.glob(pattern))
    }
