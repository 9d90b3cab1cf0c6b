"""PSPNet: pyramid pooling over a dilated ResNet.

Zhao et al., Pyramid Scene Parsing Network (2016), figure 3, with the auxiliary head of section 3.3.
"""

import torch
from torch import Tensor, nn
from torch.nn import functional

from stsem.models.resnet import ResNet, ResNetSpec, conv_bn

BINS = (1, 2, 3, 6)
DROPOUT = 0.1
AUXILIARY = 0.4
"""Weight of the auxiliary head's loss (section 3.3)."""
NARROWEST_HEAD = 64
SIDE_RULE = "48 k - 7"


def nearest_side(side: int) -> int:
    """The nearest side whose grid (side - 1) / 8 + 1 divides by every bin: 48 k - 7 (473, 521, 569, ...)."""
    return max(1, round((side + 7) / 48)) * 48 - 7


class PyramidPooling(nn.Module):
    """The features beside their means over 1x1, 2x2, 3x3 and 6x6 regions, each reduced to a quarter of the channels.

    Where the grid divides by the bin the pools are fixed kernels, as in the authors' Caffe model, which is also what
    ONNX can express; elsewhere (training crops) they are adaptive.
    """

    def __init__(self, channels: int) -> None:
        super().__init__()
        reduced = channels // len(BINS)
        self.branches = nn.ModuleList(
            nn.Sequential(*conv_bn(channels, reduced, 1), nn.ReLU(inplace=True)) for _ in BINS
        )
        self.channels = channels + reduced * len(BINS)

    def forward(self, x: Tensor) -> Tensor:
        """(B, C, h, w) -> (B, 2 C, h, w)."""
        h, w = x.shape[-2:]
        parts = [x]
        for bins, branch in zip(BINS, self.branches, strict=True):
            mean = branch(_pool(x, bins))
            parts.append(functional.interpolate(mean, size=(h, w), mode="bilinear", align_corners=True))
        return torch.cat(parts, 1)


def _pool(x: Tensor, bins: int) -> Tensor:
    h, w = x.shape[-2:]
    if h % bins or w % bins:
        return functional.adaptive_avg_pool2d(x, bins)
    kernel = (h // bins, w // bins)
    return functional.avg_pool2d(x, kernel, kernel)


class PSPNet(nn.Module):
    """One stream: image-like input -> class scores at 1/8 size.

    Args:
        spec: backbone.
        classes: number of classes C.
        head: False for a stream that is joined with another one before its head.
    """

    def __init__(self, spec: ResNetSpec, classes: int, *, head: bool = True) -> None:
        super().__init__()
        self.backbone = ResNet(spec)
        self.pyramid = PyramidPooling(self.backbone.channels)
        if head:
            self.head = final_head(self.pyramid.channels, classes)
        self.auxiliary = _head(self.backbone.middle_channels, max(NARROWEST_HEAD, self.backbone.channels // 8), classes)

    def forward(self, x: Tensor) -> Tensor:
        """(B, 3, H, W) -> logits (B, C, h, w), h = (H - 1) / 8 + 1."""
        logits: Tensor = self.head(self.pyramid(self.backbone(x)[1]))
        return logits

    def pooled(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """The final feature map behind the pyramid, and the logits of the auxiliary head."""
        middle, late = self.backbone(x)
        return self.pyramid(late), self.auxiliary(middle)


def final_head(channels: int, classes: int) -> nn.Sequential:
    """What follows the pyramid of `channels`, twice the backbone's."""
    return _head(channels, max(NARROWEST_HEAD, channels // 8), classes)


def _head(cin: int, channels: int, classes: int) -> nn.Sequential:
    return nn.Sequential(
        *conv_bn(cin, channels, 3), nn.ReLU(inplace=True), nn.Dropout2d(DROPOUT), nn.Conv2d(channels, classes, 1)
    )


def before_dropout(head: nn.Sequential, x: Tensor) -> Tensor:
    """The part of a head that Monte Carlo dropout runs once."""
    out: Tensor = head[:_FIRST_DROPOUT](x)
    return out


def from_dropout(head: nn.Sequential, x: Tensor) -> Tensor:
    """The rest: dropout and classifier."""
    out: Tensor = head[_FIRST_DROPOUT:](x)
    return out


_FIRST_DROPOUT = 3
