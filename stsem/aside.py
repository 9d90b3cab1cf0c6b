"""Where results are written before they are complete: a name beside their place, with the process's number in it."""

import os
import re
import shutil
from contextlib import suppress
from pathlib import Path


def aside(target: Path, ending: str = "") -> Path:
    """`.name.PID` beside `target`, for this process alone; what earlier ones left for the same target is removed.

    A process that is killed cannot clean up. What it left is known by the exact form of the name, and by a number that
    no process has now.

    Args:
        target: what is to be written.
        ending: behind the number.
    """
    for left in _left(target):
        if left.is_dir() and not left.is_symlink():
            shutil.rmtree(left, ignore_errors=True)
        else:
            with suppress(OSError):
                left.unlink()
    return target.with_name(f".{target.name}.{os.getpid()}{ending}")


def write_aside(target: Path, data: bytes) -> None:
    """Write a file whole or not at all: where it fails, what was there stays.

    Raises:
        OSError: it cannot be written.
    """
    unfinished = aside(target)
    try:
        unfinished.write_bytes(data)
        unfinished.replace(target)
    except BaseException:
        with suppress(OSError):
            unfinished.unlink(missing_ok=True)
        raise


def _left(target: Path) -> list[Path]:
    form = re.compile(re.escape(f".{target.name}.") + r"(\d{1,10})(\.db3(-wal|-journal|-shm)?)?", re.ASCII)
    try:
        names = os.listdir(target.parent)
    except OSError:
        return []
    return [target.with_name(name) for name in names if (found := form.fullmatch(name)) and _is_over(int(found[1]))]


def _is_over(process: int) -> bool:
    """Whether no process has this number; never where one cannot ask without harm."""
    if os.name != "posix" or process <= 0:
        return False
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return True
    except (OSError, OverflowError):
        return False
    return False
