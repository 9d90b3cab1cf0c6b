"""What a training minimises: cross-entropy of the answer, and of whatever else the network lets the loss judge."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor
from torch.nn import functional

from stsem.classes import NO_LABEL
from stsem.models.network import SegmentationNetwork, softmax

BALANCE, FINE = 0.3, 2


def class_weights(shares: npt.NDArray[np.float64], balance: float = BALANCE) -> Tensor:
    """(C,) float32 weights share ** -balance, with a mean of 1 over the pixels; with `balance` 0 every pixel weighs 1.

    A share counts as at least 1e-4, also 0: the shares are those of a sample, which may miss a rare class.
    """
    weights = np.maximum(shares, 1e-4) ** -balance
    return torch.from_numpy((weights / (weights * shares).sum()).astype(np.float32))


@dataclass(frozen=True, eq=False)
class Objective:
    """The loss of a batch.

    Args:
        weights: (C,) class weights, on the network's device.
        bf16: run the convolutions in bfloat16; the loss is float32 all the same.
        fine: the loss is taken on every `fine`-th pixel; where that divides both sides less one, these are grid points
            of the enlargement with aligned corners. An answer on a finer grid than that is judged at every pixel: a
            transposed convolution learns each phase of its stride on its own, and those between would learn nothing.
    """

    weights: Tensor
    bf16: bool = False
    fine: int = FINE

    def __call__(self, network: SegmentationNetwork, inputs: Sequence[Tensor], labels: Tensor) -> Tensor:
        """Scalar loss of inputs (B, channels, H, W) as the network orders them, and labels (B, H, W) int64."""
        # The cache of casts is one for all threads: without it a weight used twice gets its gradients in one order.
        with torch.autocast(labels.device.type, torch.bfloat16, enabled=self.bf16, cache_enabled=False):
            answers = network.answers(*inputs)
        loss = self._of_probabilities(answers.probabilities, labels)
        for side in answers.sides:
            if side.enlarged:
                loss = loss + side.weight * self._of_probabilities(softmax(side.logits), labels)
            else:
                logarithms = functional.log_softmax(side.logits.float(), 1)
                loss = loss + side.weight * self._entropy(logarithms, _at_grid(labels, side.logits))
        return loss

    def _of_probabilities(self, probabilities: Tensor, labels: Tensor) -> Tensor:
        fine = labels[:, :: self.fine, :: self.fine]
        judged = labels if probabilities.shape[-1] > fine.shape[-1] else fine
        return self._entropy(_enlarged(probabilities, judged).clamp_min(1e-6).log(), judged)

    def _entropy(self, logarithms: Tensor, labels: Tensor) -> Tensor:
        """Mean over the labelled pixels by their weights; 0 where a view shows none, as beyond the image's border."""
        total = functional.nll_loss(logarithms, labels, self.weights, ignore_index=NO_LABEL, reduction="sum")
        known = labels[labels != NO_LABEL]
        return total / self.weights[known].sum().clamp_min(1e-6)


def _enlarged(probabilities: Tensor, labels: Tensor) -> Tensor:
    """Probabilities (B, C, h', w') on the labels' grid, enlarged as in the exported graph."""
    return functional.interpolate(probabilities, size=labels.shape[-2:], mode="bilinear", align_corners=True)


def _at_grid(labels: Tensor, logits: Tensor) -> Tensor:
    """Labels (B, h, w) nearest to the points of a grid (B, C, h, w) whose corners are those of the image."""
    rows, columns = (torch.linspace(0, side - 1, count).round().long()
                     for side, count in zip(labels.shape[-2:], logits.shape[-2:], strict=True))  # fmt: skip
    return labels[:, rows[:, None], columns]
