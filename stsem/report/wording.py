"""How numbers are written for readers: per cent, points, milliseconds; never a blank."""

import re

from stsem.document.part import Part, definition
from stsem.document.timing import PERCENTILES, Distribution
from stsem.uncertainty import DOUBT

NOT_MEASURED = "not measured"
TOO_FEW = "n too small"
NONE = "–"
MEASURES = {
    DOUBT: "1 − confidence", "variance": "variance", "entropy": "entropy", "mutual_information": "mutual information",
}  # fmt: skip
"""Measures of uncertainty in `report.json` -> their names for readers, in the order of tables."""


def percent(share: float | None, digits: int = 1) -> str:
    """A fraction 0..1 as per cent, without the sign; the column names the unit."""
    return NOT_MEASURED if share is None else f"{100 * share:.{digits}f}"


def points(difference: float | None, digits: int = 1) -> str:
    """A difference of two fractions in percentage points, signed."""
    return NOT_MEASURED if difference is None else signed(100 * difference, digits)


def signed(value: float, digits: int = 1) -> str:
    """A number with its sign; what rounds to zero has none."""
    text = f"{value:+.{digits}f}"
    return text[1:] if not float(text) else text.replace("-", "−")


def number(value: float | None, digits: int = 1) -> str:
    """A plain number."""
    return NOT_MEASURED if value is None else f"{value:.{digits}f}"


def count(value: int | None) -> str:
    """A whole number with thin groups of three."""
    return NOT_MEASURED if value is None else f"{value:,}".replace(",", " ")


def percentile(samples: Distribution, name: str, digits: int = 1) -> str:
    """A percentile, or why there is none."""
    value: float | None = getattr(samples, name)
    if value is not None:
        return number(value, digits)
    return TOO_FEW if samples.n and samples.n_effective < PERCENTILES[name][1] else NOT_MEASURED


def meaning(part: type[Part], field: str) -> str:
    """What a number is, in the words of the schema, less what speaks of the file: fractions and nulls."""
    return re.sub(r"; null [^.;]*|(?<=\.) Fraction\.$", "", definition(part, field))


def plural(n: int, noun: str) -> str:
    """`1 frame`, `2 frames`."""
    return f"{count(n)} {noun}" if n == 1 else f"{count(n)} {noun}{'es' if noun.endswith('s') else 's'}"
