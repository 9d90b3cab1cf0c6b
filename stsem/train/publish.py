"""A checkpoint -> the two files that a user runs: ONNX and sidecar, checked against torch."""

from pathlib import Path

import numpy as np
import torch

from stsem import chance
from stsem.errors import NetworkError
from stsem.inference.network import CLASS_COUNT, Network, load_network
from stsem.inference.placing import placed
from stsem.inference.preprocess import network_inputs
from stsem.inference.sidecar import Sidecar
from stsem.models.export import Agreement, agreement, exported
from stsem.models.network import SegmentationNetwork
from stsem.models.zoo import build
from stsem.train.checkpoint import averaged_weights, read_checkpoint


def load_checkpoint(path: Path, classes: int) -> SegmentationNetwork:
    """The network of a checkpoint with its averaged weights, in evaluation mode.

    Raises:
        TrainingError: the checkpoint cannot be read.
        NetworkError: it is of another number of classes.
    """
    state = read_checkpoint(path)
    network = build(state["architecture"], classes)
    try:
        network.load_state_dict(averaged_weights(state))
    except RuntimeError as err:
        raise NetworkError(f"The weights in {path} do not fit {state['architecture']} with {classes} classes.") from err
    return network.eval()


def publish(network: SegmentationNetwork, sidecar: Sidecar, path: Path, *, passes: int = 0) -> Network:
    """Write `path` (.onnx) and its sidecar (.toml) for inputs of `sidecar.size`, once they are checked.

    What is there already is replaced by both, or stays where anything fails.

    The sidecar written has the sections that the network has inputs for (`Sidecar.for_inputs`). With `passes` of Monte
    Carlo dropout the graph also gives the maps of uncertainty.

    Returns:
        The network as a user would load it.

    Raises:
        NetworkError: the size does not fit, the sidecar lacks the scale of a difference that the network takes, or the
            exported graph disagrees with torch.
        OutputError: a file cannot be written.
    """
    described = sidecar.for_inputs(network.inputs)
    if "difference" in network.inputs and described.difference is None:
        raise NetworkError(
            "The network takes the image difference, but its sidecar has no section [difference]; add one with a scale."
        )
    with placed(path, described) as unchecked:
        metadata = {CLASS_COUNT: str(len(sidecar.classes))}
        unchecked.write_bytes(exported(network, size=sidecar.size, metadata=metadata, passes=passes))
        found = _agreement_on_noise(network, load_network(unchecked), passes)
        if not found.holds:
            raise NetworkError(
                f"The network as exported does not answer as torch does: equal are {found}; {path} was not written."
            )
    return load_network(path)


def _agreement_on_noise(network: SegmentationNetwork, published: Network, passes: int) -> Agreement:
    """On a smooth random image and a shifted copy, so that classes change across it; depth of a room, with holes."""
    width, height = published.size
    coarse = torch.from_numpy(chance.generator(0, "agreement").random((1, 3, 12, 20)))
    full = torch.nn.functional.interpolate(coarse, size=(height, width + 8), mode="bicubic")[0]
    image = (full.clamp(0, 1) * 255).byte().permute(1, 2, 0).numpy()
    depth = np.where(image[:, 8:, 0] < 32, np.nan, 1 + 4 * full[0, :, 8:].numpy()).astype(np.float32)
    inputs = network_inputs(image[:, 8:].copy(), image[:, :-8].copy(), published.sidecar, depth)
    return agreement(network, published.path, inputs, passes)
