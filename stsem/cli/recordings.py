"""Which of the paths and addresses on the command line are parts of one recording."""

import re
from collections.abc import Sequence
from pathlib import Path

from stsem.errors import UsageError
from stsem.log.container.source import is_url, without_secrets

_PART = re.compile(r"(.*)_\d+(\.mcap)", re.IGNORECASE | re.DOTALL)


def recordings(given: Sequence[str]) -> list[tuple[str, ...]]:
    """Paths and addresses grouped into recordings, in the order given.

    Files of one folder whose names differ only in a trailing `_NUMBER` are one split recording, as ROS 2 recorders
    write them; so is a folder. Everything else is a log of its own.

    Raises:
        UsageError: one was given twice.
    """
    check_once(given)
    groups: dict[tuple[str, ...], list[str]] = {}
    for one in given:
        part = _PART.fullmatch(without_secrets(one) if is_url(one) else one)
        groups.setdefault(part.groups() if part else (one,), []).append(one)
    return [tuple(group) for group in groups.values()]


def check_once(given: Sequence[str]) -> None:
    """Nothing may be given twice.

    Raises:
        UsageError: one was.
    """
    places = [one if is_url(one) else str(Path(one).resolve()) for one in given]
    if twice := [one for one, place in zip(given, places, strict=True) if places.count(place) > 1]:
        raise UsageError(f"{without_secrets(twice[-1])} was given twice; give each log once.")
