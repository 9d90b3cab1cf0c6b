"""Which of the paths on the command line are parts of one recording."""

import re
from collections.abc import Sequence
from pathlib import Path

from stsem.errors import UsageError

_PART = re.compile(r"(.*)_\d+$")


def recordings(paths: Sequence[Path]) -> list[tuple[Path, ...]]:
    """Paths grouped into recordings, in the order given.

    Files of one folder whose names differ only in a trailing `_NUMBER` are one split recording, as ROS 2 recorders
    write them; so is a folder. Everything else is a log of its own.

    Raises:
        UsageError: a path was given twice.
    """
    if twice := [path for path in paths if paths.count(path) > 1]:
        raise UsageError(f"{twice[0]} was given twice; give each log once.")
    groups: dict[Path, list[Path]] = {}
    for path in paths:
        part = _PART.match(path.stem)
        split = part is not None and path.suffix == ".mcap" and len(paths) > 1
        groups.setdefault(path.with_name(part.group(1)) if part and split else path, []).append(path)
    return [tuple(group) for group in groups.values()]
