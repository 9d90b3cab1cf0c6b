"""The training loop: pairs in, checkpoints out. Any iteration can be repeated: its draws are keyed by its number."""

import copy
import zipfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch.optim.swa_utils import AveragedModel

from stsem import chance
from stsem.errors import TrainingError
from stsem.inference.preprocess import difference_input, image_input
from stsem.inference.sidecar import Sidecar
from stsem.models.network import SegmentationNetwork
from stsem.models.zoo import build
from stsem.train.augment import Augmentation, View, view
from stsem.train.dataset import PairFolder
from stsem.train.objective import Objective

Tensors = tuple[torch.Tensor, ...] | list[torch.Tensor]
CLIP = 5.0
"""Largest norm of the gradient of all weights together."""


@dataclass(frozen=True)
class Schedule:
    """Numbers of a training.

    Args:
        iterations, batch: how long, and how many views each.
        rate: largest learning rate of AdamW; it falls as (1 - i / iterations) ** power (Zhao et al., section 5.1).
        warm_up: iterations over which the rate rises from zero first.
        power, decay: of the fall, and weight decay.
        average: factor of the running mean of the weights, which is what gets published.
        seed: of every draw.
        workers: threads that each take an equal part of the batch through a replica of the network. On a busy machine
            this beats threads inside the operators, which wait for each other at every one of them. With more than one,
            their dropout masks interleave, so that a repeated iteration is alike but not equal.
        checkpoint_every: iterations between checkpoints.
    """

    iterations: int
    batch: int = 8
    rate: float = 2e-3
    warm_up: int = 200
    power: float = 0.9
    decay: float = 1e-2
    average: float = 0.998
    seed: int = 0
    workers: int = 1
    checkpoint_every: int = 200

    def rate_at(self, iteration: int) -> float:
        """Learning rate of an iteration, counted from 0."""
        fall: float = (1 - iteration / self.iterations) ** self.power
        return self.rate * min(1.0, (iteration + 1) / self.warm_up) * fall


@dataclass(frozen=True)
class Progress:
    """Where a training stands; `loss` is the mean since the last report."""

    iteration: int
    iterations: int
    loss: float
    rate: float


class Training:
    """A network in training.

    Args:
        architecture: a name that `stsem.models.zoo.build` knows.
        sidecar: how inputs are formed, and the classes.
        objective: the loss.
        how: random views.
        schedule: numbers.
    """

    def __init__(
        self, architecture: str, sidecar: Sidecar, objective: Objective, how: Augmentation, schedule: Schedule
    ) -> None:
        torch.manual_seed(chance.hash31(schedule.seed, "initial weights"))
        self._architecture, self._sidecar, self._objective = architecture, sidecar, objective
        self._how, self._schedule = how, schedule
        self.network = build(architecture, len(sidecar.classes))
        _check_inputs(architecture, self.network, sidecar)
        self.network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        self._mean = AveragedModel(self.network, multi_avg_fn=_running_mean(schedule.average), use_buffers=True)
        self._optimiser = torch.optim.AdamW(self.network.parameters(), schedule.rate, weight_decay=schedule.decay)
        self._replicas = [self.network, *(_replica(self.network) for _ in range(schedule.workers - 1))]
        self._pool = ThreadPoolExecutor(schedule.workers)
        self.iteration = 0

    def run(self, pairs: PairFolder, checkpoint: Path, report: Callable[[Progress], None], every: int = 20) -> None:
        """Train to the end of the schedule, writing `checkpoint` on the way and at the end."""
        losses: list[float] = []
        while self.iteration < self._schedule.iterations:
            losses.append(self._step(pairs))
            self.iteration += 1
            if self.iteration % every == 0:
                rate = self._schedule.rate_at(self.iteration)
                report(Progress(self.iteration, self._schedule.iterations, float(np.mean(losses)), rate))
                losses.clear()
            if self.iteration % self._schedule.checkpoint_every == 0 or self.iteration == self._schedule.iterations:
                self.save(checkpoint)

    def _step(self, pairs: PairFolder) -> float:
        torch.manual_seed(chance.hash31(self._schedule.seed, "dropout", self.iteration))
        for group in self._optimiser.param_groups:
            group["lr"] = self._schedule.rate_at(self.iteration)
        losses = list(self._pool.map(lambda worker: self._differentiate(worker, pairs), range(len(self._replicas))))
        for first, *others in zip(*(replica.parameters() for replica in self._replicas), strict=True):
            first.grad = sum((other.grad for other in others), start=first.grad)
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), CLIP)
        self._optimiser.step()
        self._mean.update_parameters(self.network)
        return sum(losses)

    def _differentiate(self, worker: int, pairs: PairFolder) -> float:
        """Gradients of one worker's part of the batch, in its replica."""
        rng = chance.generator(self._schedule.seed, "batch", self.iteration, worker)
        chosen = rng.integers(len(pairs), size=self._schedule.batch // len(self._replicas))
        views = [view(pairs.pair(int(i)), self._how, rng) for i in chosen]
        network = self._replicas[worker].train()
        network.zero_grad(set_to_none=True)
        inputs, labels = tensors(views, self._sidecar)
        loss = self._objective(network, [inputs[name] for name in network.inputs], labels) / len(self._replicas)
        loss.backward()  # type: ignore[no-untyped-call]
        return float(loss.detach())

    def save(self, path: Path) -> None:
        """Write everything that is needed to go on, aside and renamed."""
        state = {
            "architecture": self._architecture, "iteration": self.iteration, "schedule": asdict(self._schedule),
            "network": self.network.state_dict(), "mean": self._mean.state_dict(),
            "optimiser": self._optimiser.state_dict(),
        }  # fmt: skip
        aside = path.with_suffix(".part")
        torch.save(state, aside)
        aside.replace(path)

    def resume(self, path: Path) -> None:
        """Go on from a checkpoint of the same training, exactly as if it had not stopped.

        Raises:
            TrainingError: unreadable, or of another architecture or schedule.
        """
        state = read_checkpoint(path)
        if (state["architecture"], state["schedule"]) != (self._architecture, asdict(self._schedule)):
            raise TrainingError(
                f"The checkpoint {path} is of another training ({state['architecture']}, {state['schedule']}); "
                "give the same numbers, or start from its weights."
            )
        self.network.load_state_dict(state["network"])
        self._mean.load_state_dict(state["mean"])
        self._optimiser.load_state_dict(state["optimiser"])
        self.iteration = int(state["iteration"])

    def start_from(self, path: Path) -> None:
        """Begin with the averaged weights of a checkpoint of the same architecture. Raises TrainingError."""
        self.network.load_state_dict(averaged_weights(read_checkpoint(path)))
        self._mean.module.load_state_dict(self.network.state_dict())


def _running_mean(factor: float) -> Callable[[Tensors, Tensors, torch.Tensor | int], None]:
    """Exponential mean whose factor starts low: after n updates at most (1 + n) / (10 + n), or noise would linger."""

    def update(means: Tensors, values: Tensors, count: torch.Tensor | int) -> None:
        kept = min(factor, (1 + int(count)) / (10 + int(count)))
        for mean, value in zip(means, values, strict=True):
            mean.lerp_(value, 1 - kept) if mean.is_floating_point() else mean.copy_(value)

    return update


def _replica(network: SegmentationNetwork) -> SegmentationNetwork:
    """The same weights in the same memory, with gradients and batch statistics of its own."""
    twin = copy.deepcopy(network)
    for own, shared in zip(twin.parameters(), network.parameters(), strict=True):
        own.data = shared.data
    return twin


def _check_inputs(architecture: str, network: SegmentationNetwork, sidecar: Sidecar) -> None:
    known = {"image", "difference"} if sidecar.difference else {"image"}
    for name in network.inputs:
        if name not in known:
            raise TrainingError(f"The architecture {architecture} takes {name!r}, which these pairs and sidecar do not "
                                f"give ({', '.join(sorted(known))}); choose another one.")  # fmt: skip


def tensors(views: list[View], sidecar: Sidecar) -> tuple[dict[str, torch.Tensor], torch.Tensor]:
    """Inputs by name (B, 3, H, W) and labels (B, H, W) int64, formed by the functions that inference uses."""
    inputs = {"image": [image_input(v.current, sidecar) for v in views]}
    if sidecar.difference:
        inputs["difference"] = [difference_input(v.current, v.previous, sidecar.difference) for v in views]
    stacked = {name: torch.from_numpy(np.stack(x)).to(memory_format=torch.channels_last) for name, x in inputs.items()}
    return stacked, torch.from_numpy(np.stack([v.labels for v in views]).astype(np.int64))


def read_checkpoint(path: Path) -> dict[str, Any]:
    """A checkpoint's state; tensors and plain values only. Raises TrainingError."""
    if not zipfile.is_zipfile(path):  # torch would ask for an unsafe way to read it
        raise TrainingError(f"The checkpoint {path} is missing or damaged; give one that a training wrote.")
    try:
        state: dict[str, Any] = torch.load(path, map_location="cpu", weights_only=True)
    except (OSError, RuntimeError, EOFError, ValueError) as err:
        raise TrainingError(f"The checkpoint {path} cannot be read ({err}); give one that a training wrote.") from err
    return state


def averaged_weights(state: dict[str, Any]) -> dict[str, torch.Tensor]:
    """The averaged weights in a checkpoint's state, as the network names them."""
    return {key.removeprefix("module."): value for key, value in state["mean"].items() if key.startswith("module.")}
