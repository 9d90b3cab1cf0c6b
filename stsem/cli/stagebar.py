"""What a training shows while it runs, how it is stopped, and its picture."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from stsem import hostclock
from stsem.aside import write_aside
from stsem.cli.console import is_terminal, note
from stsem.report.plots.training import training_curves
from stsem.report.wording import plural
from stsem.train.curves import read_csv

if TYPE_CHECKING:
    from stsem.train.job import Job
    from stsem.train.stages import Progress

PICTURE = "curves.png"
REDRAW_NS = 60_000_000_000


@contextmanager
def shown(job: "Job") -> Iterator[Callable[["Progress"], None]]:
    """A bar on a terminal, a line a report elsewhere: iteration, loss, rate, validation, time left in the stage."""
    clock = _TimeLeft()
    label = f"{job.stage} ({job.architecture})"
    if not is_terminal():
        note(f"Training {label}, {plural(job.numbers.iterations, 'iteration')}.")
        yield lambda now: note(f"{now.iteration}/{now.iterations}, {_said(now)}, {clock.left(now)}")
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TextColumn("{task.completed}/{task.total}"),
               TextColumn("{task.fields[said]}", markup=False))  # fmt: skip
    with Progress(*columns, console=Console(stderr=True)) as bar:
        task = bar.add_task(label, total=job.numbers.iterations, said="")
        yield lambda now: bar.update(task, completed=now.iteration, said=f"{_said(now)}, {clock.left(now)}")


def _said(now: "Progress") -> str:
    scores = "" if now.validation is None else f", validation mIoU {now.validation[0]:.1%}"
    return f"loss {now.loss:.3f}, rate {now.rate:.1e}{scores}"


class _TimeLeft:
    """From what the iterations since the first report took."""

    def __init__(self) -> None:
        self._first: tuple[int, int] | None = None

    def left(self, now: "Progress") -> str:
        """In words."""
        if self._first is None or self._first[0] == now.iteration:
            self._first = (now.iteration, hostclock.wall_ns())
            return "time left not known yet"
        iteration, began = self._first
        each = (hostclock.wall_ns() - began) / (now.iteration - iteration)
        seconds = round(each * (now.iterations - now.iteration) / 1e9)
        minutes, hours = seconds // 60 % 60, seconds // 3600
        return f"{hours}:{minutes:02}:{seconds % 60:02} left"


@contextmanager
def stopping_in_order() -> Iterator[Callable[[], bool]]:
    """Ctrl-C, SIGTERM and SIGHUP let the iteration end and be saved; a second one ends at once."""
    asked: list[int] = []
    numbers = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]

    def ask(number: int, frame: object) -> None:
        if asked:
            raise KeyboardInterrupt
        asked.append(number)

    before = {number: signal.signal(number, ask) for number in numbers if signal.getsignal(number) != signal.SIG_IGN}
    try:
        yield lambda: bool(asked)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def drawn(folder: Path) -> Iterator[Callable[[None], None]]:
    """Keeps the picture of the curves in `folder` up to date: once a minute, and at the end however it comes."""
    last = [hostclock.wall_ns()]

    def redraw(_: None) -> None:
        if hostclock.wall_ns() - last[0] > REDRAW_NS:
            _draw(folder)
            last[0] = hostclock.wall_ns()

    try:
        yield redraw
    finally:
        _draw(folder)


def _draw(folder: Path) -> None:
    rows = read_csv(folder / "curves.csv")
    if not rows:
        return
    path = folder / PICTURE
    try:
        write_aside(path, training_curves(rows))
    except OSError as err:  # no reason to stop a training, nor to hide why it stopped
        note(f"The picture {path} cannot be written: {err.strerror or err}.")
