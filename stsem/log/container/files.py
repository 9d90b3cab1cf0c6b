"""The files of a log."""

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from stsem.errors import LogError


@dataclass(frozen=True)
class File:
    """A file of a log, its size in bytes, and the place of its first byte in the log."""

    path: Path
    size: int
    base: int


def find_files(paths: Sequence[Path]) -> tuple[File, ...]:
    """The .mcap files that `paths` mean, in natural order of their names: files as they are, folders by what they hold.

    Raises:
        LogError: nothing was given, a path does not exist, or a folder holds no recording.
    """
    if not paths:
        raise LogError("No log was given; give the path of an MCAP recording.")
    unique = {os.path.realpath(path): path for given in paths for path in _expand(given)}
    files: list[File] = []
    for path in sorted(unique.values(), key=_natural):
        base = files[-1].base + files[-1].size if files else 0
        files.append(File(path, path.stat().st_size, base))
    return tuple(files)


def _expand(path: Path) -> list[Path]:
    if path.is_dir():
        inside = [p for p in path.iterdir() if p.suffix.lower() == ".mcap" and p.is_file()]
        if not inside:
            raise LogError(f"The folder {path} holds no .mcap file; give a recording or a folder with one.")
        return inside
    if not path.exists():
        raise LogError(f"There is no file {path}; give the path of an MCAP recording.")
    return [path]


def _natural(path: Path) -> tuple[list[tuple[int, str]], str]:
    parts = re.findall(r"\d+|\D+", path.name)
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts], str(path)
