"""RVL: run lengths and variable-length differences of 16-bit depth.

Wilson, "Fast lossless depth image compression", ISS 2017. A stream of numbers: zeros, nonzeros, then that many
differences; and so on. A number is written in nibbles, three bits each from the lowest up, the fourth bit set while
more follow; differences are zigzag. Eight nibbles fill a little-endian word from its top.
"""

import numpy as np
import numpy.typing as npt

from stsem.log.pixels.sizes import check_size

MAX_RVL_PIXELS = 1 << 23
MAX_NIBBLES = 9
"""Of one number: 27 bits, more than any run needs."""


def decode_rvl(stream: memoryview, width: int, height: int) -> npt.NDArray[np.uint16]:
    """(H, W) uint16 as they were encoded.

    Memory: up to 50 bytes per byte of the stream, of which 3 a pixel are looked at, and 8 per pixel.

    Raises:
        ValueError: the size cannot be, or the stream ends early or is no RVL.
    """
    check_size(width, height)
    pixels = width * height
    if pixels > MAX_RVL_PIXELS:
        raise ValueError(f"rvl of {width}x{height} came, but {MAX_RVL_PIXELS >> 20} million pixels are the most")
    numbers = _numbers(stream[: 3 * pixels + 64], 2 * pixels + 16)
    starts = _runs(numbers, pixels)
    zeros, nonzeros = numbers[starts], numbers[starts + 1]
    difference = np.ones(int(starts[-1] + 2 + nonzeros[-1]), bool)
    difference[starts] = difference[starts + 1] = False
    zigzag = numbers[: len(difference)][difference]
    depth = np.cumsum((zigzag >> 1) ^ -(zigzag & 1), dtype=np.int32)
    filled = np.zeros(2 * len(starts), bool)
    filled[1::2] = True
    result = np.zeros(pixels, np.uint16)
    result[np.repeat(filled, np.column_stack([zeros, nonzeros]).ravel())] = depth.astype(np.uint16)
    return result.reshape(height, width)


def _numbers(stream: memoryview, most: int) -> npt.NDArray[np.int32]:
    """The first numbers of the stream, at most `most`; an unfinished last one is left out."""
    words = np.frombuffer(bytes(stream) + bytes(-len(stream) % 4), "<u4").byteswap().view(np.uint8)
    nibbles = np.empty(2 * len(words), np.uint8)
    nibbles[0::2], nibbles[1::2] = words >> 4, words & 15
    ends = np.flatnonzero(nibbles < 8)[:most]
    if not len(ends):
        raise ValueError("the rvl stream ends early")
    starts = np.concatenate([[0], ends[:-1] + 1])
    numbers: npt.NDArray[np.int32] = (nibbles[starts] & 7).astype(np.int32)
    at, which, shift = starts, np.flatnonzero(ends > starts), 3
    while len(which):
        if shift >= 3 * MAX_NIBBLES:
            raise ValueError(f"the rvl stream has a number of more than {MAX_NIBBLES} nibbles")
        numbers[which] |= (nibbles[at[which] + shift // 3] & 7).astype(np.int32) << shift
        which = which[ends[which] - at[which] > shift // 3]
        shift += 3
    return numbers


def _runs(numbers: npt.NDArray[np.int32], pixels: int) -> npt.NDArray[np.int64]:
    """Where the pairs of run lengths stand that make up `pixels`."""
    found: list[int] = []
    view, at, end = numbers.data, 0, len(numbers) - 1
    while at < end:  # each pair is known from the one before, so this is a loop, over runs
        found.append(at)
        at += 2 + view[at + 1]
    starts = np.array(found, np.int64)
    filled = np.cumsum(numbers[starts] + numbers[starts + 1], dtype=np.int64)
    last = int(np.searchsorted(filled, pixels))
    if last == len(starts) or starts[last] + 2 + numbers[starts[last] + 1] > len(numbers):
        raise ValueError("the rvl stream ends early")
    if filled[last] != pixels:
        raise ValueError(f"the rvl stream holds more than its {pixels} pixels")
    return starts[: last + 1]
