"""Propagate: labels for a frame from finished keyframes. One more method is one file and one row of the table."""

from collections.abc import Callable
from dataclasses import dataclass

from stsem.classes import ClassSet
from stsem.stages.propagation.depth import DepthWarp
from stsem.stages.propagation.flow import Flow
from stsem.stages.propagation.hold import Hold
from stsem.stages.propagation.homography import ChainedHomography, HomographyWarp
from stsem.stages.propagation.method import Needs, Propagation


@dataclass(frozen=True)
class Method:
    """A row of the table.

    Args:
        needs: what it asks of others.
        make: a method for one run, from the classes of the labels and the run's seed.
        covers: whether it can tell what it covers.
    """

    needs: Needs
    make: Callable[[ClassSet, int], Propagation]
    covers: bool = True


AUTO, IN_SPACE, IN_THE_IMAGE = "auto", "depth", "flow"
"""What takes the best method, and which that is with and without depth, poses and a camera (docs/keyframes.md)."""

PROPAGATIONS: dict[str, Method] = {
    "hold": Method(Hold.needs, lambda classes, seed: Hold(), covers=False),
    "homography": Method(HomographyWarp.needs, lambda classes, seed: HomographyWarp(seed)),
    "homography-chained": Method(ChainedHomography.needs, lambda classes, seed: ChainedHomography(seed)),
    "flow": Method(Flow.needs, lambda classes, seed: Flow()),
    "depth": Method(DepthWarp.needs, lambda classes, seed: DepthWarp(classes)),
}
"""Method on the command line -> its row."""
