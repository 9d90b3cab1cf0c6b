"""Monte Carlo dropout: how sure a network is, from many passes of its head with dropout left on.

Gal and Ghahramani, Dropout as a Bayesian Approximation (2016); the variance as in Kendall et al., Bayesian SegNet
(2015), section 3. The masks are drawn once and kept, so that the same network always gives the same maps.
"""

import copy
from collections.abc import Mapping

import torch
from torch import Tensor, nn

from stsem import chance
from stsem.errors import NetworkError
from stsem.models.network import SegmentationNetwork, dropouts
from stsem.uncertainty import MEASURES

FEWEST_PASSES = 2
MAPS = MEASURES


class FixedDropout(nn.Module):
    """Dropout whose masks are constants: one for each item of a batch of passes. A single item passes through whole.

    Args:
        kept: (T, ...) bool, broadcast over an input (T, ...).
        scale: of what is kept, 1 / (1 - p).
    """

    def __init__(self, kept: Tensor, scale: float) -> None:
        super().__init__()
        self.register_buffer("kept", kept)
        self._scale = scale

    def forward(self, x: Tensor) -> Tensor:
        """(1, ...) as it is, or (T, ...) with one mask each."""
        return x if len(x) == 1 else x * self.get_buffer("kept").to(x.dtype) * self._scale


def fix_masks(network: SegmentationNetwork, *inputs: Tensor, passes: int, seed: int = 0) -> SegmentationNetwork:
    """A copy of `network` that shares its weights, in evaluation mode, with fixed masks for its dropout.

    Args:
        network: with dropout in its head.
        inputs: zeros will do, each (1, channels, H, W): the masks fit this size.
        passes: T, at least two; its `head` then takes features of batch 1 (dropout off) or T (one mask each).
        seed: of the masks.

    Raises:
        NetworkError: there is no dropout, or fewer than two passes are asked for.
    """
    if not network.stochastic:
        raise NetworkError("This network has no dropout, so its uncertainty cannot be sampled; choose another one.")
    if passes < FEWEST_PASSES:
        raise NetworkError(f"{passes} pass(es) of Monte Carlo dropout say nothing; ask for {FEWEST_PASSES} or more.")
    shared = {id(tensor): tensor for tensor in (*network.parameters(), *network.buffers())}
    fixed = copy.deepcopy(network, shared).eval()
    layers = dropouts(fixed)
    for name, shape in _shapes(fixed, inputs).items():
        layer = layers[name]
        per_channel = isinstance(layer, nn.Dropout2d)
        size = (shape[1], *(1 for _ in shape[2:])) if per_channel else shape[1:]
        drawn = chance.generator(seed, "dropout", name).random((passes, *size))
        fixed.set_submodule(name, FixedDropout(torch.from_numpy(drawn >= layer.p), 1 / (1 - layer.p)))
    return fixed


def _shapes(network: SegmentationNetwork, inputs: tuple[Tensor, ...]) -> Mapping[str, torch.Size]:
    """Of the inputs of every dropout layer that the head comes through."""
    shapes: dict[str, torch.Size] = {}
    with torch.no_grad():
        features = network.features(*inputs)
        hooks = [layer.register_forward_hook(lambda _, args, out, name=name: shapes.update({name: args[0].shape}))
                 for name, layer in dropouts(network).items()]  # fmt: skip
        network.head(*features)
    for hook in hooks:
        hook.remove()
    return shapes


def uncertainty(fixed: SegmentationNetwork, *features: Tensor, passes: int) -> tuple[Tensor, Tensor, Tensor]:
    """The maps of `MAPS` from T passes of the head.

    Args:
        fixed: from `fix_masks`.
        features: from its `features`, batch 1.
        passes: T, as given to `fix_masks`.

    Returns:
        Variance of the probabilities, mean over classes; entropy of their mean, in nats; mutual information of class
        and weights, in nats: that entropy less the mean entropy of the passes. Each (1, 1, h, w) float32, 0 or more.
    """
    samples = fixed.head(*(x.expand(passes, *x.shape[1:]) for x in features))  # (T, C, h, w)
    mean = samples.mean(0, keepdim=True)
    variance = ((samples - mean) ** 2).mean((0, 1), keepdim=True)
    entropy = _entropy(mean)
    information = entropy - _entropy(samples).mean(0, keepdim=True)
    return variance, entropy, information.clamp_min(0)


def _entropy(probabilities: Tensor) -> Tensor:
    """(T, C, h, w) -> (T, 1, h, w), nats."""
    return -(probabilities * probabilities.clamp_min(1e-12).log()).sum(1, keepdim=True)
