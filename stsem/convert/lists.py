"""Text files of data sets: tables of numbers and names, stamps in seconds, trajectories."""

import math
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from stsem.convert.imagefiles import read_text
from stsem.pose import Pose, from_quaternion

_SECONDS = re.compile(r"(\d{1,10})(?:\.(\d*))?")
_MAX_SECONDS = 2**32


def rows(path: Path, root: Path) -> list[list[str]]:
    """The lines of a file, split at blanks and commas; without empty lines and comments (#).

    Bytes that are no UTF-8 become U+FFFD: harmless in a comment, and elsewhere that line alone cannot be read.

    Raises:
        ConversionError: it cannot be read.
    """
    split = (line.split("#")[0].replace(",", " ").split() for line in read_text(path, root, "replace").splitlines())
    return [words for words in split if words]


def stamp_ns(seconds: str) -> int:
    """Nanoseconds of seconds such as `1305031102.175304`, exact to the last digit.

    Raises:
        ValueError: it is not a time from 1970 to 2106.
    """
    if match := _SECONDS.fullmatch(seconds):
        whole, part = int(match[1]), (match[2] or "")[:9].ljust(9, "0")
        if whole < _MAX_SECONDS:
            return whole * 10**9 + int(part)
    value = float(seconds)
    if not 0 <= value < _MAX_SECONDS:
        raise ValueError(f"{seconds} is not a time in seconds")
    return round(value * 1e9)


def stamped_pose(words: list[str]) -> Pose:
    """T (4, 4) of the words tx ty tz qx qy qz qw.

    Raises:
        ValueError: they are no pose.
    """
    if len(words) != 7:
        raise ValueError("a pose has seven numbers")
    numbers = [float(word) for word in words]
    return from_quaternion(numbers[:3], numbers[3:])


def matrix_pose(words: list[str]) -> Pose:
    """T (4, 4) of 16 numbers, or 12 without the last row.

    Raises:
        ValueError: they are no pose.
    """
    if len(words) not in (12, 16):
        raise ValueError("a matrix has 12 or 16 numbers")
    pose = np.eye(4)
    pose[:3] = np.array([float(word) for word in words[:12]]).reshape(3, 4)
    if not np.isfinite(pose).all():
        raise ValueError("a number is not finite")
    return pose


def numbers(words: list[str]) -> Iterator[float]:
    """Finite numbers.

    Raises:
        ValueError: one is not.
    """
    for word in words:
        value = float(word)
        if not math.isfinite(value):
            raise ValueError(f"{word} is not finite")
        yield value
