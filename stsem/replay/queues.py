"""What happens to frames that arrive while the pipeline is busy."""

import math
from collections import deque

from stsem.errors import UsageError


class Mailbox:
    """Frames waiting for the answer path.

    Args:
        capacity: how many may wait; math.inf for no limit.
        newest_wins: a full mailbox drops the waiting frame (True) or the arriving one (False).
    """

    def __init__(self, capacity: float, newest_wins: bool) -> None:
        self._waiting: deque[int] = deque()
        self._capacity, self._newest_wins = capacity, newest_wins

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, index: int) -> int | None:
        """Let frame `index` wait; returns the frame that is dropped for it (maybe itself), or None."""
        if len(self._waiting) < self._capacity:
            self._waiting.append(index)
            return None
        if not self._newest_wins:
            return index
        dropped = self._waiting.popleft()
        self._waiting.append(index)
        return dropped

    def take(self) -> int | None:
        """The frame that has waited longest, removed; None when nobody waits."""
        return self._waiting.popleft() if self._waiting else None


def parse_queue(text: str) -> tuple[float, bool]:
    """(capacity, newest_wins) of a `Mailbox` for `latest`, `fifo:N` or `lossless`.

    Raises:
        UsageError: anything else.
    """
    kind, _, number = text.partition(":")
    if text == "latest":
        return 1, True
    if text == "lossless":
        return math.inf, False
    if kind == "fifo" and number.isascii() and number.isdigit() and int(number) >= 1:
        return int(number), False
    raise UsageError(f"There is no queue rule {text!r}; give latest, fifo:N with N of at least 1, or lossless.")
