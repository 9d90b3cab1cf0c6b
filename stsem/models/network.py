"""What training, export and uncertainty ask of every network."""

from collections.abc import Mapping
from dataclasses import dataclass

from torch import Tensor, nn
from torch.nn import functional

CHANNELS: Mapping[str, int] = {"image": 3, "difference": 3, "depth": 1}
"""Inputs there can be, each (B, channels, H, W) float32. Depth is in metres, 0 where it is unknown."""
NARROWEST = 8


@dataclass(frozen=True, eq=False)
class SideAnswer:
    """What a part of the network says on its own, for the loss alone.

    Args:
        logits: (B, C, h', w') on a grid of its own.
        weight: of its cross-entropy in the loss.
        enlarged: judged like the network's answer, on the labels' grid; else on its own grid, which costs less.
    """

    logits: Tensor
    weight: float
    enlarged: bool = False


@dataclass(frozen=True, eq=False)
class Answers:
    """What a training judges.

    Args:
        probabilities: (B, C, h, w) float32, sum 1 over C: what `SegmentationNetwork.forward` gives.
        sides: auxiliary heads and single streams.
    """

    probabilities: Tensor
    sides: tuple[SideAnswer, ...] = ()


class SegmentationNetwork(nn.Module):
    """A network that gives class probabilities. A network of the zoo defines `features` and `head`, and more where it
    differs; it is built as `Network(classes, *widths)`.

    Modules under the name `auxiliary`, at any level, serve the loss alone: `forward` does not use them.

    Attributes:
        inputs: names from `CHANNELS`, in the order of the arguments.
    """

    inputs: tuple[str, ...] = ("image",)

    def features(self, *inputs: Tensor) -> tuple[Tensor, ...]:
        """Everything up to the first dropout, which Monte Carlo dropout runs once; each (B, ...)."""
        raise NotImplementedError

    def head(self, *features: Tensor) -> Tensor:
        """From `features` to probabilities (B, C, h, w) float32 at the network's own grid, dropout inside.

        The corners of the grid are corners of the image (`align_corners=True`), whatever its size.
        """
        raise NotImplementedError

    def forward(self, *inputs: Tensor) -> Tensor:
        """Inputs of any size that `nearest_side` keeps -> probabilities (B, C, h, w) float32."""
        return self.head(*self.features(*inputs))

    def answers(self, *inputs: Tensor) -> Answers:
        """The same, and what else the loss judges; inputs may have any size here."""
        return Answers(self(*inputs))

    def nearest_side(self, side: int) -> int:
        """The width or height nearest to `side` that can be exported; here any."""
        return side

    side_rule: str = "any size"
    """What `nearest_side` keeps, for messages: "48 k - 7"."""

    def fits(self, side: int) -> bool:
        """Whether a width or height can be exported as it is."""
        return self.nearest_side(side) == side

    @property
    def stochastic(self) -> bool:
        """Whether there is dropout, so that `head` can be asked many times."""
        return any(dropouts(self))


def dropouts(network: nn.Module) -> dict[str, nn.Dropout | nn.Dropout2d]:
    """The dropout layers that `forward` passes through, by name."""
    return {
        name: module for name, module in network.named_modules()
        if isinstance(module, nn.Dropout | nn.Dropout2d) and module.p > 0 and "auxiliary" not in name.split(".")
    }  # fmt: skip


def softmax(logits: Tensor) -> Tensor:
    """Probabilities of logits (B, C, ...), in float32 whatever the convolutions run in."""
    return functional.softmax(logits.float(), 1)


def scaled(channels: int, width: float) -> int:
    """A paper's number of channels at a width factor, at least `NARROWEST`."""
    return max(NARROWEST, round(channels * width))
