"""Two streams, colour and image difference, and the paper's four ways to fuse them.

Figure 3 and section "Proposed Spatio-temporal CNN for Semantic Segmentation": (1) predictions are fused element by
element, by SUM or MAX; (2) the final feature maps from the pyramid pooling module are added, and the network learns
from the fused map; (3) the same feature maps are concatenated. Table 1 compares them (its two headers are swapped).
"""

from collections.abc import Callable
from typing import Literal

import torch
from torch import Tensor, nn

from stsem.errors import NetworkError
from stsem.models.network import Answers, SegmentationNetwork, SideAnswer, softmax
from stsem.models.pspnet import AUXILIARY, SIDE_RULE, PSPNet, before_dropout, final_head, from_dropout, nearest_side
from stsem.models.resnet import ResNetSpec, conv_bn

COLOUR_WEIGHT = 0.7
DIFFERENCE_WEIGHT = 0.3
STREAM = 0.5
"""Weight of each stream's own cross-entropy beside that of the fused prediction."""

Fuse = Callable[[Tensor, Tensor], Tensor]


class _OnPyramids(SegmentationNetwork):
    """Anything on PSPNet's grid."""

    side_rule = SIDE_RULE

    def nearest_side(self, side: int) -> int:
        """48 k - 7, so that every pool is a fixed one."""
        return nearest_side(side)


class OneStream(_OnPyramids):
    """One stream alone, as in the first two rows of Table 1.

    Args:
        spec: backbone.
        classes: number of classes C.
        stream: "colour" for the spatial network, "difference" for the temporal one; also the name of its module, so
            that its weights are named as in the fused network.
    """

    def __init__(self, spec: ResNetSpec, classes: int, *, stream: Literal["colour", "difference"] = "colour") -> None:
        super().__init__()
        self.inputs = ("image",) if stream == "colour" else ("difference",)
        self.stream = stream
        self.add_module(stream, PSPNet(spec, classes))

    @property
    def network(self) -> PSPNet:
        """The stream."""
        network = self.get_submodule(self.stream)
        assert isinstance(network, PSPNet)
        return network

    def features(self, *inputs: Tensor) -> tuple[Tensor, ...]:
        """Image or difference (B, 3, H, W) -> the head's features."""
        pooled, _ = self.network.pooled(*inputs)
        return (before_dropout(self.network.head, pooled),)

    def head(self, *features: Tensor) -> Tensor:
        """Probabilities (B, C, h, w)."""
        return softmax(from_dropout(self.network.head, *features))

    def answers(self, *inputs: Tensor) -> Answers:
        """With the auxiliary head."""
        pooled, auxiliary = self.network.pooled(*inputs)
        return Answers(softmax(self.network.head(pooled)), (SideAnswer(auxiliary, AUXILIARY),))


class PredictionFusion(_OnPyramids):
    """The streams' class probabilities, fused element by element.

    Args:
        colour, difference: the backbones.
        classes: number of classes C.
        fuse: `prediction_sum` or `prediction_max`.
    """

    inputs = ("image", "difference")

    def __init__(self, colour: ResNetSpec, difference: ResNetSpec, classes: int, *, fuse: Fuse) -> None:
        super().__init__()
        self.colour, self.difference = PSPNet(colour, classes), PSPNet(difference, classes)
        self._fuse = fuse

    def features(self, *inputs: Tensor) -> tuple[Tensor, ...]:
        """Image and difference (B, 3, H, W) -> features of either head."""
        streams = self.colour, self.difference
        return tuple(before_dropout(s.head, s.pooled(x)[0]) for s, x in zip(streams, inputs, strict=True))

    def head(self, *features: Tensor) -> Tensor:
        """Fused probabilities (B, C, h, w)."""
        colour, difference = features
        return self._fuse(
            softmax(from_dropout(self.colour.head, colour)), softmax(from_dropout(self.difference.head, difference))
        )

    def answers(self, *inputs: Tensor) -> Answers:
        """With each stream's own prediction and its auxiliary head."""
        logits, sides = [], []
        for stream, x in zip((self.colour, self.difference), inputs, strict=True):
            pooled, auxiliary = stream.pooled(x)
            logits.append(stream.head(pooled))
            sides += [SideAnswer(logits[-1], STREAM, enlarged=True), SideAnswer(auxiliary, AUXILIARY)]
        return Answers(self._fuse(*map(softmax, logits)), tuple(sides))


def prediction_sum(colour: Tensor, difference: Tensor) -> Tensor:
    """0.7 and 0.3 of two probabilities (B, C, h, w) (section "Fusion Method")."""
    return COLOUR_WEIGHT * colour + DIFFERENCE_WEIGHT * difference


def prediction_max(colour: Tensor, difference: Tensor) -> Tensor:
    """The larger of two probabilities (B, C, h, w), divided by their sum over C: the same argmax, sum 1 again."""
    largest = torch.maximum(colour, difference)
    return largest / largest.sum(1, keepdim=True)


class FeatureFusion(_OnPyramids):
    """The streams' final feature maps, joined behind the pyramids; one head learns from the joined map.

    Args:
        colour, difference: the backbones. SUM needs equal channels: where they differ, a 1x1 convolution (ours; the
            paper's streams are equal) brings the difference to the colour's.
        classes: number of classes C.
        join: "sum" or "concat".
    """

    inputs = ("image", "difference")

    def __init__(
        self, colour: ResNetSpec, difference: ResNetSpec, classes: int, *, join: Literal["sum", "concat"]
    ) -> None:
        super().__init__()
        self.colour, self.difference = PSPNet(colour, classes, head=False), PSPNet(difference, classes, head=False)
        mine, other = self.colour.pyramid.channels, self.difference.pyramid.channels
        self._concatenates = join == "concat"
        self.match = nn.Sequential(*(() if self._concatenates or mine == other else conv_bn(other, mine, 1)))
        self.fused = final_head(mine + other if self._concatenates else mine, classes)

    def _joined(self, image: Tensor, difference: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        (mine, auxiliary), (other, moving) = self.colour.pooled(image), self.difference.pooled(difference)
        joined = torch.cat((mine, other), 1) if self._concatenates else mine + self.match(other)
        return before_dropout(self.fused, joined), auxiliary, moving

    def features(self, *inputs: Tensor) -> tuple[Tensor, ...]:
        """Image and difference (B, 3, H, W) -> features of the one head."""
        return (self._joined(*inputs)[0],)

    def head(self, *features: Tensor) -> Tensor:
        """Probabilities (B, C, h, w)."""
        return softmax(from_dropout(self.fused, *features))

    def answers(self, *inputs: Tensor) -> Answers:
        """With both auxiliary heads."""
        features, *auxiliary = self._joined(*inputs)
        return Answers(self.head(features), tuple(SideAnswer(logits, AUXILIARY) for logits in auxiliary))


def copy_colour_to_difference(
    network: PredictionFusion | FeatureFusion, *, std: tuple[float, float, float], scale: float
) -> None:
    """Begin the difference stream with the colour stream's weights, in place.

    A colour input is image / std up to an offset, which cancels in a difference; a difference input is scale times the
    difference of the images. So the first convolution is divided by std x scale per channel. The first batch
    normalisation forgets its statistics, since differences have others: train a little before evaluating.

    Args:
        network: with streams of equal shape.
        std: per RGB channel, and scale: of the difference, both as in the network's sidecar.

    Raises:
        NetworkError: the streams have different widths.
    """
    try:
        network.difference.load_state_dict(network.colour.state_dict())
    except RuntimeError as err:
        raise NetworkError("The difference stream cannot start from the colour stream, whose width is another one; "
                           "build both of one width.") from err  # fmt: skip
    adapt_to_difference(network.difference, std=std, scale=scale)


def adapt_to_difference(stream: PSPNet, *, std: tuple[float, float, float], scale: float) -> None:
    """Make a stream with a colour stream's weights one for differences, in place; see `copy_colour_to_difference`."""
    stem = stream.backbone.stem
    with torch.no_grad():
        stem.get_parameter("0.weight").div_(torch.tensor(std).reshape(1, 3, 1, 1) * scale)
    first = stem[1]
    assert isinstance(first, nn.BatchNorm2d)
    first.reset_running_stats()
