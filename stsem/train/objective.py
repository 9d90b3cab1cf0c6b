"""What a training minimises: cross-entropy of the fused answer, of each stream, and of the auxiliary heads."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor
from torch.nn import functional

from stsem.classes import NO_LABEL
from stsem.models.resnet import STRIDE
from stsem.models.two_stream import COLOUR_WEIGHT, DIFFERENCE_WEIGHT, OneStream, TwoStream

AUXILIARY = 0.4
"""Weight of the auxiliary heads (Zhao et al., section 3.3)."""
STREAM = 0.5
"""Weight of each stream's own cross-entropy beside the fused one."""
BALANCE = 0.3
"""Class weights are share ** -BALANCE, scaled so that the mean over pixels is 1: rare classes count somewhat more."""
FINE = 2
"""The loss is taken on every second pixel; with aligned corners these are grid points of the enlargement."""


def class_weights(shares: npt.NDArray[np.float64]) -> Tensor:
    """(C,) float32 weights from the classes' shares of pixels; a class without pixels weighs nothing."""
    weights = np.where(shares > 0, np.maximum(shares, 1e-4) ** -BALANCE, 0.0)
    return torch.from_numpy((weights / (weights * shares).sum()).astype(np.float32))


@dataclass(frozen=True, eq=False)
class Objective:
    """The loss of a batch.

    Args:
        weights: (C,) class weights.
        bf16: run the convolutions in bfloat16; the loss is float32 all the same.
    """

    weights: Tensor
    bf16: bool = False

    def __call__(self, network: TwoStream | OneStream, image: Tensor, difference: Tensor, labels: Tensor) -> Tensor:
        """Scalar loss of inputs (B, 3, H, W) and labels (B, H, W) int64, NO_LABEL ignored."""
        fine, coarse = labels[:, ::FINE, ::FINE], labels[:, ::STRIDE, ::STRIDE]
        with torch.autocast("cpu", torch.bfloat16, enabled=self.bf16):
            colour, colour_aux = network.colour.forward_with_auxiliary(image)
            moving, moving_aux = (network.difference.forward_with_auxiliary(difference)
                                  if isinstance(network, TwoStream) else (None, None))  # fmt: skip
        p = _enlarged(colour, fine)
        loss = AUXILIARY * self._entropy(functional.log_softmax(colour_aux.float(), 1), coarse)
        if moving is None or moving_aux is None:
            return loss + self._nll(p, fine)
        q = _enlarged(moving, fine)
        loss = loss + AUXILIARY * self._entropy(functional.log_softmax(moving_aux.float(), 1), coarse)
        streams = self._nll(p, fine) + self._nll(q, fine)
        return loss + STREAM * streams + self._nll(COLOUR_WEIGHT * p + DIFFERENCE_WEIGHT * q, fine)

    def _nll(self, probabilities: Tensor, labels: Tensor) -> Tensor:
        return self._entropy(probabilities.clamp_min(1e-6).log(), labels)

    def _entropy(self, log_probabilities: Tensor, labels: Tensor) -> Tensor:
        return functional.nll_loss(log_probabilities, labels, self.weights, ignore_index=NO_LABEL)


def _enlarged(logits: Tensor, labels: Tensor) -> Tensor:
    """Probabilities (B, C, h', w') on the labels' grid, enlarged as in the exported graph."""
    probabilities = functional.softmax(logits.float(), 1)
    return functional.interpolate(probabilities, size=labels.shape[-2:], mode="bilinear", align_corners=True)
