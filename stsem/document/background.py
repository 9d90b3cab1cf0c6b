"""Keyframes segmented beside the answers: what became of those chosen, and what the age of a keyframe costs."""

from typing import Self

from pydantic import Field, model_validator

from stsem.document.accuracy import DistanceRow, DistanceSummary
from stsem.document.part import Count, Part
from stsem.document.timing import Distribution


class Background(Part):
    """One mode whose answers do not wait for the network."""

    chosen: Count
    """Frames that the policy chose; each was answered at once, by prediction."""
    finished: Count
    """Those that the network has labelled: the keyframes."""
    replaced: Count
    """Those that waited for the network until a newer choice took their place; they never became keyframes."""
    unfinished: Count
    """Those that the network worked on, or that waited for it, when the run ended."""
    age_ms: Distribution = Field(default_factory=Distribution)
    """Age of the answers: stamp of the frame minus stamp of the keyframe that its labels come from, in capture time."""
    by_age: tuple[DistanceRow, ...] = ()
    """Delivered accuracy by age of the answer, ascending."""
    by_age_summary: DistanceSummary | None = None
    """Mean and minimum over the ages that have enough frames."""

    @model_validator(mode="after")
    def _nothing_is_lost(self) -> Self:
        ended = self.finished + self.replaced + self.unfinished
        if ended != self.chosen:
            raise ValueError(f"{self.chosen} frames were chosen as keyframes, but {ended} ended")
        return self
