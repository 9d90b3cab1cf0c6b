"""AdapNet: ResNet-50 whose late units look at two distances at once, and a decoder of two transposed convolutions.

Valada et al., AdapNet: Adaptive Semantic Segmentation in Adverse Environmental Conditions (2017). It sees colour alone;
its authors fuse trained networks of several modalities afterwards (CMoDE, which is not built). Colour and depth in one
network are `stsem.models.adapnet_pp`. Layers are those of the authors' TensorFlow model (DeepSceneSeg/AdapNet), where
every second dilation is 2; here they are the paper's, as ethz-asl/modular_semantic_segmentation has them, too.
"""

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from stsem.models.network import SegmentationNetwork, scaled, softmax
from stsem.models.resnet import conv_bn

UNITS: tuple[tuple[int, int, tuple[tuple[int, ...], ...]], ...] = (
    (64, 1, ((1,),) * 3),
    (128, 2, ((1,),) * 3 + ((1, 2),)),
    (256, 2, ((1,),) * 2 + ((1, 2), (1, 4), (1, 8), (1, 16))),
    (512, 1, ((2, 4), (2, 8), (2, 16))),
)
"""Stages res2 to res5: channels, stride, and the dilations of each unit; a multiscale unit has two."""
EXPANSION = 4
FRONT = 3
"""Channels of the 3x3 convolution at full size in front of ResNet's first one."""
DROPOUT = 0.7
"""Share dropped at the end of the last unit."""


class MultiscaleConvolution(nn.ModuleList):
    """A 3x3 convolution whose output channels are shared out over dilations; the first takes what is left over."""

    def __init__(self, channels: int, stride: int, dilations: Sequence[int]) -> None:
        share = channels // len(dilations)
        shares = [channels - share * (len(dilations) - 1), *(share for _ in dilations[1:])]
        super().__init__(
            nn.Conv2d(channels, part, 3, stride, rate, rate, bias=False)
            for part, rate in zip(shares, dilations, strict=True)
        )

    def forward(self, x: Tensor) -> Tensor:
        """(B, channels, H, W) -> (B, channels, H / stride, W / stride)."""
        return torch.cat([scale(x) for scale in self], 1)


class Unit(nn.Module):
    """Residual unit (He et al. 2015, figure 5 right), its stride on the first convolution."""

    def __init__(self, cin: int, channels: int, stride: int, dilations: Sequence[int], dropout: float = 0.0) -> None:
        super().__init__()
        cout = channels * EXPANSION
        self.body = nn.Sequential(
            *conv_bn(cin, channels, 1, stride), nn.ReLU(inplace=True),
            MultiscaleConvolution(channels, 1, dilations), nn.BatchNorm2d(channels), nn.ReLU(inplace=True),
            *conv_bn(channels, cout, 1), *([nn.Dropout(dropout)] if dropout else []),
        )  # fmt: skip
        unchanged = stride == 1 and cin == cout
        self.shortcut = nn.Identity() if unchanged else nn.Sequential(*conv_bn(cin, cout, 1, stride))
        self.relu = nn.ReLU(inplace=True)

    def forward(self, x: Tensor) -> Tensor:
        """(B, cin, H, W) -> (B, 4 channels, H / stride, W / stride)."""
        out: Tensor = self.relu(self.body(x) + self.shortcut(x))
        return out


class AdapNet(SegmentationNetwork):
    """AdapNet for colour.

    Args:
        classes: number of classes C.
        width: factor on the numbers of channels of the encoder.
    """

    def __init__(self, classes: int, width: float = 1.0) -> None:
        super().__init__()
        last = scaled(64, width)
        self.stem = nn.Sequential(
            *conv_bn(3, FRONT, 3), nn.ReLU(inplace=True),
            *conv_bn(FRONT, last, 7, 2), nn.ReLU(inplace=True), nn.MaxPool2d(3, 2, 1),
        )  # fmt: skip
        stages, outputs = [], []
        for full, stride, dilations in UNITS:
            channels = scaled(full, width)
            units = [Unit(last, channels, stride, dilations[0])]
            last = channels * EXPANSION
            units += [Unit(last, channels, 1, rates) for rates in dilations[1:]]
            stages.append(units)
            outputs.append(last)
        stages[-1][-1] = Unit(last, channels, 1, dilations[-1], DROPOUT)
        self.fine, self.coarse = nn.Sequential(*stages[0], *stages[1]), nn.Sequential(*stages[2], *stages[3][:-1])
        self.last = stages[3][-1]
        self.skip = nn.Sequential(*conv_bn(outputs[1], 2 * classes, 1))
        self.score = nn.Sequential(*conv_bn(last, classes, 1))
        self.enlarge = _enlarging(classes, 2 * classes, 2)
        self.enlarge_fused = _enlarging(2 * classes, classes, 8)

    def features(self, *inputs: Tensor) -> tuple[Tensor, ...]:
        """Image (B, 3, H, W) -> the last unit's input at 1/16, the skip at 1/8, and a map of the image's size."""
        (image,) = inputs
        fine = self.fine(self.stem(image))
        return self.coarse(fine), self.skip(fine), image[:, :1]

    def head(self, *features: Tensor) -> Tensor:
        """Probabilities (B, C, H, W) at the image's size."""
        coarse, skip, canvas = features
        scores = cropped(self.enlarge(self.score(self.last(coarse))), skip) + skip
        return softmax(cropped(self.enlarge_fused(scores), canvas))


def cropped(x: Tensor, like: Tensor) -> Tensor:
    """Without the last rows and columns where odd sides were rounded up before."""
    return x[..., : like.shape[-2], : like.shape[-1]]


def _enlarging(cin: int, cout: int, factor: int) -> nn.Sequential:
    """A transposed convolution (B, cin, h, w) -> (B, cout, h factor, w factor)."""
    layer = nn.ConvTranspose2d(cin, cout, 2 * factor, factor, factor // 2, bias=False)
    return nn.Sequential(layer, nn.BatchNorm2d(cout))
