"""What a network costs: counted, not typed. Run as a program, it writes sizes.csv again."""

from dataclasses import dataclass
from functools import cache

import torch
from torch.utils.flop_counter import FlopCounterMode

from stsem.models.network import CHANNELS, SegmentationNetwork
from stsem.models.sizes import CLASSES, KEPT, SIDE, Size, written
from stsem.models.zoo import ZOO, build


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


def counted(name: str) -> Size:
    """The row of sizes.csv for a network of the zoo."""
    paper = ZOO[name].paper
    found = cost(name, CLASSES)
    return Size(
        name, found.parameters, found.auxiliary, found.multiply_adds, f"{paper.authors}, {paper.title}, {paper.figure}"
    )


if __name__ == "__main__":
    KEPT.write_text(written(map(counted, ZOO)), encoding="utf-8")
