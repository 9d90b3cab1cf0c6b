"""FuseNet: SegNet with a second encoder for depth, whose features are added to the colour's.

Hazirbas et al., FuseNet: Incorporating Depth into Semantic Segmentation via Fusion-based CNN Architecture (2016),
figures 2 and 3; sparse fusion in all five blocks (SF5). Where this file differs:

- Depth comes as metres, where the paper stretches it to 0 ... 255; the first normalisation takes the scale away.
- The paper has dropout in encoder and decoder; here it is where Bayesian SegNet has it, in both encoders.
"""

from collections.abc import Iterable

from torch import Tensor, nn
from torch.nn import functional

from stsem.models import vgg
from stsem.models.network import CHANNELS, SegmentationNetwork, softmax
from stsem.models.segnet import decoded, mirror

DROPOUT = 0.5
BEFORE = 3
"""Blocks before the first dropout; they run once for all samples."""


class FuseNet(SegmentationNetwork):
    """FuseNet-SF5 on two VGG16 with batch normalisation.

    Args:
        classes: number of classes C.
        width: factor on every number of channels.
    """

    inputs = ("image", "depth")

    def __init__(self, classes: int, width: float = 1.0) -> None:
        super().__init__()
        self.colour = _with_dropout(vgg.vgg16(width, batch_norm=True))
        self.depth = _with_dropout(vgg.vgg16(width, batch_norm=True, inputs=CHANNELS["depth"]))
        self.dropout = nn.Dropout(DROPOUT)
        decoders = mirror(width)
        self.decoders = nn.ModuleList(nn.Sequential(block, nn.Dropout(DROPOUT)) for block in decoders[:BEFORE])
        self.decoders.extend(decoders[BEFORE:])
        self.classifier = nn.Conv2d(vgg.channels(width)[0], classes, 3, padding=1)

    def features(self, *inputs: Tensor) -> tuple[Tensor, ...]:
        """Image (B, 3, H, W) and depth (B, 1, H, W) -> features of both behind the third pool, the places of the fused
        maxima in three pools, and a map of the image's size."""
        colour, depth, places = fused(self.colour[:BEFORE], self.depth[:BEFORE], *inputs)
        return (colour, depth, *places, inputs[0][:, :1])

    def head(self, *features: Tensor) -> Tensor:
        """Probabilities (B, C, H, W)."""
        colour, depth, *places, canvas = features
        colour, _, deeper = fused(self.colour[BEFORE:], self.depth[BEFORE:], colour, depth)
        return softmax(self.classifier(decoded(self.decoders, self.dropout(colour), (*places, *deeper), canvas)))


def _with_dropout(blocks: nn.ModuleList) -> nn.ModuleList:
    """Behind the third and the fourth pool; that of the last pool is the decoder's."""
    late = (nn.Sequential(nn.Dropout(DROPOUT), block) for block in blocks[BEFORE:])
    return nn.ModuleList([*blocks[:BEFORE], *late])


def fused(
    colour_blocks: Iterable[nn.Module], depth_blocks: Iterable[nn.Module], colour: Tensor, depth: Tensor
) -> tuple[Tensor, Tensor, list[Tensor]]:
    """Blocks of both encoders: depth is added to colour behind each, and both are pooled.

    Returns:
        The fused features and the depth's, (B, c, h, w) each, and for every pool the places of the fused maxima as in
        `stsem.models.segnet.encoded`.
    """
    places = []
    for block, other in zip(colour_blocks, depth_blocks, strict=True):
        depth = other(depth)
        colour, where = functional.max_pool2d(block(colour) + depth, 2, 2, ceil_mode=True, return_indices=True)
        depth = functional.max_pool2d(depth, 2, 2, ceil_mode=True)
        places.append(where)
    return colour, depth, places
