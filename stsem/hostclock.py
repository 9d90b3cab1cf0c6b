"""The host's clock and memory: the only module that may ask for them.

Nothing read here may influence a result; it is shown under `host` in the report, or becomes a cost profile.
"""

import os
import platform
import resource
import sys
import time
from datetime import UTC, datetime
from pathlib import Path


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


def machine_busy_ns() -> int | None:
    """CPU time of all processes of this machine together, in nanoseconds (resolution 10 ms); None where unknown."""
    try:
        fields = Path("/proc/stat").read_text(encoding="ascii").split("\n", 1)[0].split()[1:9]
    except OSError:
        return None
    user, nice, system, _idle, _iowait, irq, softirq, steal = map(int, fields)
    return (user + nice + system + irq + softirq + steal) * (10**9 // os.sysconf("SC_CLK_TCK"))


def machine_name() -> str:
    """Processor and number of usable cores, in words."""
    return (
        f"{_processor()}, {len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity') else os.cpu_count()} cores"
    )


def machine_facts() -> dict[str, str]:
    """Processor, system and Python, for the report's `host`."""
    return {
        "processor": machine_name(),
        "system": f"{platform.system()} {platform.release()}",
        "python": platform.python_version(),
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else platform.machine()
