"""Raw images: from the bytes of a message to a checked view of its samples."""

from math import ceil

import numpy as np

from stsem.frame import Image
from stsem.log.pixels.encodings import ENCODINGS, Array, Encoding, Packed, Planar, find_encoding
from stsem.log.pixels.sizes import Size, check_size
from stsem.log.schemas.messages import RawImage

ARTICLE = {"metric": "is depth", "labels": "holds ids"}


def encoding_of(message: RawImage) -> Encoding:
    """The row of its encoding.

    Raises:
        ValueError: there is none.
    """
    encoding = find_encoding(message.encoding)
    if encoding is None:
        raise ValueError(f"encoding {message.encoding!r} is not supported, only {', '.join(ENCODINGS)}")
    return encoding


def raw_colour(message: RawImage, size: Size | None) -> Image:
    """(H, W, 3) uint8 RGB of its own memory.

    Raises:
        ValueError: it is no colour, or its bytes do not fit its size.
    """
    encoding = encoding_of(message)
    if encoding.to_rgb is None:
        raise ValueError(f"{message.encoding} {ARTICLE[encoding.order]}, but a colour image was expected")
    if isinstance(encoding, Planar):
        return encoding.to_rgb(_rows(message, encoding, size), message.width, message.height)
    rgb = encoding.to_rgb(native(samples(message, encoding, size)))
    return rgb if rgb.shape[1] == message.width else np.ascontiguousarray(rgb[:, : message.width])


def samples(message: RawImage, encoding: Packed, size: Size | None = None) -> Array:
    """(H, W) or (H, W, samples) view of the data, rows `step` bytes apart; W is filled up to whole groups.

    Raises:
        ValueError: its bytes do not fit its size, or it is not of `size`.
    """
    width, height, item = message.width, message.height, encoding.bits // 8
    check_size(width, height, size)
    if min(width, height) < encoding.least:
        raise ValueError(f"{message.encoding} needs {encoding.least} pixels each way, but {width}x{height} came")
    stored = ceil(width / encoding.group) * encoding.group
    row = stored * encoding.samples * item
    _check_length(message, row, message.step * (height - 1) + row)
    shape = (height, stored) if encoding.samples == 1 else (height, stored, encoding.samples)
    strides = (message.step, encoding.samples * item, item)[: len(shape)]
    dtype = np.dtype(encoding.dtype).newbyteorder(">" if message.big_endian else "<")
    return np.ndarray(shape, dtype, buffer=message.data, strides=strides)


def native(pixels: Array) -> Array:
    """`pixels` in this machine's byte order, at addresses it likes (OpenCV misreads others); a copy only if needed."""
    return np.require(pixels, pixels.dtype.newbyteorder("="), "A")


def _rows(message: RawImage, encoding: Planar, size: Size | None) -> Array:
    """(rows, step) uint8 view of all planes, one after the other."""
    width, height = message.width, message.height
    check_size(width, height, size)
    needed = [side for side, even in (("width", encoding.even_width), ("height", encoding.even_height)) if even]
    if (encoding.even_width and width % 2) or (encoding.even_height and height % 2):
        raise ValueError(f"{message.encoding} needs an even {' and '.join(needed)}, but {width}x{height} came")
    rows = int(height * encoding.rows)
    _check_length(message, width, rows * message.step)
    return np.ndarray((rows, message.step), np.uint8, buffer=message.data)


def _check_length(message: RawImage, row: int, length: int) -> None:
    what = f"{message.width}x{message.height} {message.encoding} in rows of {message.step} bytes"
    if message.step < row:
        raise ValueError(f"{what} came, but a row needs {row} bytes (step)")
    if len(message.data) < length:
        raise ValueError(f"{what} came in {len(message.data)} bytes, but needs {length}")
