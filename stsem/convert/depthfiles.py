"""Depth images of data sets: 16-bit samples at so many units per metre."""

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from stsem.frame import Depth


def metres(units_per_metre: float) -> Callable[[npt.NDArray[Any]], Depth]:
    """From (H, W) uint16 samples, 0 and 65535 unknown as in a log, to (H, W) float32 metres, NaN unknown."""
    with np.errstate(over="ignore"):
        table: Depth = (np.arange(1 << 16) / units_per_metre).astype(np.float32)
    table[[0, 65535]] = np.nan

    def convert(samples: npt.NDArray[Any]) -> Depth:
        if samples.dtype != np.uint16 or samples.ndim != 2:
            shape = "x".join(map(str, samples.shape))
            raise ValueError(f"depth needs one 16-bit channel, but {shape} {samples.dtype} came")
        return table.take(samples, mode="wrap")

    return convert
