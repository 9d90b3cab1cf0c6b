"""The thirteen convolutions of VGG16, in the five blocks between its pools.

Simonyan and Zisserman, Very Deep Convolutional Networks for Large-Scale Image Recognition (2014), table 1, column D.
"""

from collections.abc import Sequence
from itertools import pairwise

from torch import nn

from stsem.models.network import scaled

BLOCKS = ((64, 2), (128, 2), (256, 3), (512, 3), (512, 3))
"""Channels and number of the 3x3 convolutions of each block."""


def vgg16(
    width: float = 1.0, *, batch_norm: bool = False, dilations: Sequence[int] = (1, 1, 1, 1, 1), inputs: int = 3
) -> nn.ModuleList:
    """The five blocks, (B, c, H, W) -> (B, c', H, W) each; who uses them pools between them.

    14,714,688 weights at the full width, as in the authors' model without its classifier. With batch normalisation
    14,718,912: convolutions then have no bias of their own, which the normalisation would take away again.

    Args:
        width: factor on every number of channels; 1 is the paper's.
        batch_norm: after every convolution.
        dilations: of the convolutions of each block.
        inputs: channels of the first block's input.
    """
    blocks, cin = nn.ModuleList(), inputs
    for cout, (_, count), dilation in zip(channels(width), BLOCKS, dilations, strict=True):
        blocks.append(convolutions([cin, *[cout] * count], batch_norm=batch_norm, dilation=dilation))
        cin = cout
    return blocks


def channels(width: float = 1.0) -> tuple[int, ...]:
    """Of the five blocks' outputs."""
    return tuple(scaled(full, width) for full, _ in BLOCKS)


def convolutions(chain: Sequence[int], *, batch_norm: bool = False, dilation: int = 1) -> nn.Sequential:
    """3x3 convolutions with ReLU from chain[0] channels to chain[1], and so on; the grid keeps its size."""
    layers: list[nn.Module] = []
    for cin, cout in pairwise(chain):
        layers.append(convolution(cin, cout, 3, dilation, bias=not batch_norm))
        layers += [nn.BatchNorm2d(cout), nn.ReLU(inplace=True)] if batch_norm else [nn.ReLU(inplace=True)]
    return nn.Sequential(*layers)


def convolution(cin: int, cout: int, kernel: int, dilation: int = 1, *, bias: bool = True) -> nn.Conv2d:
    """A convolution that keeps the grid's size, to be followed by a ReLU.

    Drawn as in He et al., Delving Deep into Rectifiers (2015), equation 10, as in SegNet's
    Caffe models: torch's own draw fades to nothing over thirteen layers.
    """
    layer = nn.Conv2d(cin, cout, kernel, padding=dilation * (kernel // 2), dilation=dilation, bias=bias)
    nn.init.kaiming_normal_(layer.weight, nonlinearity="relu")
    if layer.bias is not None:
        nn.init.zeros_(layer.bias)
    return layer
