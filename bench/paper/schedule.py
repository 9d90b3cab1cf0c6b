"""Cells in processes of their own, some at a time, with the time that is left for all of them."""

import re
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from pathlib import Path

from bench.paper.plan import Cell
from stsem.errors import TrainingError

ROOT = Path(__file__).resolve().parents[2]
SAY_EVERY_S = 60.0
_PROGRESS = re.compile(r"(\d+)/(\d+) loss ([\d.a-z]+)")

Say = Callable[[str], None]


class Board:
    """How far all cells are.

    Args:
        work: cell -> processor seconds that it is expected to take.
        say: shows a line.
        now: seconds of any clock.
    """

    def __init__(self, work: Mapping[Cell, float], say: Say, now: Callable[[], float] = time.monotonic) -> None:
        self._work, self._say, self._now, self._began, self._said = work, say, now, now(), 0.0
        self._share: dict[Cell, float] = {}
        self._found: dict[Cell, float] = {}

    def at(self, cell: Cell, share: float, words: str) -> None:
        """Note that `share` of a cell is done; say so once a minute, and when one is finished."""
        self._found.setdefault(cell, share if share < 1 else 0.0)  # what a stopped run did took none of this one's time
        self._share[cell] = share
        now = self._now()
        if share >= 1 or now - self._said >= SAY_EVERY_S:
            self._said = now
            finished = sum(share >= 1 for share in self._share.values())
            self._say(f"{cell.key}: {words}; {finished} of {len(self._work)} cells, {self._left(now)}")

    def _left(self, now: float) -> str:
        done = self._sum(self._share)
        mine = done - self._sum(self._found)
        if mine <= 0:
            return "time left not known yet"
        seconds = (now - self._began) / mine * (sum(self._work.values()) - done)
        return f"{int(seconds // 3600)} h {int(seconds % 3600 // 60):02} min left"

    def _sum(self, shares: Mapping[Cell, float]) -> float:
        return sum(self._work[cell] * share for cell, share in shares.items())


def run_cells(cells: Sequence[Cell], command: Callable[[Cell], list[str]], jobs: int, board: Board) -> None:
    """Run `command` of every cell, `jobs` at a time, none before what it starts from.

    Args:
        cells: in an order in which what is needed comes first.
        command: arguments behind the interpreter's name; it prints `ITERATION/ITERATIONS loss LOSS` lines.
        jobs: how many at once; results do not depend on it.
        board: is told.

    Raises:
        TrainingError: cells failed; all that do not start from them are done first.
    """
    waiting, unfinished = list(cells), set(cells)
    running, failures = dict[Future[None], Cell](), list[str]()
    with ThreadPoolExecutor(jobs) as pool:
        while True:
            ready = [cell for cell in waiting if unfinished.isdisjoint(cell.starts.values())]
            for cell in ready[: jobs - len(running)]:
                waiting.remove(cell)
                running[pool.submit(_run, cell, command(cell), board)] = cell
            if not running:
                break
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                cell = running.pop(future)
                if error := future.exception():
                    failures.append(str(error))  # what starts from it never becomes ready
                else:
                    unfinished.remove(cell)
    if failures:
        raise TrainingError(" ".join(failures))


def _run(cell: Cell, arguments: list[str], board: Board) -> None:
    last = ""
    with subprocess.Popen(
        [sys.executable, *arguments], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as process:
        for line in process.stdout or ():
            last = line.strip() or last
            if found := _PROGRESS.match(line):
                done, of = int(found[1]), int(found[2])
                board.at(cell, min(0.99, done / of), f"iteration {done} of {of}, loss {found[3]}")
    if process.returncode != 0:
        raise TrainingError(f"The cell {cell.key} failed ({last or process.returncode}); "
                            "the same command goes on once that is mended.")  # fmt: skip
    board.at(cell, 1.0, "done")
