"""The chunks of a png: its size before anything is decoded, its checksums, and only what makes its pixels."""

import zlib
from dataclasses import dataclass

from stsem.log.pixels.sizes import Size, check_size

SIGNATURE = b"\x89PNG\r\n\x1a\n"
GREY, RGB, PALETTE, GREY_ALPHA, RGB_ALPHA = 0, 2, 3, 4, 6
CHANNELS = {GREY: 1, RGB: 3, PALETTE: 1, GREY_ALPHA: 2, RGB_ALPHA: 4}
MAX_CHUNKS = 1 << 16
INFLATED_FIRST = 1 << 19
"""Streams up to here are left to the decoder: at deflate's best ratio of 1032 they cost it a second or two."""


@dataclass(frozen=True)
class PngHead:
    """What a png states about itself in its first chunk.

    Args:
        bits: of a sample.
        colour_type: GREY, RGB, PALETTE, GREY_ALPHA or RGB_ALPHA.
    """

    width: int
    height: int
    bits: int
    colour_type: int
    interlaced: bool

    @property
    def grey(self) -> bool:
        """Whether it has one channel and not a palette."""
        return self.colour_type in (GREY, GREY_ALPHA)

    @property
    def inflated(self) -> int:
        """Bytes that its pixels inflate to; of an interlaced one, an upper bound."""
        row = 1 + -(-self.width * CHANNELS[self.colour_type] * self.bits // 8)
        return self.height * row * (2 if self.interlaced else 1)


def read_head(data: memoryview) -> PngHead:
    """The first chunk of a png.

    Raises:
        ValueError: it is none.
    """
    if len(data) < 33:
        raise ValueError("the png ends early")
    bits, colour_type, interlaced = data[24], data[25], data[28]
    if bytes(data[12:16]) != b"IHDR" or colour_type not in CHANNELS or bits not in (1, 2, 4, 8, 16):
        raise ValueError("the png does not say what it holds")
    width, height = (int.from_bytes(data[k : k + 4], "big") for k in (16, 20))
    return PngHead(width, height, bits, colour_type, bool(interlaced))


@dataclass(frozen=True)
class Png:
    """A checked png: its head, and the chunks that make its pixels, each with its length and checksum.

    Text, colour profiles, orientation, animation and transparency are left out: no decoder inflates or obeys them.
    """

    head: PngHead
    palette: bytes
    chunks: tuple[tuple[bytes, memoryview], ...]

    def file(self) -> bytes:
        """The png with these chunks alone."""
        return SIGNATURE + b"".join(chunk for _, chunk in self.chunks)

    def index_file(self) -> bytes:
        """The same image as a grey png whose samples are the indices into the palette.

        Both kinds store their rows alike; only the head and the palette differ.
        """
        head = bytearray(self.chunks[0][1])
        head[17] = GREY
        head[21:25] = zlib.crc32(head[4:21]).to_bytes(4, "big")
        kept = b"".join(chunk for kind, chunk in self.chunks[1:] if kind != b"PLTE")
        return SIGNATURE + bytes(head) + kept


def read_png(data: memoryview, size: Size | None = None) -> Png:
    """The png in `data`, its size checked first, then every checksum; the decoder only mutters about either.

    Args:
        size: (width, height) that it has to have.

    Raises:
        ValueError: it ends early, is spoilt, too large, not of `size`, or inflates to more than its pixels.
    """
    head = read_head(data)
    check_size(head.width, head.height, size)
    chunks = [(kind, chunk) for kind, chunk in _chunks(data) if not kind[0] & 0x20]  # lower case: not needed
    _check_stream(head, [chunk[8:-4] for kind, chunk in chunks if kind == b"IDAT"])
    palette = next((bytes(chunk[8:-4]) for kind, chunk in chunks if kind == b"PLTE"), b"")
    return Png(head, palette, tuple(chunks))


def _chunks(data: memoryview) -> list[tuple[bytes, memoryview]]:
    """(kind, length + kind + body + checksum) of each chunk."""
    found: list[tuple[bytes, memoryview]] = []
    at, kind = len(SIGNATURE), b""
    while kind != b"IEND":
        length, kind = int.from_bytes(data[at : at + 4], "big"), bytes(data[at + 4 : at + 8])
        end = at + 12 + length
        if end > len(data):
            raise ValueError("the png ends early")
        if zlib.crc32(data[at + 4 : end - 4]) != int.from_bytes(data[end - 4 : end], "big"):
            raise ValueError("the png does not have its checksum")
        found.append((kind, data[at:end]))
        if len(found) > MAX_CHUNKS:
            raise ValueError(f"the png has more than {MAX_CHUNKS} chunks")
        at = end
    return found


def _check_stream(head: PngHead, bodies: list[memoryview]) -> None:
    """Refuse pixels that inflate to more than the size tells: decoders go on inflating what they do not need."""
    length = sum(map(len, bodies))
    too_much = f"the png holds more data than {head.width}x{head.height} pixels are"
    if length > 2 * head.inflated + 4096:
        raise ValueError(too_much)
    if length <= INFLATED_FIRST:
        return
    stream, left = zlib.decompressobj(), head.inflated
    try:
        for body in bodies:
            pending: bytes | memoryview = body
            while pending and not stream.eof:
                left -= len(stream.decompress(pending, min(left + 1, 1 << 20)))
                if left < 0:
                    raise ValueError(too_much)
                pending = stream.unconsumed_tail
    except zlib.error as err:
        raise ValueError(f"the png cannot be inflated ({err})") from err
