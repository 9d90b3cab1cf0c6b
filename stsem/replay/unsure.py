"""The frame of which the network was least sure, kept to be looked at."""

from dataclasses import dataclass

from stsem.classes import Labels
from stsem.frame import Image
from stsem.log.log import Loaded
from stsem.result import FrameResult
from stsem.uncertainty import Confidence, Uncertainty

PREFERRED = "mutual_information"
"""The measure that frames are ordered by: what the weights do not know. A network without it gives its first one."""


@dataclass(frozen=True, eq=False)
class UnsureFrame:
    """A frame with everything that the network said of it.

    Args:
        index: log index.
        image: (H, W, 3) uint8 RGB.
        truth: (h, w) uint8 in the log's classes; None without truth.
        labels: (H, W) uint8.
        confidence: (H, W) float32; None where the network states none.
        uncertainty: maps (H, W).
        mean: of the measure that frames are ordered by.
    """

    index: int
    image: Image
    truth: Labels | None
    labels: Labels
    confidence: Confidence | None
    uncertainty: Uncertainty
    mean: float


class Unsurest:
    """Keeps one frame: with truth before without, then the largest mean uncertainty, then the first."""

    def __init__(self) -> None:
        self.frame: UnsureFrame | None = None

    def update(self, result: FrameResult, loaded: Loaded) -> None:
        """Look at a frame that was answered; nothing happens unless the network gave maps for it."""
        said = result.uncertainty
        if said is None or result.labels is None or loaded.frame is None:
            return
        mean = said.mean(PREFERRED if PREFERRED in said.measures else said.measures[0])
        kept = self.frame
        if kept is None or (kept.truth is not None, kept.mean) < (loaded.truth is not None, mean):
            self.frame = UnsureFrame(
                result.index, loaded.frame.image, loaded.truth, result.labels, result.confidence, said, mean
            )
