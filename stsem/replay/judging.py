"""Who watches a run on the simulated clock, and what a robot would act on at an instant."""

from dataclasses import dataclass
from typing import Protocol

from stsem.classes import Labels
from stsem.log.log import Loaded
from stsem.replay.schedule import Slot
from stsem.result import FrameResult


@dataclass(frozen=True, eq=False)
class NewestAnswer:
    """The finished answer with the newest stamp.

    Args:
        stamp_ns: simulated capture stamp of its frame.
        labels: (H, W) uint8.
    """

    stamp_ns: int
    labels: Labels


class Judge(Protocol):
    """Who watches a run: told every arrival and every end, in simulated order."""

    def arrived(self, slot: Slot, loaded: Loaded, newest: NewestAnswer | None) -> None:
        """A frame arrives, or would have; `newest` is what a robot would act on at this instant."""

    def ended(self, result: FrameResult, loaded: Loaded) -> None:
        """A frame has got its outcome; `loaded` still holds its image and truth."""
