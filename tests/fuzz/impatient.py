"""Work for workers that hangs, dies, or wants too much memory; imports little, as processes are made for it."""

import os
import time
from collections.abc import Callable
from pathlib import Path

from tests.fuzz.workers import MAX_DATA_BYTES, Task, Verdict


def work(_: Path) -> Callable[[Task], Verdict]:
    """What the name of the log says."""
    return judge


def judge(task: Task) -> Verdict:
    name, seed = task
    if name == "hang":
        time.sleep(600)
    if name == "die":
        os._exit(7)
    try:
        bytearray(MAX_DATA_BYTES)
    except MemoryError:
        return Verdict(name, seed, "refused", "no memory")
    return Verdict(name, seed, "valid", "")
