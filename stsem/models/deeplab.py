"""DeepLab v2: a dilated ResNet-101, four dilated classifiers whose scores add up, and three sizes of the image.

Chen et al., DeepLab: Semantic Image Segmentation with Deep Convolutional Nets, Atrous Convolution, and Fully Connected
CRFs (2016), figures 1 and 7 and section 4.1.2. The paper's CRF refines the scores after training; here it is
`stsem.models.crf_rnn`'s layer, which is trained with the rest.
"""

import torch
from torch import Tensor, nn
from torch.nn import functional

from stsem.models.crf_rnn import MeanField, affinities
from stsem.models.network import Answers, SegmentationNetwork, SideAnswer, softmax
from stsem.models.resnet import ResNet, ResNetSpec

RATES = (6, 12, 18, 24)
"""Dilations of the classifiers, ASPP-L."""
SCALES = (1.0, 0.75, 0.5)
"""Of the image's sides."""
STRIDE = 8
PER_SCALE = 1.0
"""Weight of each scale's own cross-entropy beside that of the largest score, as in the authors' model."""


class AtrousPyramid(nn.Module):
    """Atrous spatial pyramid pooling: 3x3 classifiers that look at the same features from four distances."""

    def __init__(self, channels: int, classes: int) -> None:
        super().__init__()
        self.classifiers = nn.ModuleList(nn.Conv2d(channels, classes, 3, padding=rate, dilation=rate) for rate in RATES)

    def forward(self, x: Tensor) -> Tensor:
        """Features (B, channels, h, w) -> logits (B, C, h, w)."""
        return torch.stack([classifier(x) for classifier in self.classifiers]).sum(0)


class DeepLab(SegmentationNetwork):
    """DeepLab v2, ASPP-L on ResNet-101.

    Args:
        classes: number of classes C.
        width: factor on the backbone's channels.
        crf: refine the scores by mean field.
        depth: of the ResNet; the paper's is 101.
    """

    def __init__(self, classes: int, width: float = 1.0, *, crf: bool = False, depth: int = 101) -> None:
        super().__init__()
        self.backbone = ResNet(ResNetSpec(depth, width, deep_stem=False, output_stride=STRIDE, stride_first=True))
        self.pyramid = AtrousPyramid(self.backbone.channels, classes)
        self.crf = MeanField(classes) if crf else None

    def _scores(self, image: Tensor) -> list[Tensor]:
        """Logits of every scale, each on a grid of its own."""
        return [self.pyramid(self.backbone(at_scale(image, scale))[1]) for scale in SCALES]

    def features(self, *inputs: Tensor) -> tuple[Tensor, ...]:
        """Image (B, 3, H, W) -> logits (B, C, h, w) and, for the CRF, the affinities of its cells."""
        return self._with_affinities(largest(self._scores(*inputs)), *inputs)

    def _with_affinities(self, logits: Tensor, image: Tensor) -> tuple[Tensor, ...]:
        return (logits,) if self.crf is None else (logits, affinities(image))

    def head(self, *features: Tensor) -> Tensor:
        """Probabilities: at 1/8 of the image's sides, or on the CRF's grid."""
        probabilities: Tensor = softmax(*features) if self.crf is None else self.crf(*features)
        return probabilities

    def answers(self, *inputs: Tensor) -> Answers:
        """With the scores of every scale."""
        scores = self._scores(*inputs)
        probabilities = self.head(*self._with_affinities(largest(scores), *inputs))
        return Answers(probabilities, tuple(SideAnswer(x, PER_SCALE) for x in scores))


def at_scale(image: Tensor, scale: float) -> Tensor:
    """An image (B, 3, H, W) enlarged or reduced to the nearest sides 8 k + 1.

    The corners of the backbone's grid are then those of the image at every scale. The paper's sides are among them:
    321 gives 321, 241 and 161.
    """
    size = [STRIDE * max(1, round((side - 1) * scale / STRIDE)) + 1 for side in image.shape[-2:]]
    if size == list(image.shape[-2:]):
        return image
    return functional.interpolate(image, size=size, mode="bilinear", align_corners=True)


def largest(scores: list[Tensor]) -> Tensor:
    """The largest logit of all scales, on the grid of the first, the finest."""
    fused, *coarser = scores
    for logits in coarser:
        enlarged = functional.interpolate(logits, size=fused.shape[-2:], mode="bilinear", align_corners=True)
        fused = torch.maximum(fused, enlarged)
    return fused
