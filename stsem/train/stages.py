"""One stage of a training, from its start, or from where it was stopped, to its finished checkpoint."""

import re
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch

from stsem import chance
from stsem.errors import OutputError, TrainingError, TrainingStoppedError
from stsem.models.zoo import build
from stsem.train.checkpoint import FORMAT, file_sha256, read_checkpoint, write_checkpoint
from stsem.train.curves import points, write_csv
from stsem.train.dataset import Pairs, class_shares
from stsem.train.job import Job
from stsem.train.judge import judge
from stsem.train.loop import Training
from stsem.train.objective import class_weights
from stsem.train.starts import begin

CHECKPOINT, CURVES = "checkpoint.pt", "curves.csv"
JUDGED = 100
"""Validation pairs while a training runs; at its end all of them."""


_DIFFERENT = {"pairs": "the data differ", "starts": "the weights to begin with differ",
              "inputs": "classes or forms of the inputs differ",
              "machine": "device, workers or precision differ"}  # fmt: skip
"""How it is said that a part of a stage's identity differs, where the values say nothing to people."""


@dataclass(frozen=True)
class Progress:
    """Where a stage stands.

    Args:
        stage: which.
        iteration, iterations: done, and in all.
        loss: mean since the last report.
        rate: of the last iteration.
        validation: (mIoU, pixel accuracy) of the last validation; None before the first.
    """

    stage: str
    iteration: int
    iterations: int
    loss: float
    rate: float
    validation: tuple[float, float] | None


def train_stage(
    job: Job, pairs: Pairs, validation: Pairs | None, folder: Path, report: Callable[[Progress], None],
    stopping: Callable[[], bool] = lambda: False,
) -> Path:  # fmt: skip
    """Train to the end, going on from `folder` where a stage of the same numbers and data was stopped there.

    However often it is stopped, even killed, the weights are those of a training that was not (on a GPU: up to
    rounding).

    Args:
        job: what is trained, and how.
        pairs: to learn from.
        validation: other pairs, to judge the averaged weights on; they do not change the weights.
        folder: for the checkpoint and `curves.csv`.
        report: called every `report_every` iterations.
        stopping: asked after every iteration; when it says so, the stage is saved and stops.

    Returns:
        The finished checkpoint.

    Raises:
        TrainingStoppedError: because of `stopping`.
        TrainingError: data or weights that cannot be used, or `folder` has a checkpoint of another training.
        OutputError: the folder cannot be written.
    """
    _make(folder)
    path = folder / CHECKPOINT
    identity = _identity(job, pairs)
    state = _matching(path, identity) if path.exists() else None
    if state is not None and state["iteration"] == job.numbers.iterations:
        return path
    with _threads(job.machine.threads), closing(_training(job, pairs, state)) as training:
        _run(training, job, pairs, validation, path, identity, report, stopping)
    return path


def finished(job: Job, folder: Path) -> Path | None:
    """The checkpoint of a stage that was trained to its end, on any machine, from any data; None without such a one.

    Args:
        job: the stage; where it has starts, it must have begun with them.
        folder: as of `train_stage`.

    Raises:
        TrainingError: the checkpoint there is damaged, or a start cannot be read.
    """
    path = folder / CHECKPOINT
    if not path.exists():
        return None
    state, wanted = read_checkpoint(path), job.identity()
    del wanted["machine"]
    if job.starts:
        wanted["starts"] = _sums(job)
    wanted["iteration"] = job.numbers.iterations
    return path if all(state.get(key) == value for key, value in wanted.items()) else None


def _run(
    training: Training, job: Job, pairs: Pairs, validation: Pairs | None, path: Path, identity: dict[str, Any],
    report: Callable[[Progress], None], stopping: Callable[[], bool],
) -> None:  # fmt: skip
    recipe = job.numbers
    while training.iteration < recipe.iterations:
        training.step(pairs)
        now, last = training.iteration, training.iteration == recipe.iterations
        if validation is not None and (last or now % recipe.validate_every == 0):
            training.record.validations[now] = _judged(training, job, validation, None if last else JUDGED)
        stop = stopping() and not last
        if last or stop or now % recipe.checkpoint_every == 0:
            write_csv(path.with_name(CURVES), points(training.record, recipe))
            write_checkpoint(path, identity | training.state())
        if last or now % recipe.report_every == 0:
            report(_progress(training, job))
        if stop:
            raise TrainingStoppedError(
                f"The stage {job.stage} was stopped after {now} of {recipe.iterations} iterations."
            )


def _training(job: Job, pairs: Pairs, state: dict[str, Any] | None) -> Training:
    """A new training, or one that goes on from `state`."""
    torch.manual_seed(chance.hash31(job.seed, "initial weights"))
    network = build(job.architecture, len(job.sidecar.classes))
    sidecar = job.sidecar.for_inputs(network.inputs)
    if "difference" in network.inputs and sidecar.difference is None:
        raise TrainingError(f"The architecture {job.architecture} takes the difference, which the sidecar does not "
                            "describe; add a section [difference].")  # fmt: skip
    begun = begin(network, job, sidecar, pairs)
    weights = class_weights(class_shares(pairs, len(sidecar.classes)), job.numbers.balance)
    training = Training(
        network, sidecar, weights, job.numbers, job.machine, seed=job.seed, new=begun.new,
        frozen=job.numbers.freeze_norm and begun.given,
    )  # fmt: skip
    if state is not None:
        training.restore(state)
    return training


def _identity(job: Job, pairs: Pairs) -> dict[str, Any]:
    return {"format": FORMAT, **job.identity(), "pairs": pairs.fingerprint, "starts": _sums(job)}


def _sums(job: Job) -> dict[str, str]:
    return {name: file_sha256(path) for name, path in sorted(job.starts.items())}


def _matching(path: Path, identity: dict[str, Any]) -> dict[str, Any]:
    """The state in a checkpoint of the same training. Raises TrainingError."""
    state = read_checkpoint(path)
    if other := [_difference(key, state.get(key), value) for key, value in identity.items() if state.get(key) != value]:
        raise TrainingError(f"The checkpoint {path} is of another training: {'; '.join(other)}. "
                            "Give the same again, or another folder.")  # fmt: skip
    return state


def _difference(key: str, kept: Any, given: Any) -> str:
    """Which of them differs, and how, where that can be told in few words."""
    if key == "recipe" and isinstance(kept, str):
        pairs = zip(_numbers(kept), _numbers(given), strict=False)
        return "the recipe has " + ", ".join(f"{now}, not {was}" for was, now in pairs if was != now)
    return _DIFFERENT.get(key, f"the {key} is {given}, not {kept}")


def _numbers(recipe: str) -> list[str]:
    return re.split(r", (?=[a-z])", recipe)


def _judged(training: Training, job: Job, validation: Pairs, most: int | None) -> tuple[float, float]:
    device, workers = job.machine.device, job.machine.workers
    scores = judge(training.averaged, job.sidecar, validation, device=device, workers=workers, most=most).compute()
    return scores.miou, scores.pixel_accuracy


def _progress(training: Training, job: Job) -> Progress:
    recipe, record = job.numbers, training.record
    since = (training.iteration - 1) // recipe.report_every * recipe.report_every
    loss, seen = sum(record.losses[since:]) / (training.iteration - since), record.validations
    return Progress(job.stage, training.iteration, recipe.iterations, loss, recipe.rate_at(training.iteration - 1),
                    seen[max(seen)] if seen else None)  # fmt: skip


@contextmanager
def _threads(count: int) -> Iterator[None]:
    """Threads inside torch's operators, which decide the order of its sums."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as err:
        raise OutputError(f"The folder {folder} cannot be made: {err.strerror or err}.") from err
