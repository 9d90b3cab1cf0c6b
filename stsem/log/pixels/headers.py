"""What jpeg and webp files state about themselves, read before they are decoded, and whether they are whole."""

import re
from dataclasses import dataclass
from itertools import islice

MAX_SCANS = 100
"""A progressive jpeg has about ten; each one more makes the decoder pass the whole image again."""

MAX_SEGMENTS = 1 << 12
"""Before the frame header: profiles and previews in pieces of 64 KiB are some dozens."""

_MARKER = re.compile(rb"\xff[\x02-\xcf\xd8-\xfe]")  # but those without a length: TEM and RST0..RST7
_FRAMES = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # SOF0..SOF15; DHT, JPG and DAC lie between them
_PICTURE = frozenset({0xD8, 0xD9, 0xDA})  # SOI, EOI, SOS
_SCAN = re.compile(rb"\xff\xda")


@dataclass(frozen=True)
class Head:
    """Size and channels of a jpeg or webp; 8 bits each."""

    width: int
    height: int
    channels: int = 3


def jpeg_head(data: memoryview) -> Head:
    """The first frame header of a jpeg.

    Raises:
        ValueError: there is none.
    """
    at = 2
    for _ in range(MAX_SEGMENTS):
        found = _MARKER.search(data, at)  # between segments decoders skip what is no marker
        if found is None or found.end() + 8 > len(data):
            break
        at, marker = found.end(), data[found.end() - 1]
        if marker in _FRAMES:
            height, width = (int.from_bytes(data[k : k + 2], "big") for k in (at + 3, at + 5))
            return Head(width, height, data[at + 7])
        if marker in _PICTURE:
            break
        at += max(2, int.from_bytes(data[at : at + 2], "big"))
    raise ValueError("the jpeg does not say its size")


def check_jpeg(data: memoryview) -> None:
    """Refuse a jpeg without its end and one with more scans than any encoder makes.

    A jpeg has no checksum: bytes changed within its picture decode to other colours or to grey, and cannot be noticed.

    Raises:
        ValueError: it ends early, or has too many scans.
    """
    if b"\xff\xd9" not in bytes(data[-4096:]):
        raise ValueError("the jpeg ends early")
    if next(islice(_SCAN.finditer(data), MAX_SCANS, None), None):
        raise ValueError(f"the jpeg has more than {MAX_SCANS} scans, which no encoder makes")


def webp_head(data: memoryview) -> Head:
    """Size of a webp: of its canvas, its lossy or its lossless picture.

    A webp has no checksum either (see `check_jpeg`), but it states its length.

    Raises:
        ValueError: it ends early, is animated, or has no picture.
    """
    if len(data) < 30 or int.from_bytes(data[4:8], "little") + 8 > len(data):
        raise ValueError("the webp ends early")
    kind = bytes(data[12:16])
    if kind == b"VP8X":
        if data[20] & 0x02:
            raise ValueError("the webp is animated, but still images are needed")
        return Head(*(1 + int.from_bytes(data[k : k + 3], "little") for k in (24, 27)))
    if kind == b"VP8 " and bytes(data[23:26]) == b"\x9d\x01\x2a":
        return Head(*(int.from_bytes(data[k : k + 2], "little") & 0x3FFF for k in (26, 28)))
    if kind == b"VP8L" and data[20] == 0x2F:
        packed = int.from_bytes(data[21:25], "little")
        return Head(1 + (packed & 0x3FFF), 1 + (packed >> 14 & 0x3FFF))
    raise ValueError("the webp does not say its size")
