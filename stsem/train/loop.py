"""The training loop: pairs in, weights out. Any iteration can be repeated: its draws are keyed by its number."""

import copy
import math
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import torch
from torch import nn
from torch.nn.modules.batchnorm import _BatchNorm
from torch.optim.swa_utils import AveragedModel

from stsem import chance
from stsem.errors import TrainingError
from stsem.inference.sidecar import Sidecar
from stsem.models.network import SegmentationNetwork
from stsem.train.augment import Augmentation, view
from stsem.train.curves import Record
from stsem.train.dataset import Pairs
from stsem.train.dropout import begin_iteration, key_dropout
from stsem.train.job import Machine
from stsem.train.objective import Objective
from stsem.train.recipe import Recipe
from stsem.train.tensors import tensors

Tensors = tuple[torch.Tensor, ...] | list[torch.Tensor]


class Training:
    """A network in training.

    Args:
        network: with the weights to begin with.
        new: names of parameters that did not come from given weights; empty where none or all of them did.
        sidecar: how inputs are formed, and the classes.
        weights: (C,) class weights of the loss.
        recipe: all numbers; of `iterations`, `batch` and `rate` those of this stage.
        machine: what it runs on.
        seed: of every draw.
        frozen: batch normalisation keeps its statistics.
    """

    def __init__(
        self, network: SegmentationNetwork, sidecar: Sidecar, weights: torch.Tensor, recipe: Recipe, machine: Machine,
        *, seed: int, new: frozenset[str] = frozenset(), frozen: bool = False,
    ) -> None:  # fmt: skip
        self._recipe, self._sidecar, self._machine, self._seed, self._frozen = recipe, sidecar, machine, seed, frozen
        self._objective = Objective(weights.to(machine.device), machine.bf16, recipe.fine)
        self._how = Augmentation.of(recipe, sidecar.mean)
        self.network = network.to(device=machine.device, memory_format=torch.channels_last)  # type: ignore[call-overload]
        key_dropout(self.network)
        self._mean = AveragedModel(self.network, multi_avg_fn=_running_mean(recipe.average), use_buffers=True)
        self._optimiser = _optimiser(self.network, recipe, new)
        self._workers = _workers(recipe.batch, machine.workers, frozen=frozen)
        self._replicas: list[SegmentationNetwork] = []
        self._pool = ThreadPoolExecutor(self._workers, initializer=torch.set_num_threads, initargs=(machine.threads,))
        self.iteration = 0
        self.record = Record()

    @property
    def averaged(self) -> SegmentationNetwork:
        """The network with the running mean of the weights."""
        network = self._mean.module
        assert isinstance(network, SegmentationNetwork)
        return network

    def step(self, pairs: Pairs) -> float:
        """One iteration; returns its loss."""
        if not self._replicas:
            self._replicas = [self.network, *(_replica(self.network) for _ in range(self._workers - 1))]
        for group in self._optimiser.param_groups:
            group["lr"] = self._recipe.rate_at(self.iteration) * group["factor"]
        losses = list(self._pool.map(lambda worker: self._differentiate(worker, pairs), range(self._workers)))
        _gather(self._replicas)
        if self._recipe.clip:
            nn.utils.clip_grad_norm_(self.network.parameters(), self._recipe.clip)
        self._optimiser.step()
        self._mean.update_parameters(self.network)
        loss = sum(losses)
        if not math.isfinite(loss):
            raise TrainingError(f"The loss of iteration {self.iteration} is {loss}: the training diverges; "
                                "begin anew with a smaller --rate.")  # fmt: skip
        self.iteration += 1
        self.record.losses.append(loss)
        return loss

    def _differentiate(self, worker: int, pairs: Pairs) -> float:
        """Gradients of one worker's part of the batch, in its replica; its part of the mean loss."""
        part = range(self._recipe.batch)[worker :: self._workers]
        draws = [chance.generator(self._seed, "view", self.iteration, place) for place in part]
        views = [view(pairs.pair(int(rng.integers(len(pairs)))), self._how, rng) for rng in draws]
        network = self._replicas[worker].train()
        if self._frozen:
            freeze_norm(network)
        begin_iteration(network, self._seed, self.iteration, worker)
        network.zero_grad(set_to_none=True)
        inputs, labels = tensors(views, self._sidecar, network.inputs, self._machine.device)
        loss = self._objective(network, inputs, labels) * (len(views) / self._recipe.batch)
        loss.backward()  # type: ignore[no-untyped-call]
        return float(loss.detach())

    def state(self) -> dict[str, Any]:
        """Everything that is needed to go on, as tensors and plain values."""
        validations = {str(iteration): list(scores) for iteration, scores in self.record.validations.items()}
        return {
            "iteration": self.iteration, "network": self.network.state_dict(), "mean": self._mean.state_dict(),
            "optimiser": self._optimiser.state_dict(), "losses": list(self.record.losses), "validations": validations,
        }  # fmt: skip

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from what `state` gave, exactly as if it had not stopped."""
        self.network.load_state_dict(state["network"])
        self._mean.load_state_dict(state["mean"])
        self._optimiser.load_state_dict(state["optimiser"])
        self.iteration = int(state["iteration"])
        validations = {int(iteration): (scores[0], scores[1]) for iteration, scores in state["validations"].items()}
        self.record = Record(list(state["losses"]), validations)
        self._replicas = []

    def close(self) -> None:
        """Let the workers go."""
        self._pool.shutdown()


def freeze_norm(network: nn.Module) -> None:
    """Let batch normalisation use the statistics it has, in a network in training mode."""
    for layer in network.modules():
        if isinstance(layer, _BatchNorm):
            layer.eval()


def _workers(batch: int, wanted: int, *, frozen: bool) -> int:
    """As many as wanted, but each must have a view, and two where batch normalisation needs to see a spread."""
    least = 1 if frozen else 2
    if batch < least:
        raise TrainingError("Batches of one view have no spread for batch normalisation to learn from; give --batch 2 "
                            "or more, or weights to begin with and freeze_norm = true in the recipe.")  # fmt: skip
    return max(1, min(wanted, batch // least))


def _optimiser(network: SegmentationNetwork, recipe: Recipe, new: frozenset[str]) -> torch.optim.Optimizer:
    """Two groups: what was given, and what is new, whose rate is `new_layers` times as large."""
    named = list(network.named_parameters())
    groups = [
        {"params": [p for name, p in named if (name in new) == is_new], "factor": recipe.new_layers if is_new else 1.0}
        for is_new in (False, True)
    ]
    groups = [group for group in groups if group["params"]]
    if recipe.optimiser == "sgd":
        return torch.optim.SGD(groups, recipe.rate, momentum=recipe.momentum, weight_decay=recipe.decay)
    return torch.optim.AdamW(groups, recipe.rate, weight_decay=recipe.decay)


def _running_mean(factor: float) -> Callable[[Tensors, Tensors, torch.Tensor | int], None]:
    """Exponential mean whose factor starts low: after n updates at most (1 + n) / (10 + n), or noise would linger."""

    def update(means: Tensors, values: Tensors, count: torch.Tensor | int) -> None:
        kept = min(factor, (1 + int(count)) / (10 + int(count)))
        for mean, value in zip(means, values, strict=True):
            mean.lerp_(value, 1 - kept) if kept and mean.is_floating_point() else mean.copy_(value)

    return update


def _replica(network: SegmentationNetwork) -> SegmentationNetwork:
    """The same weights in the same memory, with gradients and batch statistics of its own."""
    twin = copy.deepcopy(network)
    for own, shared in zip(twin.parameters(), network.parameters(), strict=True):
        own.data = shared.data
    return twin


def _gather(replicas: list[SegmentationNetwork]) -> None:
    """Add the gradients of all replicas to the first one's, in their order; what no loss reaches keeps None."""
    for first, *others in zip(*(replica.parameters() for replica in replicas), strict=True):
        for other in others:
            if other.grad is not None:
                first.grad = other.grad if first.grad is None else first.grad + other.grad
