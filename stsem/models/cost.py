"""What a network costs: counted, not typed."""

from dataclasses import dataclass
from functools import cache

import torch
from tabulate import tabulate
from torch.utils.flop_counter import FlopCounterMode

from stsem.models.network import CHANNELS, SegmentationNetwork
from stsem.models.zoo import ZOO, build

SIDE = 473
"""Pixels a side, the paper's figure for PSPNet on ResNet-50; 48 k - 7."""


@dataclass(frozen=True)
class Cost:
    """Size and work of a network.

    Args:
        parameters: weights that an answer needs.
        auxiliary: further weights, of heads that serve the loss alone.
        multiply_adds: of convolutions and matrix products for one answer.
    """

    parameters: int
    auxiliary: int
    multiply_adds: int


def cost_of(network: SegmentationNetwork, side: int = SIDE) -> Cost:
    """The cost of a network for inputs of `side` x `side`; on the meta device nothing is computed."""
    device = next(network.parameters()).device
    inputs = [torch.zeros(1, CHANNELS[name], side, side, device=device) for name in network.inputs]
    with torch.no_grad(), FlopCounterMode(display=False) as counter:
        network.eval()(*inputs)
    sizes = {name: parameter.numel() for name, parameter in network.named_parameters()}
    auxiliary = sum(size for name, size in sizes.items() if "auxiliary" in name.split("."))
    return Cost(sum(sizes.values()) - auxiliary, auxiliary, counter.get_total_flops() // 2)


@cache
def cost(name: str, classes: int, side: int = SIDE) -> Cost:
    """The cost of a network of the zoo by name. Raises UsageError as `build` does."""
    with torch.device("meta"):
        return cost_of(build(name, classes), side)


def table(classes: int = 13) -> str:
    """Every network of the zoo, at its paper's width, as a table in Markdown."""
    rows = []
    for name, row in ZOO.items():
        found = cost(name, classes)
        paper = f"{row.paper.authors}, {row.paper.title}, {row.paper.figure}"
        rows.append((name, f"{found.parameters / 1e6:.1f}", f"{found.auxiliary / 1e6:.1f}",
                     f"{found.multiply_adds / 1e9:.0f}", paper))  # fmt: skip
    heads = ("name", "M parameters", "M auxiliary", f"G multiply-adds at {SIDE}", "paper")
    return tabulate(rows, heads, tablefmt="pipe", disable_numparse=True, colalign=("left", *["right"] * 3, "left"))
