"""Mutants by log and seed: made, evaluated and judged, in this process or in workers."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from tests.fuzz.evaluate import Bench
from tests.fuzz.judge import MAX_SECONDS, failure
from tests.fuzz.mutate import mutant
from tests.fuzz.subjects import written
from tests.fuzz.workers import Task, Verdict

WHOLE_COMMAND_EVERY = 25


def tasks(logs: Sequence[str], first: int, last: int) -> Iterator[Task]:
    """Seeds from `first` to before `last`, the logs in turn."""
    return ((logs[seed % len(logs)], seed) for seed in range(first, last))


def judging(folder: Path) -> Callable[[Task], Verdict]:
    """The judge of mutants, who knows the undamaged logs; `folder` becomes the workplace of this process."""
    logs = written(folder / "undamaged")
    bench = Bench(folder / "bench")
    references = {}
    for name, data in logs.items():
        whole = bench.evaluate(data, command=True)
        references[name] = whole.content
        if whole.kind != "valid" or (reason := failure(name, whole, {name: whole.content})):
            raise AssertionError(f"the undamaged log {name} is {whole.kind}: {whole.text or reason}")

    def judge(task: Task) -> Verdict:
        name, seed = task
        made = mutant(logs, name, seed)
        command = seed % WHOLE_COMMAND_EVERY == 0
        found = bench.evaluate(made.data, command=command)
        if found.seconds > MAX_SECONDS:  # once more: the machine may have been busy
            found = bench.evaluate(made.data, command=command)
        reason = failure(name, found, references)
        return Verdict(name, seed, found.kind, reason, found.text, made.operators, found.seconds, found.peak_bytes)

    return judge
