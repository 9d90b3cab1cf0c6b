"""Dropout whose masks are drawn by what they are for, so that threads and restarts do not change them."""

import torch
from torch import Tensor, nn

from stsem import chance
from stsem.models.network import SegmentationNetwork


class KeyedDropout(nn.Module):
    """Dropout with a seed of its own for every forward pass.

    Args:
        p: share of what is dropped.
        whole: drop whole channels, as `nn.Dropout2d`.
    """

    def __init__(self, p: float, *, whole: bool) -> None:
        super().__init__()
        self.p, self._whole, self.seed, self._calls = p, whole, 0, 0

    def begin(self, seed: int) -> None:
        """Start the iteration of this `seed`."""
        self.seed, self._calls = seed, 0

    def forward(self, x: Tensor) -> Tensor:
        """(B, C, ...) with each value, or channel, either zero or divided by 1 - p."""
        if not self.training or self.p == 0:
            return x
        generator = torch.Generator().manual_seed(self.seed + self._calls)  # on the CPU: one draw for all devices
        self._calls += 1
        shape = (*x.shape[:2], *(1 for _ in x.shape[2:])) if self._whole else x.shape
        kept = torch.rand(shape, generator=generator) >= self.p
        return x * (kept.to(x.dtype) / (1 - self.p)).to(x.device)


def key_dropout(network: SegmentationNetwork) -> None:
    """Replace the dropout layers of a network, in place; its weights and their names stay."""
    for name, layer in list(network.named_modules()):
        if isinstance(layer, nn.Dropout | nn.Dropout2d):
            network.set_submodule(name, KeyedDropout(layer.p, whole=isinstance(layer, nn.Dropout2d)))


def begin_iteration(network: SegmentationNetwork, seed: int, *parts: str | int) -> None:
    """Set the masks of every `KeyedDropout` by `seed`, `parts` and its own name."""
    for name, layer in network.named_modules():
        if isinstance(layer, KeyedDropout):
            layer.begin(chance.hash31(seed, "dropout", name, *parts))
