"""The transport compressedDepth of ROS: twelve bytes of header, then a png of 16 bits or an RVL stream."""

import struct
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stsem.frame import Depth
from stsem.log.pixels import png
from stsem.log.pixels.metres import from_inverse, in_metres
from stsem.log.pixels.rvl import decode_rvl
from stsem.log.pixels.sizes import Size, check_size
from stsem.log.pixels.still import png_samples
from stsem.log.schemas.messages import CompressedImage

HEADER = struct.Struct("<iff")
"""int32 format, float32 depthParam[2]; written as they lie in memory, on every machine that ROS runs on."""
RVL_SIZE = struct.Struct("<II")
WORD = "compresseddepth"


@dataclass(frozen=True)
class CompressedDepth:
    """A message of compressedDepth, its header read.

    Args:
        inverse: whether the samples are quantised inverse depth (32FC1) and not millimetres (16UC1).
        a, b: of the quantisation: metres = a / (sample - b).
        is_png: or RVL.
        body: what follows the header.
    """

    inverse: bool
    a: float
    b: float
    is_png: bool
    body: memoryview

    @property
    def name(self) -> str:
        """For people."""
        return f"{'32FC1' if self.inverse else '16UC1'}; compressedDepth {'png' if self.is_png else 'rvl'}"

    def samples(self, size: Size | None) -> npt.NDArray[np.uint16]:
        """(H, W) uint16 as stored.

        Raises:
            ValueError: they cannot be decoded, or are not of `size` (width, height).
        """
        if not self.is_png:
            if len(self.body) < RVL_SIZE.size:
                raise ValueError("the rvl stream ends early")
            width, height = RVL_SIZE.unpack_from(self.body)
            check_size(width, height, size)
            return decode_rvl(self.body[RVL_SIZE.size :], width, height)
        file = png.read_png(self.body, size)
        if not file.head.grey or file.head.bits != 16:
            raise ValueError(f"compressedDepth needs a grey png of 16 bits, but one of {file.head.bits} came")
        return np.asarray(png_samples(file), np.uint16)

    def metres(self, size: Size | None) -> Depth:
        """(H, W) float32 metres, NaN unknown.

        Raises:
            ValueError: as `samples`.
        """
        samples = self.samples(size)
        return from_inverse(samples, self.a, self.b) if self.inverse else in_metres(samples)


def compressed_depth(message: CompressedImage) -> CompressedDepth | None:
    """The header of a message of compressedDepth; None when it is another image.

    It is told by its format string, and where that lost the word, by a png that begins after twelve bytes. Where the
    encoding is lost too, quantisation that can be (a > 0 and b < 1) says that depth is inverse.

    Raises:
        ValueError: the message says that it is one, and is too short or lacks its header.
    """
    data, words = message.data, "".join(message.format.lower().split())
    is_png = bytes(data[HEADER.size : HEADER.size + len(png.SIGNATURE)]) == png.SIGNATURE
    if WORD not in words and not is_png:
        return None
    if bytes(data[: len(png.SIGNATURE)]) == png.SIGNATURE:
        if "32fc1" in words:
            raise ValueError(f"{message.format!r} lacks its header, which says how depth was quantised")
        return None
    if len(data) < HEADER.size:
        raise ValueError(f"{message.format!r} ends early")
    if not is_png and "rvl" not in words:
        raise ValueError(f"{message.format!r} has no png after its header")
    _, a, b = HEADER.unpack_from(data)
    inverse = "32fc1" in words or (
        "16uc1" not in words and "mono16" not in words and 0 < a < np.inf and -np.inf < b < 1
    )
    return CompressedDepth(inverse, a, b, is_png, data[HEADER.size :])
