"""SegNet: a decoder that puts values back where the encoder's pools took them from.

Badrinarayanan et al., SegNet: A Deep Convolutional Encoder-Decoder Architecture for Image Segmentation (2015), figure 2
and section 3; SegNet-Basic is of section 3.1. Layers as in the authors' Caffe models.
"""

from collections.abc import Iterable, Sequence

from torch import Tensor, nn
from torch.nn import functional

from stsem.models import vgg
from stsem.models.network import SegmentationNetwork, scaled, softmax


class SegNet(SegmentationNetwork):
    """VGG16 with batch normalisation and its mirror image.

    29,441,419 weights for 11 classes. The authors' 29.45 M has 7,936 more: biases of convolutions before a batch
    normalisation, which would take them away again.

    Args:
        classes: number of classes C.
        width: factor on every number of channels.
    """

    def __init__(self, classes: int, width: float = 1.0) -> None:
        super().__init__()
        self.encoders = vgg.vgg16(width, batch_norm=True)
        self.decoders = mirror(width)
        self.classifier = nn.Conv2d(vgg.channels(width)[0], classes, 3, padding=1)

    def features(self, *inputs: Tensor) -> tuple[Tensor, ...]:
        """Image (B, 3, H, W) -> the last decoder's features (B, c, H, W)."""
        (image,) = inputs
        x, places = encoded(self.encoders, image)
        return (decoded(self.decoders, x, places, image),)

    def head(self, *features: Tensor) -> Tensor:
        """Probabilities (B, C, H, W)."""
        return softmax(self.classifier(*features))


def mirror(width: float) -> nn.ModuleList:
    """The decoders of VGG16, deepest first: each ends in the channels of the next; the first block's lacks its last
    convolution, which is the classifier."""
    outs = vgg.channels(width)
    decoders = [vgg.convolutions([outs[0], outs[0]], batch_norm=True)]
    for i in range(1, len(outs)):
        chain = [*[outs[i]] * vgg.BLOCKS[i][1], outs[i - 1]]
        decoders.append(vgg.convolutions(chain, batch_norm=True))
    return nn.ModuleList(reversed(decoders))


def encoded(encoders: Iterable[nn.Module], x: Tensor) -> tuple[Tensor, list[Tensor]]:
    """Encoders, a 2x2 pool behind each; what is left over at an odd border is pooled alone.

    Returns:
        Features (B, c, h, w), and for every pool the places (B, c', h', w') int64 of its maxima in the map it had
        before it, the first of equal ones.
    """
    places = []
    for encoder in encoders:
        x, where = functional.max_pool2d(encoder(x), 2, 2, ceil_mode=True, return_indices=True)
        places.append(where)
    return x, places


def decoded(decoders: Iterable[nn.Module], x: Tensor, places: Sequence[Tensor], image: Tensor) -> Tensor:
    """Decoders, an unpooling before each: values go to their places, the rest is zero.

    Args:
        decoders: deepest first.
        x: (B, c, h, w) features behind the last pool.
        places: as from `encoded`.
        image: (B, any, H, W): its size is the answer's.
    """
    finer = (image, *places[:-1])  # a pool's input has the size of the pool's before it
    for decoder, where, like in zip(decoders, reversed(places), reversed(finer), strict=True):
        x = decoder(unpooled(x, where, *like.shape[-2:]))
    return x


def unpooled(x: Tensor, places: Tensor, height: int, width: int) -> Tensor:
    """Values at their places in a map of `height` x `width`, zero elsewhere; torch's `max_unpool2d`.

    Written as a scatter, which is an operator of ONNX; the exporter writes torch's own with an index for every axis.

    Args:
        x: (B, c, h, w).
        places: (B, c, h, w) int64, positions y * width + x, none twice in a channel.
    """
    flat = x.new_zeros(*x.shape[:2], height * width).scatter(2, places.flatten(2), x.flatten(2))
    return flat.reshape(*x.shape[:2], height, width)


class SegNetBasic(SegmentationNetwork):
    """Four encoders and four decoders of one 7x7 convolution each; decoders have no ReLU.

    1,416,075 weights for 11 classes, without biases before batch normalisations (512 of them); the paper's table 1 says
    1.425 M, which its own definition does not add up to.

    Args:
        classes: number of classes C.
        width: factor on every number of channels.
    """

    def __init__(self, classes: int, width: float = 1.0) -> None:
        super().__init__()
        c = scaled(64, width)
        self.normalise = nn.LocalResponseNorm(5)
        self.encoders = nn.ModuleList(nn.Sequential(*_conv_bn(cin, c), nn.ReLU(inplace=True)) for cin in (3, c, c, c))
        self.decoders = nn.ModuleList(nn.Sequential(*_conv_bn(c, c)) for _ in self.encoders)
        self.classifier = nn.Conv2d(c, classes, 1)

    def features(self, *inputs: Tensor) -> tuple[Tensor, ...]:
        """Image (B, 3, H, W) -> the last decoder's features (B, c, H, W)."""
        (image,) = inputs
        x, places = encoded(self.encoders, self.normalise(image))
        return (decoded(self.decoders, x, places, image),)

    def head(self, *features: Tensor) -> Tensor:
        """Probabilities (B, C, H, W)."""
        return softmax(self.classifier(*features))


def _conv_bn(cin: int, cout: int) -> list[nn.Module]:
    return [vgg.convolution(cin, cout, 7, bias=False), nn.BatchNorm2d(cout)]
