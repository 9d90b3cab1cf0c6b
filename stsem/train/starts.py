"""What a stage begins with: random weights, weights from elsewhere, or those of the streams trained before it."""

from collections.abc import Mapping
from dataclasses import dataclass

import torch
from torch import nn

from stsem import chance
from stsem.errors import TrainingError
from stsem.inference.sidecar import Sidecar
from stsem.models.checkpoint import LoadedWeights, begin_with
from stsem.models.network import SegmentationNetwork
from stsem.models.pspnet import PSPNet
from stsem.models.two_stream import OneStream, adapt_to_difference
from stsem.train.augment import Augmentation, view
from stsem.train.checkpoint import averaged_weights, read_checkpoint
from stsem.train.dataset import Pairs
from stsem.train.job import Job
from stsem.train.tensors import tensors

SETTLING = 64
"""Views from which the first batch normalisation of the difference stream learns its statistics."""


@dataclass(frozen=True)
class Begun:
    """How a network began.

    Args:
        given: some of its weights came from elsewhere.
        new: names of the parameters that did not, where some did.
    """

    given: bool
    new: frozenset[str]


def begin(network: SegmentationNetwork, job: Job, sidecar: Sidecar, pairs: Pairs) -> Begun:
    """Give a network the weights that its stage begins with, in place.

    Raises:
        TrainingError, NetworkError: weights that cannot be read or do not fit.
    """
    taken: set[str] = set()
    if "weights" in job.starts:
        taken |= set(given_weights(network, job, sidecar).matched)
    if job.stage == "difference" and "colour" in job.starts:
        taken |= _difference_from_colour(network, job, sidecar)
    for stream in ("colour", "difference"):
        if job.stage == "fused" and stream in job.starts:
            taken |= _stream(network, job, stream)
    stem = _difference_stem(network)
    if taken and stem is not None and stem.get_buffer("1.num_batches_tracked") == 0:
        settle(stem, job, sidecar, pairs)
    names = {name for name, _ in network.named_parameters()}
    return Begun(bool(taken), frozenset(names - taken) if taken else frozenset())


def given_weights(network: SegmentationNetwork, job: Job, sidecar: Sidecar) -> LoadedWeights:
    """Put the weights of a file from elsewhere into a network, in place. Raises NetworkError."""
    scale = sidecar.difference.scale if sidecar.difference else None
    return begin_with(network, job.starts["weights"], std=sidecar.std, scale=scale)


def _difference_stem(network: SegmentationNetwork) -> nn.Sequential | None:
    """Of the stream of that name, if there is one."""
    stream = dict(network.named_children()).get("difference")
    return stream.backbone.stem if isinstance(stream, PSPNet) else None


def _stream(network: SegmentationNetwork, job: Job, stream: str) -> set[str]:
    """A stream of a fused network from a training of that stream alone."""
    weights = averaged_weights(read_checkpoint(job.starts[stream]))
    own = {name: value for name, value in weights.items() if name.startswith(f"{stream}.")}
    return _load(network, own, job, stream)


def _difference_from_colour(network: SegmentationNetwork, job: Job, sidecar: Sidecar) -> set[str]:
    """The temporal stream from a spatial one: its weights, with the first convolution adapted."""
    if not isinstance(network, OneStream) or sidecar.difference is None:
        raise TrainingError(f"The architecture {job.architecture} has no difference stream that could begin with a "
                            "colour stream's weights.")  # fmt: skip
    weights = averaged_weights(read_checkpoint(job.starts["colour"]))
    renamed = {f"difference.{name.removeprefix('colour.')}": value for name, value in weights.items()}
    taken = _load(network, renamed, job, "colour")
    adapt_to_difference(network.network, std=sidecar.std, scale=sidecar.difference.scale)
    return taken


def _load(network: SegmentationNetwork, weights: Mapping[str, torch.Tensor], job: Job, start: str) -> set[str]:
    """Weights by name; those that the network does not have, as a stream's head before a joint one, are left out."""
    own = network.state_dict()
    shared = {name: value for name, value in weights.items() if name in own}
    wrong = next((name for name, value in shared.items() if value.shape != own[name].shape), None)
    if wrong is not None or not shared:
        why = "they have no name in common" if wrong is None else (
            f"{wrong} is {tuple(shared[wrong].shape)}, not {tuple(own[wrong].shape)}"
        )  # fmt: skip
        raise TrainingError(f"The weights {job.starts[start]} do not fit {job.architecture}: {why}; "
                            "give those of the same architecture, width and classes.")  # fmt: skip
    network.load_state_dict(shared, strict=False)
    return set(shared)


def settle(stem: nn.Sequential, job: Job, sidecar: Sidecar, pairs: Pairs) -> None:
    """Let the first batch normalisation of a difference stream learn its statistics from data, in place."""
    convolution, first = stem[0], stem[1]
    assert isinstance(first, nn.BatchNorm2d)
    how, momentum = Augmentation.of(job.recipe, sidecar.mean), first.momentum
    first.train().momentum = None  # a plain mean over the views
    with torch.no_grad():
        for place in range(SETTLING):
            rng = chance.generator(job.seed, "settle", place)
            seen = view(pairs.pair(int(rng.integers(len(pairs)))), how, rng)
            (difference,), _ = tensors([seen], sidecar, ["difference"])
            first(convolution(difference))
    first.momentum = momentum
