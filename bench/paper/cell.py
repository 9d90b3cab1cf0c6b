"""One cell: trained, judged on the test set, and written down."""

import fcntl
import json
import platform
from collections.abc import Callable
from dataclasses import asdict
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import torch

from bench.paper.data import Data
from bench.paper.facts import Facts
from bench.paper.plan import Cell
from bench.paper.problem import Neighbour, Problem, ProblemSet
from stsem import hostclock
from stsem.aside import write_aside
from stsem.errors import TrainingError
from stsem.models.network import SegmentationNetwork
from stsem.train.dataset import Pairs
from stsem.train.job import Job, Machine
from stsem.train.judge import judge
from stsem.train.publish import load_checkpoint
from stsem.train.stages import Progress, train_stage

MACHINE = Machine(workers=1, threads=1, bf16=True)
"""One thread: two processes side by side are faster on two cores than one with two threads."""

Result = dict[str, Any]


def result_path(out: Path, data: str, cell: Cell) -> Path:
    """Where the result of a cell is written."""
    return out / "results" / data / f"{cell.file}.json"


def is_done(cell: Cell, data: Data, facts: Facts, out: Path) -> bool:
    """Whether a cell has its result. Raises TrainingError when that is of other data or another recipe."""
    path = result_path(out, data.name, cell)
    if not path.is_file():
        return False
    kept = json.loads(path.read_text(encoding="utf-8"))
    wanted = json.loads(json.dumps(_described(cell, data, facts)))
    if other := [key for key, value in wanted.items() if kept.get(key) != value]:
        raise TrainingError(f"The result {path} is of another training (its {', '.join(other)} differ); "
                            "remove it and its folder under cells, or give another --out.")  # fmt: skip
    return True


def run_cell(cell: Cell, data: Data, facts: Facts, out: Path, report: Callable[[Progress], None]) -> None:
    """Train, judge and write the result of a cell, unless it is there; what was stopped goes on where it stood.

    Args:
        cell: whose starts are trained already.
        data: prepared.
        facts: of the data.
        out: folder of everything that is made.
        report: as of `train_stage`.

    Raises:
        TrainingError: a start is missing, or what lies there is of another training.
    """
    folder, path = _folder(out, data, cell), result_path(out, data.name, cell)
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # a process whose parent was killed may still be at it
        if is_done(cell, data, facts, out):
            return
        problem, right, spent = facts.problem, data.pairs("train"), Spent(folder / "training_cpu_ns")

        def counted(now: Progress) -> None:
            spent.keep()
            report(now)

        checkpoint = train_stage(job(cell, data, out), ProblemSet(right, problem, cell.dose), None, folder, counted)
        training_ns = spent.keep()
        torch.set_num_threads(1)
        network = load_checkpoint(checkpoint, len(data.classes))
        matrix = judge(network, data.sidecar, data.pairs("test")).matrix
        result = _described(cell, data, facts) | {
            "weights_sha256": weights_sha256(network),
            "matrix": matrix.tolist(),
            "neighbour": _at_neighbour(network, data, right, problem),
            "host": {"machine": hostclock.machine_name(), "torch": torch.__version__, "system": platform.system(),
                     "training_cpu_s_all_processes": training_ns // 10**9},
        }  # fmt: skip
        write_result(path, result)


class Spent:
    """CPU time of all processes that trained a cell, this one from now on; what a killed one did after it last kept
    its time is lost.

    Args:
        path: file with the sum so far, if there is any.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._begun = path, hostclock.process_cpu_ns()
        self._before = int(path.read_text()) if path.is_file() else 0

    def keep(self) -> int:
        """Write the sum until now, and give it: nanoseconds."""
        total = self._before + hostclock.process_cpu_ns() - self._begun
        write_aside(self._path, f"{total}\n".encode())
        return total


def _at_neighbour(network: SegmentationNetwork, data: Data, right: Pairs, problem: Problem) -> dict[str, int] | None:
    """What becomes of the neighbour's floor; None without a neighbour."""
    if problem.neighbour is None:
        return None
    floor = judge(network, data.sidecar, Neighbour(right, problem.neighbour)).matrix[problem.floor]
    return {"floor_pixels": int(floor.sum()), "called_floor": int(floor[problem.floor]),
            "called_lamp": int(floor[problem.lamp])}  # fmt: skip


def job(cell: Cell, data: Data, out: Path) -> Job:
    """What `stsem.train` is asked for."""
    what, recipe = cell.what, data.recipe
    starts = {name: _folder(out, data, start) / "checkpoint.pt" for name, start in cell.starts.items()}
    for start in starts.values():
        if not start.is_file():
            raise TrainingError(f"The cell {cell.key} starts from {start}, which is not there; run that cell first.")
    if what.second and what.stage != "fused":
        recipe = recipe.fused()
    return Job(what.architecture, what.stage, data.sidecar, recipe, cell.training_seed, starts, MACHINE)


def _folder(out: Path, data: Data, cell: Cell) -> Path:
    return out / "cells" / data.name / cell.file


def _described(cell: Cell, data: Data, facts: Facts) -> Result:
    numbers = data.recipe.fused() if cell.what.second else data.recipe
    return {
        "cell": cell.key, "data": data.name, "network": cell.network, "dose": cell.dose, "seed": cell.seed,
        "architecture": cell.what.architecture, "stage": cell.what.stage,
        "starts": {name: start.key for name, start in cell.starts.items()},
        "recipe": asdict(numbers), "data_sha256": facts.sha256, "pairs": facts.pairs,
        "problem_image": facts.image, "classes": list(data.classes.names),
    }  # fmt: skip


def weights_sha256(network: SegmentationNetwork) -> str:
    """Of the names and values of all weights and statistics, in order of names."""
    digest = sha256()
    for name, value in sorted(network.state_dict().items()):
        digest.update(name.encode() + b"\0" + np.ascontiguousarray(value.cpu().numpy()).tobytes())
    return digest.hexdigest()


def write_result(path: Path, result: Result) -> None:
    """One key a line, aside and renamed."""
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = ",\n".join(f"{json.dumps(key)}: {json.dumps(value)}" for key, value in result.items())
    write_aside(path, f"{{\n{lines}\n}}\n".encode())
