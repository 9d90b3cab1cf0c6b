"""The training loop: pairs in, checkpoints out. Any iteration can be repeated: its draws are keyed by its number."""

import zipfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn

from stsem import chance
from stsem.errors import TrainingError
from stsem.inference.preprocess import difference_input, image_input
from stsem.inference.sidecar import Sidecar
from stsem.models.zoo import build
from stsem.train.augment import Augmentation, View, view
from stsem.train.dataset import PairFolder
from stsem.train.objective import Objective


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
        bf16: convolutions in bfloat16 where the processor gains by it.
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
    bf16: bool = False
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
        architecture: a row of `stsem.models.zoo.ARCHITECTURES`.
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
        self.network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]
        average = get_ema_multi_avg_fn(schedule.average)  # type: ignore[no-untyped-call]
        self._mean = AveragedModel(self.network, multi_avg_fn=average, use_buffers=True)
        self._optimiser = torch.optim.AdamW(self.network.parameters(), schedule.rate, weight_decay=schedule.decay)
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
        image, difference, labels = self._batch(pairs)
        torch.manual_seed(chance.hash31(self._schedule.seed, "dropout", self.iteration))
        for group in self._optimiser.param_groups:
            group["lr"] = self._schedule.rate_at(self.iteration)
        self.network.train()
        loss = self._objective(self.network, image, difference, labels)
        self._optimiser.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), 5.0)
        self._optimiser.step()
        self._mean.update_parameters(self.network)
        return float(loss.detach())

    def _batch(self, pairs: PairFolder) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        rng = chance.generator(self._schedule.seed, "batch", self.iteration)
        chosen = rng.integers(len(pairs), size=self._schedule.batch)
        return tensors([view(pairs.pair(int(i)), self._how, rng) for i in chosen], self._sidecar)

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


def tensors(views: list[View], sidecar: Sidecar) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Inputs (B, 3, H, W) twice and labels (B, H, W) int64, formed by the functions that inference uses."""
    scale = sidecar.difference
    images = [image_input(v.current, sidecar) for v in views]
    differences = (
        [difference_input(v.current, v.previous if scale else None, scale) for v in views] if scale else images
    )
    image, difference = (torch.from_numpy(np.stack(x)).to(memory_format=torch.channels_last)
                         for x in (images, differences))  # fmt: skip
    return image, difference, torch.from_numpy(np.stack([v.labels for v in views]).astype(np.int64))


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
