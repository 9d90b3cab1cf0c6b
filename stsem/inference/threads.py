"""Thread counts, set explicitly, so that no library picks its own from the machine (DESIGN 3, same bytes)."""

import cv2
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from stsem.errors import UsageError


def set_threads(count: int) -> None:
    """Let OpenCV and the BLAS and OpenMP pools of this process use `count` threads from now on.

    A network session has a count of its own (`Inferencer`), fixed when it is opened.

    Raises:
        UsageError: `count` is below 1.
    """
    if count < 1:
        raise UsageError(f"The number of threads is {count}; it must be at least 1.")
    cv2.setNumThreads(count)
    threadpool_limits(limits=count)
