"""Stored depth to metres: NaN wherever a sensor says that it saw nothing."""

from typing import Any

import numpy as np
import numpy.typing as npt

from stsem.frame import Depth

_METRES = np.arange(1 << 16, dtype=np.float64) / 1000
_METRES[[0, 65535]] = np.nan
MILLIMETRES_TO_METRES: Depth = _METRES.astype(np.float32)
"""(65536,) float32: 16-bit depth to metres, each correctly rounded; 0 and 65535 are unknown."""
FARTHEST_M = 1e5
"""Nothing is seen from farther away: the largest float, and what comes near it, stands for "nothing there"."""


def in_metres(pixels: npt.NDArray[Any]) -> Depth:
    """(H, W) float32 metres: 16-bit samples are millimetres, floats metres.

    NaN, Inf, 0 and below, and what is farther than FARTHEST_M are unknown.
    """
    if pixels.dtype.kind == "u":
        # Every 16-bit number is in the table; "wrap" is the mode that checks least.
        return MILLIMETRES_TO_METRES.take(pixels, mode="wrap")
    with np.errstate(over="ignore"):
        metres = pixels.astype(np.float32)
    return _known(metres)


def from_inverse(pixels: npt.NDArray[np.uint16], a: float, b: float) -> Depth:
    """(H, W) float32 metres from quantised inverse depth: a / (v - b), and 0 is unknown, as in `in_metres` the rest.

    The formula of ROS compressed_depth_image_transport, codec.cpp, in its float32.
    """
    steps = np.arange(1 << 16, dtype=np.float32)
    with np.errstate(all="ignore"):
        table: Depth = np.float32(a) / (steps - np.float32(b))
    table[0] = np.nan
    return _known(table).take(pixels, mode="wrap")


def _known(metres: Depth) -> Depth:
    """The same array with NaN where no sensor can have seen anything."""
    metres[~((metres > 0) & (metres <= FARTHEST_M))] = np.nan
    return metres
