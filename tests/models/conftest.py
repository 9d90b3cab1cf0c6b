"""The networks of the zoo, narrow and small, each exported once for all tests that ask for it."""

import functools
import gc
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from stsem.inference.network import Network
    from stsem.models.network import SegmentationNetwork

CLASSES = ("wall", "floor", "door", "lamp", "chair")
ODD = (97, 67)
"""Width and height that divide by nothing."""


@dataclass(frozen=True, eq=False)
class Exported:
    """A network with random weights, in evaluation mode, and its files.

    Args:
        network: in torch.
        published: as a user loads it, at the size nearest to `ODD`.
        passes: of Monte Carlo dropout in the graph; 0 without dropout.
    """

    network: "SegmentationNetwork"
    published: "Network"
    passes: int


@pytest.fixture(scope="session")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Exported]:
    """A row of the zoo at a sixteenth of its channels, by name."""
    folder = tmp_path_factory.mktemp("zoo")

    @functools.cache
    def of(name: str) -> Exported:
        return _exported(name, folder)

    return of


def _exported(name: str, folder: Path) -> Exported:
    import torch

    from stsem.classes import ClassSet
    from stsem.inference.sidecar import Difference, Sidecar
    from stsem.models.zoo import build
    from stsem.train.publish import publish

    torch.manual_seed(1)
    network = build(f"{name}-w1", len(CLASSES)).eval()
    width, height = (network.nearest_side(side) for side in ODD)
    sidecar = Sidecar((width, height), (0.5,) * 3, (0.25,) * 3, ClassSet(CLASSES), Difference(4.0))
    passes = 3 if network.stochastic else 0
    gc.disable()  # the exporter makes millions of small objects, and the collector looks through them again and again
    try:
        published = publish(network, sidecar, folder / f"{name}.onnx", passes=passes)
    finally:
        gc.enable()
    return Exported(network, published, passes)
