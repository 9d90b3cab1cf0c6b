"""ResNet whose late stages can dilate, so that features stay at 1/8 or 1/16 of the image.

He et al., Deep Residual Learning for Image Recognition (2015), figure 5 and table 1; dilation as in Zhao et al.,
Pyramid Scene Parsing Network (2016), section 3.1.
"""

from dataclasses import dataclass

from torch import Tensor, nn

from stsem.models.network import scaled


@dataclass(frozen=True)
class ResNetSpec:
    """Shape of a backbone.

    Args:
        depth: 18 (basic blocks), 50 or 101 (bottlenecks).
        width: factor on every number of channels; 1 is the paper's.
        deep_stem: three 3x3 convolutions (64, 64, 128) as in PSPNet, instead of one 7x7 (64) as in ResNet.
        output_stride: 8, 16 or 32 pixels of the image per cell of the last grid: stages that do not shrink dilate.
        stride_first: the stride of a bottleneck is on its first 1x1 convolution, as in the authors' Caffe models;
            else on its 3x3, as in hszhao/semseg and torchvision. The weights have the same shapes.
    """

    depth: int = 18
    width: float = 1.0
    deep_stem: bool = True
    output_stride: int = 8
    stride_first: bool = False

    def channels(self, full: int) -> int:
        """`full` channels of the paper at this width."""
        return scaled(full, self.width)


def conv_bn(cin: int, cout: int, kernel: int, stride: int = 1, dilation: int = 1) -> list[nn.Module]:
    """Convolution without bias, same padding, and batch normalisation."""
    padding = dilation * (kernel // 2)
    return [nn.Conv2d(cin, cout, kernel, stride, padding, dilation, bias=False), nn.BatchNorm2d(cout)]


class BasicBlock(nn.Module):
    """Two 3x3 convolutions and a shortcut (He et al., figure 5 left)."""

    expansion = 1

    def __init__(self, cin: int, channels: int, stride: int, dilation: int, *, stride_first: bool = False) -> None:
        super().__init__()
        del stride_first  # its first convolution is 3x3 anyway
        self.body = nn.Sequential(
            *conv_bn(cin, channels, 3, stride, dilation), nn.ReLU(inplace=True),
            *conv_bn(channels, channels, 3, 1, dilation),
        )  # fmt: skip
        self.shortcut = _shortcut(cin, channels, stride)
        self.relu = nn.ReLU(inplace=True)

    def forward(self, x: Tensor) -> Tensor:
        """(B, cin, H, W) -> (B, channels, H / stride, W / stride)."""
        out: Tensor = self.relu(self.body(x) + self.shortcut(x))
        return out


class Bottleneck(nn.Module):
    """1x1 reduce, 3x3, 1x1 expand and a shortcut (He et al., figure 5 right)."""

    expansion = 4

    def __init__(self, cin: int, channels: int, stride: int, dilation: int, *, stride_first: bool = False) -> None:
        super().__init__()
        cout = channels * self.expansion
        outer, inner = (stride, 1) if stride_first else (1, stride)
        self.body = nn.Sequential(
            *conv_bn(cin, channels, 1, outer), nn.ReLU(inplace=True),
            *conv_bn(channels, channels, 3, inner, dilation), nn.ReLU(inplace=True),
            *conv_bn(channels, cout, 1),
        )  # fmt: skip
        self.shortcut = _shortcut(cin, cout, stride)
        self.relu = nn.ReLU(inplace=True)

    def forward(self, x: Tensor) -> Tensor:
        """(B, cin, H, W) -> (B, 4 channels, H / stride, W / stride)."""
        out: Tensor = self.relu(self.body(x) + self.shortcut(x))
        return out


def _shortcut(cin: int, cout: int, stride: int) -> nn.Module:
    if stride == 1 and cin == cout:
        return nn.Identity()
    return nn.Sequential(*conv_bn(cin, cout, 1, stride))


BLOCKS: dict[int, tuple[type[BasicBlock | Bottleneck], tuple[int, int, int, int]]] = {
    18: (BasicBlock, (2, 2, 2, 2)),
    50: (Bottleneck, (3, 4, 6, 3)),
    101: (Bottleneck, (3, 4, 23, 3)),
}
STAGES: dict[int, tuple[tuple[int, int, int, int], tuple[int, int, int, int]]] = {
    8: ((1, 2, 1, 1), (1, 1, 2, 4)),
    16: ((1, 2, 2, 1), (1, 1, 1, 2)),
    32: ((1, 2, 2, 2), (1, 1, 1, 1)),
}
"""Strides and dilations of stages 2 to 5 by output stride; the stem has stride 4."""


class ResNet(nn.Module):
    """The stages of a ResNet, without its classifier.

    Attributes:
        early: stages 2 and 3 (conv2_x and conv3_x); middle: stage 4; late: stage 5.
        middle_channels, channels: of the two feature maps that `forward` returns.
    """

    def __init__(self, spec: ResNetSpec) -> None:
        super().__init__()
        block, counts = BLOCKS[spec.depth]
        self.stem, cin = _stem(spec)
        stages: list[nn.Module] = []
        for full, count, stride, dilation in zip((64, 128, 256, 512), counts, *STAGES[spec.output_stride], strict=True):
            channels = spec.channels(full)
            rows: list[nn.Module] = [block(cin, channels, stride, dilation, stride_first=spec.stride_first)]
            cin = channels * block.expansion
            rows += [block(cin, channels, 1, dilation) for _ in range(count - 1)]
            stages.append(nn.Sequential(*rows))
        self.early, self.middle, self.late = nn.Sequential(*stages[:2]), stages[2], stages[3]
        self.middle_channels, self.channels = cin // 2, cin

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """Features after stage 4 and after stage 5.

        Args:
            x: (B, 3, H, W), any size; the corners of the grid are those of the image where both H and W are 1 modulo
                the output stride.

        Returns:
            (B, middle_channels, h, w) and (B, channels, h, w), h = ceil(H / stride); at output stride 32 the first is
            twice as large.
        """
        middle = self.middle(self.early(self.stem(x)))
        return middle, self.late(middle)


def _stem(spec: ResNetSpec) -> tuple[nn.Sequential, int]:
    """Stride 4; with the number of channels it gives."""
    pool = nn.MaxPool2d(3, 2, 1)
    if not spec.deep_stem:
        channels = spec.channels(64)
        return nn.Sequential(*conv_bn(3, channels, 7, 2), nn.ReLU(inplace=True), pool), channels
    a, b = spec.channels(64), spec.channels(128)
    return nn.Sequential(
        *conv_bn(3, a, 3, 2), nn.ReLU(inplace=True),
        *conv_bn(a, a, 3), nn.ReLU(inplace=True),
        *conv_bn(a, b, 3), nn.ReLU(inplace=True), pool,
    ), b  # fmt: skip
