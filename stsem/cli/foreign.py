"""A path that is no MCAP log, but can be converted to one."""

import shlex
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from stsem.errors import ConversionError, LogError
from stsem.log.container.source import is_url, local_path


@contextmanager
def pointing_to_convert(given: Sequence[str]) -> Iterator[None]:
    """Replace the complaint about what is no log by the command that makes one of it, where there is one.

    Raises:
        LogError: as it came, or with that command.
    """
    try:
        yield
    except LogError as err:
        for path in [local_path(one) for one in given if not is_url(one)]:
            if summary := _convertible(path):
                raise LogError(
                    f"{path} is not an MCAP log but can become one ({summary}); convert it first: "
                    f"stsem convert {shlex.quote(str(path))}"
                ) from err
        raise


def _convertible(path: Path) -> str:
    """What it is, in a few words; "" when it cannot be converted."""
    from stsem.convert.bags import is_mcap
    from stsem.convert.detect import find_format

    try:
        return "" if is_mcap(path) else find_format(path, None).summary
    except (ConversionError, OSError, ValueError):
        return ""
