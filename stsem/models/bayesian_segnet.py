"""Bayesian SegNet: SegNet with dropout in its deepest blocks, kept on at test for Monte Carlo samples.

Kendall et al., Bayesian SegNet: Model Uncertainty in Deep Convolutional Encoder-Decoder Architectures for Scene
Understanding (2015), figure 2 and section 4.1 ("central encoder-decoder"); dropout where the authors' Caffe model has
it: behind the pools of encoders 3 to 5 and behind decoders 5 to 3. Sampling is that of `stsem.models.montecarlo`.
"""

from torch import Tensor, nn

from stsem.models.network import SegmentationNetwork, softmax
from stsem.models.segnet import SegNet, decoded, encoded

DROPOUT = 0.5
BEFORE = 3
"""Encoders before the first dropout; they run once for all samples."""


class BayesianSegNet(SegmentationNetwork):
    """SegNet, its weights in the same number, with six layers of dropout.

    Args:
        classes: number of classes C.
        width: factor on every number of channels.
    """

    def __init__(self, classes: int, width: float = 1.0) -> None:
        super().__init__()
        plain = SegNet(classes, width)
        self.encoders = nn.ModuleList(plain.encoders[:BEFORE])
        self.encoders.extend(nn.Sequential(nn.Dropout(DROPOUT), block) for block in plain.encoders[BEFORE:])
        self.dropout = nn.Dropout(DROPOUT)
        self.decoders = nn.ModuleList(nn.Sequential(block, nn.Dropout(DROPOUT)) for block in plain.decoders[:BEFORE])
        self.decoders.extend(plain.decoders[BEFORE:])
        self.classifier = plain.classifier

    def features(self, *inputs: Tensor) -> tuple[Tensor, ...]:
        """Image (B, 3, H, W) -> features behind the third pool, the places of three pools' maxima, and a map of the
        image's size."""
        (image,) = inputs
        x, places = encoded(self.encoders[:BEFORE], image)
        return (x, *places, image[:, :1])

    def head(self, *features: Tensor) -> Tensor:
        """Probabilities (B, C, H, W)."""
        x, *places, canvas = features
        x, deeper = encoded(self.encoders[BEFORE:], x)
        x = decoded(self.decoders, self.dropout(x), (*places, *deeper), canvas)
        return softmax(self.classifier(x))
