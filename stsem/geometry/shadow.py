"""Depth for the shadows that a depth camera's projector leaves beside what stands in front.

The projector sits beside the camera, so on one side of each near thing there is a strip of what lies behind it that is
seen and not lit: it has no depth, and it belongs to the background. Each such gap of a row takes the farther of the two
depths at its ends. It is a guess: what is told by it is no evidence.
"""

import numpy as np
import numpy.typing as npt

from stsem.frame import Depth

WIDEST = 0.08
"""Widest gap that is taken for a shadow, as a share of the row: a projector 7.5 cm aside throws 7 % at half a metre."""

Counts = npt.NDArray[np.intp]


def filled(depth: Depth) -> Depth:
    """(H, W) `depth` in metres with a guess in every gap of a row that is no wider than `WIDEST` and has two ends.

    Args:
        depth: NaN or 0 where it is unknown.
    """
    width, out = depth.shape[1], depth.copy()
    flat, unknown = out.reshape(-1), np.flatnonzero(~(depth > 0))
    first, last = _gaps(unknown, width)
    starts, ends = unknown[first], unknown[last]
    lengths, inside = last - first + 1, (starts % width > 0) & (ends % width < width - 1)
    inside &= lengths <= WIDEST * width
    lengths, starts, ends = lengths[inside], starts[inside], ends[inside]
    farther = np.maximum(flat[starts - 1], flat[ends + 1])
    flat[unknown[np.repeat(inside, last - first + 1)]] = np.repeat(farther, lengths)
    return out


def _gaps(unknown: Counts, width: int) -> tuple[Counts, Counts]:
    """First and last index into the pixels `unknown` (n,), counted row by row, of each run of them in a row."""
    if not len(unknown):
        return unknown, unknown
    breaks = np.flatnonzero((np.diff(unknown) != 1) | (unknown[1:] % width == 0))
    return np.append(0, breaks + 1), np.append(breaks, len(unknown) - 1)
