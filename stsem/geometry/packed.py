"""Some pixels of an image as a small image of their own, which OpenCV works on as fast as on any."""

import numpy as np
import numpy.typing as npt

Rows = npt.NDArray[np.intp]
"""Pixels of an image, counted row by row."""

PACKED_WIDTH = 256


def packed(rows: Rows) -> Rows:
    """(h, w) of `rows` (n,), the last one repeated at the end; there must be one."""
    width = min(PACKED_WIDTH, len(rows))
    found = np.full((-(-len(rows) // width), width), rows[-1])
    found.reshape(-1)[: len(rows)] = rows
    return found
