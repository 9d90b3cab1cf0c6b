"""CRF-RNN: FCN-8s, and a conditional random field whose mean field inference is a recurrent layer.

Zheng et al., Conditional Random Fields as Recurrent Neural Networks (2015), algorithm 1 and figures 1 and 2. The paper
joins every pixel with every other one at the image's size. Here the field is a quarter as wide and high, and a pixel
hears of those in the 11 x 11 window around it (20 pixels of the image either way), both as in Teichmann and Cipolla,
Convolutional CRFs for Semantic Segmentation (2018): within the window the sums are exact. Ten iterations for 13 classes
at 473 x 473 are 0.45 G multiply-adds, of tensors and not of convolutions, so `stsem.models.cost` does not count them.
"""

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional

from stsem.models.fcn import FCN
from stsem.models.network import Answers, SideAnswer, softmax

SHRINK = 4
"""Pixels of the image per cell of the field, a side."""
RADIUS = 5
WINDOW = 2 * RADIUS + 1
TRAINING_ITERATIONS, TEST_ITERATIONS = 5, 10
THETA_ALPHA, THETA_GAMMA = 160.0 / SHRINK, 3.0 / SHRINK
"""Reach of the bilateral and of the spatial kernel, in cells (equation 3 of Krähenbühl and Koltun 2011)."""
THETA_BETA = 3.0 / 57.4
"""Likeness of colours in the bilateral kernel: 3 of 255 levels, in units of an image whose deviation is 57.4 levels."""
KERNEL_WEIGHTS = (3.0, 5.0)
"""Of the spatial and the bilateral kernel before training."""
_NEVER = 1e9
"""Distance to a cell that does not count."""
UNARY = 1.0
"""Weight of FCN-8s's own cross-entropy, ours: the paper trains FCN-8s first, and then both together."""


class CRFRNN(FCN):
    """FCN-8s and the layer behind it, trained together.

    Args:
        classes: number of classes C.
        width: factor on FCN-8s's channels.
    """

    side_rule = "4 k + 1"

    def __init__(self, classes: int, width: float = 1.0) -> None:
        super().__init__(classes, width, stride=8)
        self.crf = MeanField(classes)

    def nearest_side(self, side: int) -> int:
        """4 k + 1, so that cells are pixels of the image: the field widens what little two libraries differ in when
        they resample, to 3e-4 of a probability."""
        return max(1, round((side - 1) / SHRINK)) * SHRINK + 1

    def features(self, *inputs: Tensor) -> tuple[Tensor, ...]:
        """Image (B, 3, H, W) -> FCN-8s's features, and the affinities of the field's cells."""
        return (*super().features(*inputs), affinities(*inputs))

    def head(self, *features: Tensor) -> Tensor:
        """Probabilities (B, C, h, w), h = ceil(H / 4)."""
        *unary, affinity = features
        return self._refined(self.scores(*unary), affinity)

    def _refined(self, logits: Tensor, affinity: Tensor) -> Tensor:
        probabilities: Tensor = self.crf(logits, affinity)
        return probabilities

    def answers(self, *inputs: Tensor) -> Answers:
        """With what FCN-8s says alone."""
        *unary, affinity = self.features(*inputs)
        logits = self.scores(*unary)
        return Answers(self._refined(logits, affinity), (SideAnswer(logits, UNARY, enlarged=True),))


def affinities(image: Tensor) -> Tensor:
    """How much every cell hears of each cell in its window.

    Args:
        image: (B, 3, H, W), normalised.

    Returns:
        (B, 2, 11, h, 11, w) for the spatial and the bilateral kernel, as `windows` orders it; h = ceil(H / 4). Each
        sums to 1 over the window, with nothing from the cell itself nor from outside.
    """
    cells = _mean_colours(image.float())
    place, missing = _places(cells)
    colour = ((windows(cells) - cells[:, :, None, :, None]) ** 2).sum(1) / (2 * THETA_BETA**2)
    spatial = place / (2 * THETA_GAMMA**2) + missing
    bilateral = place / (2 * THETA_ALPHA**2) + missing + colour
    distances = torch.stack((spatial.expand_as(bilateral), bilateral), 1)
    together = (-distances).transpose(3, 4).flatten(2, 3)  # (B, 2, 121, h, w)
    b, kernels, _, h, w = together.shape
    return functional.softmax(together, 2).reshape(b, kernels, WINDOW, WINDOW, h, w).transpose(3, 4)


def _mean_colours(image: Tensor) -> Tensor:
    """Means around every fourth pixel; the corners are those of the image."""
    cells = [-(-side // SHRINK) for side in image.shape[-2:]]
    fitting = resized(image, [SHRINK * (count - 1) + 1 for count in cells])
    return functional.avg_pool2d(fitting, SHRINK + 1, SHRINK, SHRINK // 2, count_include_pad=False)


def _neighbours(side: int, device: torch.device) -> Tensor:
    """(11, side): where the eleven neighbours of each cell along one side are, beyond the edge too."""
    steps = torch.arange(-RADIUS, RADIUS + 1, device=device)
    return steps[:, None] + torch.arange(side, device=device)


def _places(cells: Tensor) -> tuple[Tensor, Tensor]:
    """Squared distances in cells, and `_NEVER` for the cell itself and beyond the edge, else 0; broadcast over
    (11, h, 11, w)."""
    steps = torch.arange(-RADIUS, RADIUS + 1, device=cells.device)
    place = (steps[:, None, None, None] ** 2 + steps[:, None] ** 2).float()
    h, w = cells.shape[-2:]
    rows, columns = _neighbours(h, cells.device)[..., None, None], _neighbours(w, cells.device)
    there = (rows >= 0) & (rows < h) & (columns >= 0) & (columns < w) & (place > 0)
    return place, _NEVER * (~there).float()


def windows(x: Tensor) -> Tensor:
    """(B, C, h, w) -> (B, C, 11, h, 11, w): [b, c, i, y, j, x] is cell (y + i - 5, x + j - 5), the edge's beyond."""
    (b, c, h, w), device = x.shape, x.device
    wide = x.index_select(3, _neighbours(w, device).clamp(0, w - 1).flatten())
    return wide.index_select(2, _neighbours(h, device).clamp(0, h - 1).flatten()).reshape(b, c, WINDOW, h, WINDOW, w)


def resized(x: Tensor, size: Sequence[int]) -> Tensor:
    """(B, C, ...) at another (height, width); corners stay."""
    if tuple(x.shape[-2:]) == tuple(size):
        return x
    return functional.interpolate(x, size=tuple(size), mode="bilinear", align_corners=True)


class MeanField(nn.Module):
    """Algorithm 1: what each cell believes, revised by what its neighbours believe.

    Attributes:
        weights: (2, C), of the two kernels for each class.
        compatibility: (C, C), the penalty where a cell and its neighbour have these classes; Potts before training.
    """

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.weights = nn.Parameter(torch.tensor(KERNEL_WEIGHTS)[:, None].repeat(1, classes))
        self.compatibility = nn.Parameter(1 - torch.eye(classes))

    def forward(self, logits: Tensor, affinity: Tensor) -> Tensor:
        """Logits (B, C, h', w') and `affinities` -> probabilities (B, C, h, w) float32; 5 iterations in training, else
        10."""
        unary = resized(logits.float(), affinity.shape[3::2])
        believed = softmax(unary)
        for _ in range(TRAINING_ITERATIONS if self.training else TEST_ITERATIONS):
            messages = (self.weights[..., None, None] * heard(believed, affinity)).sum(1)
            penalty = functional.conv2d(messages, self.compatibility[..., None, None])
            believed = softmax(unary - penalty)
        return believed


def heard(believed: Tensor, affinity: Tensor) -> Tensor:
    """Message passing: probabilities (B, C, h, w), summed over the window by either kernel -> (B, 2, C, h, w)."""
    around = windows(believed)
    return torch.stack([(around * kernel[:, None]).sum((2, 4)) for kernel in affinity.unbind(1)], 1)
