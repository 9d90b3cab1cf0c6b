"""What the names of image files say: a stamp, a number, or nothing but a name."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from stsem.convert.lists import stamp_ns

_UNITS_NS = {19: 1, 16: 1_000, 13: 1_000_000}
"""Digits of a whole number since 1970, in 2001 to 2286 -> its unit in nanoseconds."""
_SECONDS = re.compile(r"\d{10}(\.\d+)?", re.ASCII)
_LAST_NUMBER = re.compile(r"(\d{1,18})\D*$")


@dataclass(frozen=True)
class Keys:
    """Images of one folder by what their names say.

    Args:
        files: stamp in nanoseconds, number or name -> file; ascending.
        kind: "stamp", "number" or "name".
    """

    files: dict[int | str, Path]
    kind: str

    @property
    def stamped(self) -> bool:
        """Whether the keys are stamps."""
        return self.kind == "stamp"

    def match(self, images: Sequence[Path]) -> dict[int | str, Path]:
        """Images of another folder by keys of the same kind; without the ones whose names have none."""
        read = _KINDS[self.kind]
        return {key: path for path in images if (key := read(path.stem)) is not None}


def keys_of(images: Sequence[Path]) -> Keys:
    """The first of stamp, number and name that every image has, and no two the same."""
    for kind in ("stamp", "number"):
        found = Keys({}, kind).match(images)
        if len(found) == len(images):
            return Keys({key: found[key] for key in sorted(found, key=int)}, kind)
    return Keys(Keys({}, "name").match(images), "name")


def _stamp(stem: str) -> int | None:
    """Nanoseconds of seconds (ten digits, with or without decimals), or of 13, 16 or 19 digits.

    A number filled up with zeros (0000000007 in KITTI) counts images.
    """
    if stem.startswith("0"):
        return None
    if _SECONDS.fullmatch(stem):
        try:
            return stamp_ns(stem)
        except ValueError:
            return None
    return int(stem) * _UNITS_NS[len(stem)] if stem.isascii() and stem.isdigit() and len(stem) in _UNITS_NS else None


def _number(stem: str) -> int | None:
    match = _LAST_NUMBER.search(stem)
    return int(match[1]) if match and match[1].isascii() else None


def _name(stem: str) -> str | None:
    return stem


_KINDS = {"stamp": _stamp, "number": _number, "name": _name}
