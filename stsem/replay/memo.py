"""The last few answers of a segmenter: the modes of one pass over a log ask for the same frames."""

from collections import OrderedDict

from stsem.frame import Frame, Segmentation
from stsem.stages.segment import Segmenter

_KEPT = 8


class Memo:
    """A segmenter that computes a frame once while it is recent.

    Args:
        segmenter: the real one; equal frames give equal answers, so nothing depends on what is remembered.
    """

    def __init__(self, segmenter: Segmenter) -> None:
        self._segmenter = segmenter
        self._recent: OrderedDict[int, Segmentation] = OrderedDict()

    def can_segment(self, index: int) -> bool:
        """See `Segmenter.can_segment`."""
        return self._segmenter.can_segment(index)

    def segment(self, frame: Frame) -> Segmentation:
        """See `Segmenter.segment`."""
        if frame.index not in self._recent:
            self._recent[frame.index] = self._segmenter.segment(frame)
            if len(self._recent) > _KEPT:
                self._recent.popitem(last=False)
        return self._recent[frame.index]
