"""Of what size the images of a channel are: that of most of them, told without decoding all."""

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from stsem.errors import DecodeError
from stsem.log.pixels.formats import JPEG, PNG, WEBP, file_format
from stsem.log.pixels.headers import Head, jpeg_head, webp_head
from stsem.log.pixels.look import ImageMessage
from stsem.log.pixels.png import PngHead, read_head
from stsem.log.pixels.sizes import Size
from stsem.log.reading import ImageChannel
from stsem.log.schemas.messages import RawImage

LOOKED_AT = 7
"""Each may cost a chunk, and of a remote log a request."""
HEADS: dict[str, Callable[[memoryview], Head | PngHead]] = {PNG: read_head, JPEG: jpeg_head, WEBP: webp_head}
Decode = Callable[[ImageMessage], npt.NDArray[Any]]


def usual_size(channel: ImageChannel, decode: Decode) -> Size | None:
    """(width, height) of most of up to LOOKED_AT spread images, the earlier one of a tie; of the first that `decode`
    decodes when none of those is what its header says; None when none can be decoded."""

    def stated(message: ImageMessage) -> Size:
        if isinstance(message, RawImage):
            return message.width, message.height
        if read := HEADS.get(file_format(message)):
            head = read(message.data)
            return head.width, head.height
        return decoded(message)

    def decoded(message: ImageMessage) -> Size:
        height, width = decode(message).shape[:2]
        return width, height

    seen: Counter[Size] = Counter()
    rows: dict[Size, int] = {}
    for row in np.unique(np.linspace(0, len(channel) - 1, LOOKED_AT).astype(int)).tolist():
        if size := _read(channel, row, stated):
            seen[size] += 1
            rows.setdefault(size, row)
    for size, _ in seen.most_common():
        if _read(channel, rows[size], decoded) == size:
            return size
    found = channel.first(decoded)
    return found[1] if found else None


def _read(channel: ImageChannel, row: int, convert: Callable[[ImageMessage], Size]) -> Size | None:
    try:
        return channel.read(row, convert)
    except DecodeError:
        return None
