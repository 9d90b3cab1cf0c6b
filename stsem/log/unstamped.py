"""What stands in for capture stamps that are not there."""

import numpy as np
import numpy.typing as npt

from stsem.packed import ABSENT

Int64 = npt.NDArray[np.int64]
MAX_START_NS = 10_000_000_000
MAX_START_PERIODS = 10
"""A clock that counts from 0 has its second stamp after so much at most."""
LOG_TIMES = "their log time is used"
FROM_ZERO = "their stamp is 0, where that clock begins"


def stand_in(stamps_ns: Int64, logs_ns: Int64) -> tuple[Int64, str]:
    """(stamps without ABSENT, how they were made in a few words); (n,) each, in the order of the file.

    Without a stamp the log time counts. Where most of the others have one, a log time would stand on another clock
    than they do: the median of their offsets is taken from it. The first ones of a simulation that starts at 0 have
    stamp 0, which means "none" in ROS: they keep it.
    """
    absent = stamps_ns == ABSENT
    missing = int(absent.sum())
    if not missing:
        return stamps_ns, ""
    if 2 * missing > len(stamps_ns):
        return np.where(absent, logs_ns, stamps_ns), LOG_TIMES
    offsets = np.sort(logs_ns[~absent] - stamps_ns[~absent])
    late = int(offsets[len(offsets) // 2])  # np.median is of floats, which hold no nanoseconds of this century
    filled = np.where(absent, np.maximum(logs_ns - late, 0), stamps_ns)
    first = int(absent.argmin())
    if first and _starts(stamps_ns[~absent]):
        filled[:first] = 0
        if first == missing:
            return filled, FROM_ZERO
    return filled, f"{late / 1e9:.3f} s is taken from their log time, as the others are late by that"


def _starts(stamps_ns: Int64) -> bool:
    """Whether the first of some stamps is the second one of a clock that counts from 0."""
    steps = np.diff(stamps_ns)
    steps = steps[steps > 0]
    most = min(MAX_START_NS, MAX_START_PERIODS * int(np.median(steps))) if len(steps) else 0
    return bool(stamps_ns[0] <= most)
