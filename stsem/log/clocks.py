"""The clocks of a log: stamps that go back, and how far log times are from stamps."""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from stsem.log.tracks import Int64, References

RESET_NS = 1_000_000_000
RESET_MESSAGES = 3
"""A clock was set back when this many messages before and behind are apart: fewer are garbage, or came late."""
MAX_CLOCK_OFFSET_NS = 1_000_000_000


@dataclass(frozen=True)
class Reset:
    """A clock that was set back.

    Args:
        log_ns: log time of the first message behind it.
        back_ns: from the stamp before it to the stamp behind it.
    """

    log_ns: int
    back_ns: int


def find_resets(stamps_ns: Int64, log_ns: Int64) -> tuple[Reset, ...]:
    """Where stamps go back by more than a second while log time goes on; (n,) each, in any order."""
    if len(stamps_ns) < 2 * RESET_MESSAGES:
        return ()
    order = np.argsort(log_ns, kind="stable")
    stamps, logs = stamps_ns[order], log_ns[order]
    windows = sliding_window_view(stamps, RESET_MESSAGES)
    before, behind = windows[:-RESET_MESSAGES], windows[RESET_MESSAGES:]
    rows = np.flatnonzero(before.min(axis=1) - behind.max(axis=1) > RESET_NS) + RESET_MESSAGES
    return tuple(Reset(int(logs[row]), int(stamps[row - 1] - stamps[row])) for row in rows)


def clock_offset_ns(references: References) -> int:
    """Smallest (log time - stamp) if it is below 0 or above 1 s, else 0: what is taken out of the log times."""
    return out_of_range(int((references.log_ns - references.stamp_ns).min())) if len(references) else 0


def out_of_range(offset_ns: int) -> int:
    """`offset_ns` if it is below 0 or above 1 s, else 0."""
    return 0 if 0 <= offset_ns <= MAX_CLOCK_OFFSET_NS else offset_ns
