"""FCN: a classifier slid over the image, its scores refined by those of earlier pools.

Long et al., Fully Convolutional Networks for Semantic Segmentation (2015), figure 3; layers as in the authors' Caffe
models voc-fcn32s, voc-fcn16s and voc-fcn8s. Where this file differs from those:

- They pad the image by 100 pixels, so that `fc6` fits small ones, and crop the scores by 19. Here `fc6` pads by three
  cells, which costs less. Both are exact: cell i of stride s is centred on pixel s i + (s - 1) / 2.
- The last enlargement is bilinear and fixed in both. Theirs is a transposed convolution that fades towards the border,
  with C x C kernels, nearly all zeros, that count as weights: 1,806,336 for 21 classes at stride 32, 451,584 at 16 and
  112,896 at 8. With these FCN-8s has their 134,489,759 weights; here it has 134,376,863.
- The enlargements between are learned, as section 4.3 of the paper says; the Caffe models keep them fixed.
- Scores start from random weights, not from zeros: all is trained at once, not one stride after the other.
"""

from typing import Literal

import torch
from torch import Tensor, nn
from torch.nn import functional

from stsem.models import vgg
from stsem.models.network import SegmentationNetwork, scaled, softmax

DROPOUT = 0.5
FC = 4096
"""Channels of `fc6` and `fc7`, fully connected layers turned into convolutions."""


class FCN(SegmentationNetwork):
    """FCN-32s, FCN-16s or FCN-8s on VGG16.

    Args:
        classes: number of classes C.
        width: factor on every number of channels.
        stride: of the finest scores: 32 takes those of `fc7` alone, 16 adds pool 4, 8 adds pool 3, too.
    """

    def __init__(self, classes: int, width: float = 1.0, *, stride: Literal[32, 16, 8] = 8) -> None:
        super().__init__()
        pools, fc = vgg.channels(width), scaled(FC, width)
        self.stride = stride
        self.blocks = vgg.vgg16(width)
        self.fc6 = nn.Sequential(vgg.convolution(pools[-1], fc, 7), nn.ReLU(inplace=True))
        self.fc7 = nn.Sequential(
            nn.Dropout(DROPOUT), vgg.convolution(fc, fc, 1), nn.ReLU(inplace=True), nn.Dropout(DROPOUT)
        )
        self.score = nn.Conv2d(fc, classes, 1)
        skips = {32: (), 16: pools[3:4], 8: pools[3:1:-1]}[stride]
        self.skip_scores = nn.ModuleList(nn.Conv2d(channels, classes, 1) for channels in skips)
        self.upscores = nn.ModuleList(bilinear(classes, 2) for _ in skips)

    def features(self, *inputs: Tensor) -> tuple[Tensor, ...]:
        """Image (B, 3, H, W) -> `fc6` at 1/32, scores of the pools, coarsest first, and a map of the image's size."""
        (image,) = inputs
        x, pools = image, []
        for block in self.blocks:
            x = functional.max_pool2d(block(x), 2, 2, ceil_mode=True)
            pools.append(x)
        skips = (score(pool) for score, pool in zip(self.skip_scores, pools[3:1:-1], strict=False))
        return (self.fc6(x), *skips, image[:, :1])

    def head(self, *features: Tensor) -> Tensor:
        """Probabilities (B, C, H, W)."""
        return softmax(self.scores(*features))

    def scores(self, *features: Tensor) -> Tensor:
        """The logits of `head`."""
        fc6, *skips, canvas = features
        x = self.score(self.fc7(fc6))
        for enlarge, skip in zip(self.upscores, skips, strict=True):
            x = _cropped(enlarge(x), skip) + skip
        size = [side * self.stride for side in x.shape[-2:]]
        return _cropped(functional.interpolate(x, size=size, mode="bilinear", align_corners=False), canvas)


def bilinear(channels: int, factor: int) -> nn.ConvTranspose2d:
    """A transposed convolution (B, C, h, w) -> (B, C, h factor, w factor) that starts as bilinear interpolation."""
    layer = nn.ConvTranspose2d(channels, channels, 2 * factor, factor, factor // 2, bias=False)
    ramp = 1 - (torch.arange(2 * factor) - factor + 0.5).abs() / factor
    with torch.no_grad():
        layer.weight.copy_(torch.eye(channels)[:, :, None, None] * torch.outer(ramp, ramp))
    return layer


def _cropped(x: Tensor, like: Tensor) -> Tensor:
    """Pools round up, so an enlarged map may be larger at its right and lower border."""
    height, width = like.shape[-2:]
    return x[..., :height, :width]
