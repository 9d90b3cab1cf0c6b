"""The host's clock and memory: the only module that may ask for them.

Nothing read here may influence a result; it is shown under `host` in the report, or becomes a cost profile.
"""

import resource
import sys
import time
from datetime import UTC, datetime


def wall_ns() -> int:
    """Monotonic wall-clock time in nanoseconds, from an arbitrary origin."""
    return time.perf_counter_ns()


def process_cpu_ns() -> int:
    """CPU time of this process, all threads, in nanoseconds."""
    return time.process_time_ns()


def utc_now() -> str:
    """The time of day in UTC, ISO 8601 to the second."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def peak_memory_bytes() -> int:
    """Largest resident set of this process so far, in bytes."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024
