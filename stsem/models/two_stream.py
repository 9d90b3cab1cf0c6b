"""Two streams, colour and image difference, fused by the weighted sum of their predictions.

The paper's spatio-temporal network: figure 4 e (prediction SUM), weights 0.7 and 0.3 from its section on training.
"""

import torch
from torch import Tensor, nn
from torch.nn import functional

from stsem.models.pspnet import PSPNet
from stsem.models.resnet import ResNetSpec

COLOUR_WEIGHT = 0.7
DIFFERENCE_WEIGHT = 0.3


class TwoStream(nn.Module):
    """P = 0.7 softmax(colour stream) + 0.3 softmax(difference stream), at the grid's size.

    Args:
        colour, difference: the backbones.
        classes: number of classes C.
    """

    def __init__(self, colour: ResNetSpec, difference: ResNetSpec, classes: int) -> None:
        super().__init__()
        self.colour = PSPNet(colour, classes)
        self.difference = PSPNet(difference, classes)

    def forward(self, image: Tensor, difference: Tensor) -> Tensor:
        """(B, 3, H, W) twice -> probabilities (B, C, h, w)."""
        return fuse(self.colour(image), self.difference(difference))


class OneStream(nn.Module):
    """The spatial stream alone: P = softmax(PSPNet(image))."""

    def __init__(self, colour: ResNetSpec, classes: int) -> None:
        super().__init__()
        self.colour = PSPNet(colour, classes)

    def forward(self, image: Tensor) -> Tensor:
        """(B, 3, H, W) -> probabilities (B, C, h, w)."""
        return functional.softmax(self.colour(image), 1)


def fuse(colour: Tensor, difference: Tensor) -> Tensor:
    """Weighted sum of the two softmaxes of logits (B, C, h, w): probabilities that sum to 1."""
    return COLOUR_WEIGHT * functional.softmax(colour, 1) + DIFFERENCE_WEIGHT * functional.softmax(difference, 1)


class Answer(nn.Module):
    """What is exported: a network's probabilities, upsampled, as labels and confidence at the input's size.

    Probabilities are enlarged rather than logits: bilinear weights keep their sum at 1, so the largest is a confidence.
    """

    def __init__(self, network: TwoStream | OneStream) -> None:
        super().__init__()
        self.network = network

    def forward(self, image: Tensor, *difference: Tensor) -> tuple[Tensor, Tensor]:
        """(1, 3, H, W) once or twice -> labels (1, H, W) uint8 and confidence (1, H, W) float32."""
        probabilities = self.network(image, *difference)
        full = functional.interpolate(probabilities, size=image.shape[-2:], mode="bilinear", align_corners=True)
        confidence, labels = torch.max(full, 1)
        return labels.to(torch.uint8), confidence
