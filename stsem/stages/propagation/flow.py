"""Flow: dense inverse search from frame to frame, chained back to the keyframe."""

import numpy as np

from stsem.frame import Frame, Segmentation
from stsem.geometry.flow import SEARCH, WORKING_SIDE, Chain, Grey, Search, backward_flow, working_grey
from stsem.stages.keyframe import Keyframe
from stsem.stages.propagation.hold import uncovered
from stsem.stages.propagation.method import Needs, Predicted
from stsem.stages.register import Registration

LOST = "no flow"


class Flow:
    """Follows every keyframe that frames may yet be predicted from; what came into the image gets the border's label.

    Args:
        search: how flow is sought.
        side: longer side, in pixels, of the images between which it is sought.
    """

    needs = Needs(follows=True)

    def __init__(self, search: Search = SEARCH, side: int = WORKING_SIDE) -> None:
        self._search, self._side = search, side
        self._last: Grey | None = None
        self._chains: dict[int, Chain] = {}
        self._newest: int | None = None

    def see(self, frame: Frame, registration: Registration) -> None:
        """One link more in every chain; an image of another size breaks them."""
        grey = working_grey(frame.image, side=self._side)
        if self._last is None or self._last.shape != grey.shape:
            self._chains = {}
        if self._last is not None and self._chains:
            flow = backward_flow(grey, self._last, search=self._search)
            self._chains = {index: chain.extended(flow) for index, chain in self._chains.items()}
        self._last = grey

    def selected(self, frame: Frame, registration: Registration | None) -> None:
        """A chain begins."""
        if self._last is not None:
            self._chains[frame.index] = Chain.start(self._last)
        self._newest = frame.index

    def finished(self, keyframe: Keyframe) -> None:
        """See `Propagation.finished`."""

    def forgotten(self, index: int) -> None:
        """Its chain is let go."""
        self._chains.pop(index, None)

    def predict(self, source: Keyframe, frame: Frame, registration: Registration | None) -> Predicted:
        """The labels that the chain leads to."""
        chain = self._chains.get(source.index)
        if chain is None:
            return Predicted(uncovered(source.segmentation, frame.size), source.index, LOST)
        carried = chain.carry(source.segmentation.labels, source.segmentation.confidence, frame.size)
        return Predicted(Segmentation(carried.labels, carried.confidence, covered=carried.covered), source.index)

    def chain(self, index: int) -> Chain | None:
        """From the frame seen last back to the keyframe `index`; None if it broke."""
        return self._chains.get(index)

    def expected_coverage(self, frame: Frame, registration: Registration) -> float | None:
        """The share of the chain from the newest keyframe that never left the image."""
        chain = None if self._newest is None else self._chains.get(self._newest)
        return 0.0 if chain is None else float(np.count_nonzero(chain.inside)) / max(1, chain.inside.size)
