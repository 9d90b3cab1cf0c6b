"""Frames that wait for the pipeline: a few with their pixels, the rest by number, so that a backlog costs no memory."""

from collections.abc import Callable

from stsem.log.log import Loaded

_WITH_PIXELS = 8


class WaitingRoom:
    """What `Mailbox` holds by number.

    Args:
        reload: loads the frame with a log index again, equal to what it was; None keeps everybody's pixels.
    """

    def __init__(self, reload: Callable[[int], Loaded] | None) -> None:
        self._reload = reload
        self._kept: dict[int, Loaded | None] = {}

    def put(self, loaded: Loaded) -> None:
        """A frame begins to wait."""
        crowded = self._reload is not None and len(self._kept) >= _WITH_PIXELS
        self._kept[loaded.index] = None if crowded else loaded

    def pop(self, index: int) -> Loaded:
        """The frame stops waiting."""
        loaded = self._kept.pop(index)
        if loaded is not None:
            return loaded
        if self._reload is None:
            raise ValueError(f"frame {index} waits without pixels, and nobody can load it again")
        return self._reload(index)
