"""The clocks of a log: stamps of the sensors against log times of the recorder."""

from dataclasses import dataclass

import numpy as np

from stsem.log.tracks import Int64

RESET_NS = 1_000_000_000
RESET_MESSAGES = 3
MAX_RESETS = 100
"""So many messages in a row behind the newest stamp: a clock that was set back; fewer are messages that came late."""


@dataclass(frozen=True)
class Reset:
    """A clock that was set back.

    Args:
        log_ns: log time of the first message after it.
        back_ns: from the newest stamp before it to the stamp of that message.
    """

    log_ns: int
    back_ns: int


def find_resets(stamps_ns: Int64, log_ns: Int64) -> tuple[Reset, ...]:
    """Where stamps go back by more than a second while log time goes on: MAX_RESETS at most; (n,), in any order."""
    order = np.argsort(log_ns, kind="stable")
    stamps, logs = stamps_ns[order], log_ns[order]
    found: list[Reset] = []
    start = 0
    while len(found) < MAX_RESETS and (at := _first_reset(stamps[start:])) is not None:
        newest = int(stamps[start : start + at].max())
        found.append(Reset(int(logs[start + at]), newest - int(stamps[start + at])))
        start += at
    return tuple(found)


def _first_reset(stamps: Int64) -> int | None:
    """First row that is, with those after it, far behind the newest stamp before it; None without one."""
    newest = np.maximum.accumulate(stamps)
    behind = newest - stamps > RESET_NS
    if len(stamps) < RESET_MESSAGES + 1 or not behind.any():
        return None
    windows = np.lib.stride_tricks.sliding_window_view(behind, RESET_MESSAGES).all(axis=1)
    rows = np.flatnonzero(windows)
    return int(rows[0]) if len(rows) else None
