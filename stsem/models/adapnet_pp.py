"""AdapNet++ and its fusion SSMA: colour alone, or colour and depth that weigh each other.

Valada, Mohan and Burgard, Self-Supervised Model Adaptation for Multimodal Semantic Segmentation (2019), figures 2, 3, 5
and 6. It is the successor of `stsem.models.adapnet`, whose multiscale units it keeps. Where a figure is silent, layers
are those of the authors' TensorFlow models (DeepSceneSeg/AdapNet-pp and SSMA): no ReLU behind skips, pyramid and
transposed convolutions. Depth comes as metres in one channel where the paper colours it.
"""

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from stsem.models.adapnet import EXPANSION, UNITS, MultiscaleConvolution, cropped
from stsem.models.network import CHANNELS, Answers, SegmentationNetwork, SideAnswer, scaled, softmax
from stsem.models.resnet import conv_bn

RATES = (3, 6, 12)
"""Dilations of the efficient pyramid."""
PYRAMID, BOTTLENECK, SKIP = 256, 64, 24
SQUEEZE_PYRAMID, SQUEEZE_SKIP = 16, 6
"""By how much an SSMA block narrows its features inside."""
AUXILIARY = (0.6, 0.5)
"""Weights of the losses at 1/8 and at 1/4 of the image's sides (section 3.1.3)."""


def conv_bn_relu(cin: int, cout: int, kernel: int, dilation: int = 1) -> nn.Sequential:
    """Convolution, batch normalisation, ReLU."""
    return nn.Sequential(*conv_bn(cin, cout, kernel, dilation=dilation), nn.ReLU(inplace=True))


class Unit(nn.Module):
    """Residual unit with full pre-activation; a multiscale one splits its 3x3 convolution over two dilations."""

    def __init__(self, cin: int, channels: int, stride: int, dilations: Sequence[int]) -> None:
        super().__init__()
        cout = channels * EXPANSION
        self.before = nn.Sequential(nn.BatchNorm2d(cin), nn.ReLU(inplace=True))
        self.reduce = conv_bn_relu(cin, channels, 1)
        self.scales = MultiscaleConvolution(channels, stride, dilations)
        self.expand = nn.Sequential(
            nn.BatchNorm2d(channels), nn.ReLU(inplace=True), nn.Conv2d(channels, cout, 1, bias=False)
        )
        unchanged = stride == 1 and cin == cout
        self.shortcut = None if unchanged else nn.Conv2d(cin, cout, 1, stride, bias=False)

    def forward(self, x: Tensor) -> Tensor:
        """(B, cin, H, W) -> (B, 4 channels, H / stride, W / stride)."""
        active = self.before(x)
        out: Tensor = self.expand(self.scales(self.reduce(active)))
        return out + (x if self.shortcut is None else self.shortcut(active))


class EfficientPyramid(nn.Module):
    """eASPP: a 1x1 convolution, three cascades of dilated ones in a bottleneck, and the mean of the image (figure 3).

    The mean's branch has no batch normalisation: one value a channel has no statistics.
    """

    def __init__(self, cin: int, channels: int, bottleneck: int) -> None:
        super().__init__()
        self.point = conv_bn_relu(cin, channels, 1)
        self.cascades = nn.ModuleList(
            nn.Sequential(
                conv_bn_relu(cin, bottleneck, 1), conv_bn_relu(bottleneck, bottleneck, 3, rate),
                conv_bn_relu(bottleneck, bottleneck, 3, rate), conv_bn_relu(bottleneck, channels, 1),
            )
            for rate in RATES
        )  # fmt: skip
        self.mean = nn.Sequential(nn.Conv2d(cin, channels, 1), nn.ReLU(inplace=True))
        self.join = nn.Sequential(*conv_bn((len(RATES) + 2) * channels, channels, 1))

    def forward(self, x: Tensor) -> Tensor:
        """(B, cin, h, w) -> (B, channels, h, w)."""
        mean = self.mean(x.mean((2, 3), keepdim=True)).expand(-1, -1, *x.shape[-2:])
        out: Tensor = self.join(torch.cat([self.point(x), *(cascade(x) for cascade in self.cascades), mean], 1))
        return out


class Encoder(nn.Module):
    """ResNet-50 of pre-activated units at 1/16 of the image's sides, with the pyramid behind it (figure 2, left)."""

    def __init__(self, cin: int, width: float) -> None:
        super().__init__()
        stem = scaled(64, width)
        self.stem = nn.Sequential(*conv_bn(cin, stem, 7, 2), nn.ReLU(inplace=True), nn.MaxPool2d(3, 2, 1))
        stages, skips, last = [], [], stem
        for full, stride, dilations in UNITS:
            channels = scaled(full, width)
            units = [Unit(last, channels, stride, dilations[0])]
            last = channels * EXPANSION
            stages.append(nn.Sequential(*units, *(Unit(last, channels, 1, rates) for rates in dilations[1:])))
            skips.append(last)
        self.fine, self.middle, self.coarse = stages[0], stages[1], nn.Sequential(*stages[2:])
        self.after = nn.Sequential(nn.BatchNorm2d(last), nn.ReLU(inplace=True))
        self.pyramid = EfficientPyramid(last, scaled(PYRAMID, width), scaled(BOTTLENECK, width))
        self.skip_fine, self.skip_middle = (nn.Sequential(*conv_bn(n, scaled(SKIP, width), 1)) for n in skips[:2])

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """(B, cin, H, W) -> features at 1/16, and skips at 1/8 and 1/4 of the sides, rounded up."""
        fine = self.fine(self.stem(x))
        middle = self.middle(fine)
        return self.pyramid(self.after(self.coarse(middle))), self.skip_middle(middle), self.skip_fine(fine)


class Refine(nn.Module):
    """A stage of the decoder: twice as large, then joined with a skip (figure 2, right).

    Args:
        channels: of the features, skip: of the skip.
        correlate: weigh the skip's channels by the mean of the features first, as behind SSMA (figure 6).
    """

    def __init__(self, channels: int, skip: int, *, correlate: bool) -> None:
        super().__init__()
        self.enlarge = nn.Sequential(
            nn.ConvTranspose2d(channels, channels, 4, 2, 1, bias=False), nn.BatchNorm2d(channels)
        )
        self.correlate = nn.Sequential(nn.Conv2d(channels, skip, 1), nn.ReLU(inplace=True)) if correlate else None
        self.join = nn.Sequential(conv_bn_relu(channels + skip, channels, 3), conv_bn_relu(channels, channels, 3))

    def forward(self, x: Tensor, skip: Tensor) -> tuple[Tensor, Tensor]:
        """(B, channels, h / 2, w / 2) and (B, skip, h, w) -> the enlarged and the joined, (B, channels, h, w)."""
        large = cropped(self.enlarge(x), skip)
        if self.correlate is not None:
            skip = skip * self.correlate(large.mean((2, 3), keepdim=True))
        return large, self.join(torch.cat([large, skip], 1))


class Decoder(nn.Module):
    """Two refinements, and a transposed convolution to the image's size (section 3.1.3)."""

    def __init__(self, classes: int, width: float, *, correlate: bool) -> None:
        super().__init__()
        channels, skip = scaled(PYRAMID, width), scaled(SKIP, width)
        self.middle = Refine(channels, skip, correlate=correlate)
        self.fine = Refine(channels, skip, correlate=correlate)
        self.score = nn.Conv2d(channels, classes, 1)
        self.enlarge = nn.ConvTranspose2d(classes, classes, 8, 4, 2)
        self.auxiliary = nn.ModuleList(nn.Conv2d(channels, classes, 1) for _ in AUXILIARY)

    def forward(self, coarse: Tensor, middle: Tensor, fine: Tensor, image: Tensor) -> tuple[Tensor, tuple[Tensor, ...]]:
        """What `Encoder` gives, and the image for its size -> logits (B, C, H, W), and the two enlarged features."""
        first, x = self.middle(coarse, middle)
        second, x = self.fine(x, fine)
        return cropped(self.enlarge(self.score(x)), image), (first, second)


class SSMA(nn.Module):
    """Self-supervised model adaptation: each modality's features are weighed in the light of both (figure 5).

    Args:
        channels: of each modality.
        squeeze: by how much the gate narrows both inside.
        kernel: side of the convolution that joins both; in the authors' model 1 behind the pyramid, 3 for skips.
    """

    def __init__(self, channels: int, squeeze: int, kernel: int = 3) -> None:
        super().__init__()
        both, inner = 2 * channels, max(1, 2 * channels // squeeze)
        self.gate = nn.Sequential(
            nn.Conv2d(both, inner, 3, padding=1), nn.ReLU(inplace=True), nn.Conv2d(inner, both, 3, padding=1)
        )
        self.join = nn.Sequential(*conv_bn(both, channels, kernel))

    def forward(self, colour: Tensor, depth: Tensor) -> Tensor:
        """Two (B, channels, h, w) -> one."""
        both = torch.cat([colour, depth], 1)
        out: Tensor = self.join(both * torch.sigmoid(self.gate(both)))
        return out


class AdapNetPP(SegmentationNetwork):
    """AdapNet++; with two inputs, two encoders, three SSMA blocks and one decoder.

    Args:
        classes: number of classes C.
        width: factor on the numbers of channels.
        inputs: ("image",) or ("image", "depth").
    """

    def __init__(self, classes: int, width: float = 1.0, *, inputs: tuple[str, ...] = ("image",)) -> None:
        super().__init__()
        self.inputs = inputs
        self.encoders = nn.ModuleDict({name: Encoder(CHANNELS[name], width) for name in inputs})
        fused = len(inputs) > 1
        pyramid, skip = scaled(PYRAMID, width), scaled(SKIP, width)
        rows = ((pyramid, SQUEEZE_PYRAMID, 1), (skip, SQUEEZE_SKIP, 3), (skip, SQUEEZE_SKIP, 3))
        self.fusions = nn.ModuleList(SSMA(*row) for row in rows) if fused else None
        self.decoder = Decoder(classes, width, correlate=fused)

    def _decoded(self, *inputs: Tensor) -> tuple[Tensor, tuple[Tensor, ...]]:
        levels = zip(*(self.encoders[name](x) for name, x in zip(self.inputs, inputs, strict=True)), strict=True)
        if self.fusions is None:
            return self.decoder(*(level for (level,) in levels), inputs[0])  # type: ignore[no-any-return]
        fused = (fusion(*level) for fusion, level in zip(self.fusions, levels, strict=True))
        return self.decoder(*fused, inputs[0])  # type: ignore[no-any-return]

    def features(self, *inputs: Tensor) -> tuple[Tensor, ...]:
        """The logits: there is no dropout."""
        return (self._decoded(*inputs)[0],)

    def head(self, *features: Tensor) -> Tensor:
        """Probabilities (B, C, H, W) at the image's size."""
        return softmax(*features)

    def answers(self, *inputs: Tensor) -> Answers:
        """With the decoder's two auxiliary classifiers."""
        logits, enlarged = self._decoded(*inputs)
        sides = zip(self.decoder.auxiliary, enlarged, AUXILIARY, strict=True)
        return Answers(softmax(logits), tuple(SideAnswer(head(x), weight) for head, x, weight in sides))
