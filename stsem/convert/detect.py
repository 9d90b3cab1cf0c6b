"""Which format a source is in: by looking, or as the user says."""

from difflib import get_close_matches
from pathlib import Path

from stsem.convert.bags import is_mcap
from stsem.convert.formats import FORMATS, Format
from stsem.errors import ConversionError, UsageError


def find_format(source: Path, name: str | None) -> Format:
    """The format called `name`, else the only one that fits.

    Raises:
        UsageError: there is no format of that name.
        ConversionError: there is no such source, it is an MCAP log already, or none or several formats fit.
    """
    if name is not None and name not in FORMATS:
        near = get_close_matches(name, FORMATS, 1)
        meant = f" (did you mean {near[0]}?)" if near else ""
        raise UsageError(f"--from is {name!r}{meant}, but it can be {_names(FORMATS)}.")
    if not source.exists():
        raise ConversionError(f"There is no {source}; give the folder or the file to convert.")
    if name is not None:
        return FORMATS[name]
    fitting = {key: row for key, row in FORMATS.items() if not row.last and row.detect(source)}
    fitting = fitting or {key: row for key, row in FORMATS.items() if row.last and row.detect(source)}
    if len(fitting) == 1:
        return next(iter(fitting.values()))
    if fitting:
        raise ConversionError(f"{source} could be {_names(fitting)}; say which with --from FORMAT.")
    if is_mcap(source):
        raise ConversionError(f"{source} is an MCAP log already, nothing needs to be converted: stsem-replay {source}")
    expected = "; ".join(f"{key} ({row.expects})" for key, row in FORMATS.items())
    raise ConversionError(f"{source} is in none of the formats that can be converted: {expected}.")


def _names(formats: dict[str, Format]) -> str:
    return ", ".join(formats)
