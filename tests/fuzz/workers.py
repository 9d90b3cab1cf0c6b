"""Worker processes: each takes mutants one by one, under a limit of memory, and is ended when one takes too long."""

import multiprocessing
import resource
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path

MAX_DATA_BYTES = 2 << 30
PATIENCE_S = 60.0
"""A mutant that takes longer ends its process; one that takes longer than 10 s is a failure anyway."""

READY = "ready"
Task = tuple[str, int]
"""(log, seed)"""


@dataclass(frozen=True)
class Verdict:
    """What came of one mutant.

    Args:
        log, seed: of the mutant.
        kind: of the outcome: `valid`, `lossy`, `refused`, `crashed`, or `died` with its process.
        reason: why that is a failure; "" when it is none.
        what: the damage or the sentence.
        operators: what was done to the log.
        seconds, peak_bytes: of the evaluation, and of the process so far.
    """

    log: str
    seed: int
    kind: str
    reason: str
    what: str = ""
    operators: tuple[str, ...] = ()
    seconds: float = 0.0
    peak_bytes: int = 0


Work = Callable[[Path], Callable[[Task], Verdict]]
"""Made once in each process, in a folder of its own."""


class _Worker:
    """One process and what it is at."""

    def __init__(self, work: Work) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process: SpawnProcess = context.Process(target=_serve, args=(work, theirs), daemon=True)
        self.process.start()
        theirs.close()
        self.task: Task | None = None

    def wait_until_ready(self) -> None:
        """Until its `work` is made, however long that takes.

        Raises:
            RuntimeError: it cannot be made; the process has said why on stderr.
        """
        if self.result() != READY:
            raise RuntimeError("a worker process could not start")

    def give(self, task: Task) -> None:
        self.task = task
        self.pipe.send(task)

    def result(self) -> Verdict | str | None:
        """Of its task, or READY; None when the process died."""
        try:
            found: Verdict | str = self.pipe.recv()
        except (EOFError, ConnectionError):
            return None
        return found

    def end(self) -> None:
        self.process.kill()
        self.process.join()
        self.pipe.close()


def verdicts(work: Work, tasks: Sequence[Task], processes: int, patience_s: float = PATIENCE_S) -> Iterator[Verdict]:
    """The verdict of every task, as they come in."""
    todo, workers = iter(tasks), [_Worker(work) for _ in range(processes)]
    try:
        for worker in workers:
            worker.wait_until_ready()
        busy = [worker for worker in workers if _begin(worker, todo)]
        while busy:
            ready = wait([worker.pipe for worker in busy], patience_s)
            for worker in [w for w in busy if w.pipe in ready] or busy:
                found = worker.result() if ready else None
                busy.remove(worker)
                if isinstance(found, Verdict):
                    yield found
                else:
                    yield _died(worker, patience_s, in_time=bool(ready))
                    worker = _replace(workers, worker, work)
                if _begin(worker, todo):
                    busy.append(worker)
    finally:
        for worker in workers:
            worker.end()


def _replace(workers: list[_Worker], dead: _Worker, work: Work) -> _Worker:
    dead.end()
    workers.remove(dead)
    workers.append(new := _Worker(work))
    new.wait_until_ready()
    return new


def _begin(worker: _Worker, todo: Iterator[Task]) -> bool:
    task = next(todo, None)
    if task is not None:
        worker.give(task)
    return task is not None


def _died(worker: _Worker, patience_s: float, *, in_time: bool) -> Verdict:
    log, seed = worker.task or ("", 0)
    worker.process.join(5 if in_time else 0)
    reason = f"the process ended with {worker.process.exitcode}" if in_time else f"took more than {patience_s:g} s"
    return Verdict(log, seed, "died", reason)


def _serve(work: Work, pipe: Connection) -> None:
    """The other process."""
    resource.setrlimit(resource.RLIMIT_DATA, (MAX_DATA_BYTES, MAX_DATA_BYTES))
    with tempfile.TemporaryDirectory(prefix="stsem-fuzz-") as folder:
        judge = work(Path(folder))
        pipe.send(READY)
        while True:
            try:
                task = pipe.recv()
            except EOFError:
                return
            pipe.send(judge(task))
