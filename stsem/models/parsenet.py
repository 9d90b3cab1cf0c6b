"""ParseNet: every cell also sees the mean over the whole image.

Liu et al., ParseNet: Looking Wider to See Better (2015), figure 1e and section 3.3, on the dilated VGG16 of its
experiments on PASCAL VOC: DeepLab-LargeFOV of Chen et al., Semantic Image Segmentation with Deep Convolutional Nets and
Fully Connected CRFs (2014), section 3.1 and 4.

20,528,981 weights for 21 classes: the published 20.5 M of DeepLab-LargeFOV, two scales, and a classifier twice as wide.
"""

import torch
from torch import Tensor, nn
from torch.nn import functional

from stsem.models import vgg
from stsem.models.network import SegmentationNetwork, scaled, softmax

DROPOUT = 0.5
FC = 1024
"""Channels of `fc6` and `fc7`."""
SCALE = 10.0
"""Of normalised features at first (section 3.3)."""
STRIDES = (2, 2, 2, 1, 1)
"""Of the pools; after them the fifth block and `fc6` dilate."""
DILATIONS = (1, 1, 1, 1, 2)
FC6_DILATION = 12


class ParseNet(SegmentationNetwork):
    """Global context on a dilated VGG16, fused early: normalised, concatenated, then classified.

    Args:
        classes: number of classes C.
        width: factor on every number of channels.
    """

    side_rule = "8 k + 1"

    def __init__(self, classes: int, width: float = 1.0) -> None:
        super().__init__()
        fc = scaled(FC, width)
        self.blocks = vgg.vgg16(width, dilations=DILATIONS)
        self.fc6 = nn.Sequential(vgg.convolution(vgg.channels(width)[-1], fc, 3, FC6_DILATION), nn.ReLU(inplace=True))
        self.fc7 = nn.Sequential(
            nn.Dropout(DROPOUT), vgg.convolution(fc, fc, 1), nn.ReLU(inplace=True), nn.Dropout(DROPOUT)
        )
        self.local_norm, self.global_norm = L2Norm(fc), L2Norm(fc)
        self.classifier = nn.Conv2d(2 * fc, classes, 1)

    def nearest_side(self, side: int) -> int:
        """8 k + 1, so that the grid's corners are the image's."""
        return max(1, round((side - 1) / 8)) * 8 + 1

    def features(self, *inputs: Tensor) -> tuple[Tensor, ...]:
        """Image (B, 3, H, W) -> `fc6` (B, c, h, w), h = ceil(H / 8)."""
        (x,) = inputs
        for block, stride in zip(self.blocks, STRIDES, strict=True):
            x = functional.max_pool2d(block(x), 3, stride, 1)
        return (self.fc6(x),)

    def head(self, *features: Tensor) -> Tensor:
        """Probabilities (B, C, h, w)."""
        local = self.fc7(*features)
        context = self.global_norm(local.mean((2, 3), keepdim=True))
        unpooled = context.expand(-1, -1, *local.shape[-2:])
        return softmax(self.classifier(torch.cat((self.local_norm(local), unpooled), 1)))


class L2Norm(nn.Module):
    """The features of each cell at length 1, times a learned scale for each channel (section 3.3)."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.scale = nn.Parameter(torch.full((channels,), SCALE))

    def forward(self, x: Tensor) -> Tensor:
        """(B, C, h, w) -> (B, C, h, w) float32; zeros stay zeros."""
        return functional.normalize(x.float(), dim=1) * self.scale[:, None, None]
