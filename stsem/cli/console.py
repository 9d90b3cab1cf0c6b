"""Progress on stderr: a bar on a terminal, nothing elsewhere."""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from stsem.plain import MAX_SENTENCE, plain

Progress = Callable[[int, int], None]
"""Called with (done, total), in whatever unit."""


def is_terminal() -> bool:
    """Whether stderr can show a bar."""
    return sys.stderr.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


@contextmanager
def progress(label: str) -> Iterator[Progress]:
    """A bar named `label` for the duration of the block; its value is the function to report with."""
    if not is_terminal():
        yield lambda done, total: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

    columns = TextColumn("{task.description}", markup=False), BarColumn(), TaskProgressColumn(), TimeRemainingColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(label, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def note(text: str) -> None:
    """A line on stderr: what is going on, or what to know; never a result."""
    print(plain(text, MAX_SENTENCE), file=sys.stderr)
