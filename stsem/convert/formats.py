"""The table of formats: one row for each kind of data set or foreign recording that becomes an MCAP log."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from stsem.convert.recording import Options, Recording


@dataclass(frozen=True)
class Format:
    """A data set that can be read as a `Recording`.

    Args:
        summary: what it is, in a few words, for the help.
        detect: whether a path looks like one; cheap, and never raises.
        read: opens it. Raises ConversionError (a StsemError) with one sentence when it cannot.
    """

    summary: str
    detect: Callable[[Path], bool]
    read: Callable[[Path, Options], Recording]


FORMATS: dict[str, Format] = {}
