"""The table of formats: one row for each kind of data set or foreign recording that becomes an MCAP log."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from stsem.convert.recording import Options, Progress, Summary

Convert = Callable[[Path, Path, Options, Progress], Summary]
"""Source, file to write, options, progress. Raises a StsemError of one sentence and then leaves no file behind."""


@dataclass(frozen=True)
class Format:
    """One kind of source.

    Args:
        summary: what it is, in a few words, for the help.
        expects: what lies on disk, in a few words.
        detect: whether a path looks like one; cheap, and never raises.
        convert: writes it as a log. Of a data set, `dataset(read)`, where `read(source, options)` opens it as a
            `Recording` and raises ConversionError with one sentence when it cannot.
    """

    summary: str
    expects: str
    detect: Callable[[Path], bool]
    convert: Convert


FORMATS: dict[str, Format] = {}
