"""The clocks of a log: stamps that go back, how far log times are from stamps, and clocks that differ by a constant."""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from stsem.log.tracks import Int64, References

RESET_NS = 1_000_000_000
RESET_MESSAGES = 3
"""A clock was set back when this many messages before and behind are apart: fewer are garbage, or came late."""
MIN_BACK_NS, MIN_BACK_PERIODS = 100_000_000, 2
"""Stamps that go back by less are out of order by transport."""
FAR_PERIODS = 10
"""A gap of so many, and of RESET_NS, is none that a few dropped images leave between blocks that changed places."""
TWICE_SHARE = 2 / 3
"""Of the images that a camera takes in a time: so many before and behind a step back show that the time was passed
twice. Messages that only changed places share it, so that one side has no more than half of them."""
MAX_STEPS_BACK = 0.1
"""Of the steps in the file; where more go back its messages are in another order than that of their recording."""
MAX_CLOCK_OFFSET_NS = 1_000_000_000
AHEAD_NS = 100_000_000
"""No transport is faster than time; clocks in step differ by less."""
IN_STEP_NS = 20_000_000
MEETING_NS = 5_000_000
STEADY_NS = 50_000_000


@dataclass(frozen=True)
class Reset:
    """A clock that was set back.

    Args:
        log_ns: log time of the first message behind it.
        back_ns: from the stamp before it to the stamp behind it.
        twice_ns: log times from which and until which there are messages from before it and from behind it; the first
            is the larger one when there are none. None when log times went on.
    """

    log_ns: int
    back_ns: int
    twice_ns: tuple[int, int] | None = None


def find_resets(stamps_ns: Int64, log_ns: Int64) -> tuple[Reset, ...]:
    """Where stamps go back while log time goes on; (n,) each, in any order.

    By more than a second, or by less and over a time that was passed before.
    """
    if len(stamps_ns) < 2 * RESET_MESSAGES:
        return ()
    order = np.argsort(log_ns, kind="stable")
    stamps, logs = stamps_ns[order], log_ns[order]
    windows = sliding_window_view(stamps, RESET_MESSAGES)
    before, behind = windows[:-RESET_MESSAGES], windows[RESET_MESSAGES:]
    far = np.flatnonzero(before.min(axis=1) - behind.max(axis=1) > RESET_NS) + RESET_MESSAGES
    rows = sorted({*map(int, far), *(row for _, row, _ in _second_passes(stamps))})
    return tuple(Reset(int(logs[row]), int(stamps[row - 1] - stamps[row])) for row in rows)


def find_resets_in_file(stamps_ns: Int64, log_ns: Int64) -> tuple[Reset, ...]:
    """Where stamps go back in one file, and log times with them; (n,) each, in the order of the file.

    Files whose messages stand in another order than that of their recording have none: see `_second_passes`.
    """
    return tuple(
        Reset(
            int(log_ns[row]), int(stamps_ns[row - 1] - stamps_ns[row]),
            (
                int(max(log_ns[start:row].min(), log_ns[row:end].min())),
                int(min(log_ns[start:row].max(), log_ns[row:end].max())),
            ),
        )
        for start, row, end in _second_passes(stamps_ns)
        if log_ns[row] < log_ns[row - 1]
    )  # fmt: skip


def _second_passes(stamps: Int64) -> list[tuple[int, int, int]]:
    """(start, row, end) of stretches that are passed in order, and at `row` a time for the second time.

    Or stamps go back there and stay before a gap that nothing fills.
    What is merely in another order (reversed, shuffled, blocks that changed places) holds each time once, side by side.
    """
    steps = np.diff(stamps)
    if len(stamps) < 2 * RESET_MESSAGES or not (steps > 0).any():
        return []
    if int((steps < 0).sum()) > max(1, MAX_STEPS_BACK * len(steps)):
        return []
    period = int(np.median(steps[steps > 0]))
    least = max(MIN_BACK_NS, MIN_BACK_PERIODS * period)
    borders = [0, *(np.flatnonzero(steps < -least) + 1).tolist(), len(stamps)]
    found = []
    for start, row, end in zip(borders, borders[1:], borders[2:], strict=False):
        before, behind = stamps[start:row], stamps[row:end]
        if min(len(before), len(behind)) < RESET_MESSAGES:
            continue
        low, high = max(before.min(), behind.min()), min(before.max(), behind.max())
        if high - low > period:
            again = _passed(before, low, high, period) and _passed(behind, low, high, period)
        else:
            again = low - high > max(RESET_NS, FAR_PERIODS * period) and not ((stamps > high) & (stamps < low)).any()
        if again:
            found.append((start, row, end))
    return found


def _passed(stamps: Int64, low: int, high: int, period: int) -> bool:
    """Whether there are nearly as many of `stamps` in [low, high] as the period says."""
    return int(((stamps >= low) & (stamps <= high)).sum()) >= TWICE_SHARE * ((high - low) / period + 1)


def clock_offset_ns(references: References) -> int:
    """Smallest (log time - stamp) if it is below 0 or above 1 s, else 0: what is taken out of the log times."""
    return out_of_range(smallest_offset_ns(references)) if len(references) else 0


def smallest_offset_ns(references: References) -> int:
    """Smallest (log time - stamp) of a channel with messages."""
    return int((references.log_ns - references.stamp_ns).min())


def out_of_range(offset_ns: int) -> int:
    """`offset_ns` if it is below 0 or above 1 s, else 0."""
    return 0 if 0 <= offset_ns <= MAX_CLOCK_OFFSET_NS else offset_ns


def foreign_clock_ns(color: References, other: References) -> int:
    """What must be added to the stamps of `other` to bring them onto the clock of colour; 0 when the log shows nothing.

    It shows it when both are off log time by a constant, one of them is in step with the recorder, and the other has
    stamps from its future (AHEAD_NS). Or when `other` is late by more than a second: unless its stamps fall on those of
    colour, because then the images came late and their stamps are right.
    """
    if min(len(color), len(other)) < RESET_MESSAGES or not (_is_steady(color) and _is_steady(other)):
        return 0
    own, foreign = smallest_offset_ns(color), smallest_offset_ns(other)
    in_step = range(-IN_STEP_NS, MAX_CLOCK_OFFSET_NS + 1)
    ahead = foreign < -AHEAD_NS and own in in_step
    late = foreign > MAX_CLOCK_OFFSET_NS and own in in_step and not _mostly_meet(color, other, MEETING_NS)
    left_behind = own < -AHEAD_NS and foreign in in_step and not _mostly_meet(color, other, 0)
    return foreign - own if ahead or late or left_behind else 0


def _mostly_meet(color: References, other: References, limit_ns: int) -> bool:
    """Whether most stamps of `other` that lie among those of colour are at most `limit_ns` from one of them."""
    stamps = other.stamp_ns[(other.stamp_ns >= color.stamp_ns[0]) & (other.stamp_ns <= color.stamp_ns[-1])]
    later = np.clip(np.searchsorted(color.stamp_ns, stamps), 1, len(color) - 1)
    before, behind = (np.abs(stamps - color.stamp_ns[row]) for row in (later - 1, later))
    return bool(2 * (np.minimum(before, behind) <= limit_ns).sum() > len(stamps))


def _is_steady(references: References) -> bool:
    """Whether log times are late by the same amount, but for what transport adds."""
    low, high = np.percentile(references.log_ns - references.stamp_ns, (5, 95))
    return bool(high - low <= STEADY_NS)
