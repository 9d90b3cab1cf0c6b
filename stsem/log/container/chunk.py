"""Chunks: heads that are believed no further than they can be checked, and decompression to exactly the stated size."""

import struct
import zlib
from collections.abc import Callable
from dataclasses import dataclass

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.opcode import Opcode

from stsem.log.container.layout import FRAME, split

CHUNK_HEAD = struct.Struct("<QQQI")
MAX_CHUNK_BYTES = 1 << 29
MAX_LZ4_FRAMES = 64


@dataclass(frozen=True)
class Chunk:
    """A chunk as it stands in the file: `length` compressed bytes, `start` bytes behind the opcode of its record.

    Args:
        start_ns, end_ns: smallest and largest log time, as the chunk states them.
        crc: of the decompressed bytes; 0 when the chunk has no checksum.
    """

    start: int
    length: int
    compression: str
    uncompressed_size: int
    crc: int
    start_ns: int
    end_ns: int


class BrokenChunkError(Exception):
    """A chunk cannot be used; `kind` is the kind of damage."""

    def __init__(self, kind: str, reason: str) -> None:
        self.kind = kind
        super().__init__(reason)


def parse_chunk(body: bytes) -> tuple[Chunk, memoryview]:
    """Head of a chunk, from the body of its record, and its compressed bytes.

    Raises:
        BrokenChunkError: the lengths inside do not fit.
    """
    try:
        (head, name, data), end = split(Opcode.CHUNK, body)
        compression = str(name, "utf-8")
    except ValueError as err:
        raise BrokenChunkError("chunk_unreadable", str(err)) from err
    start_ns, end_ns, size, crc = CHUNK_HEAD.unpack(head)
    start = FRAME.size + end - len(data)
    return Chunk(start, len(data), compression, size, crc, start_ns, end_ns), data


def decompress(chunk: Chunk, data: memoryview | bytes, *, check: bool) -> bytes:
    """The records of a chunk, of exactly its stated size and, with `check`, with its checksum.

    Raises:
        BrokenChunkError: they are not.
    """
    if chunk.uncompressed_size > MAX_CHUNK_BYTES:
        raise BrokenChunkError("chunk_unreadable", f"{chunk.uncompressed_size} bytes are more than a chunk may hold")
    try:
        records = _inflate(chunk, data)
    except (zstandard.ZstdError, RuntimeError, MemoryError) as err:
        raise BrokenChunkError("chunk_unreadable", str(err)) from err
    length, crc = len(records), zlib.crc32(records) if check and chunk.crc else chunk.crc
    if length == chunk.uncompressed_size and crc == chunk.crc:
        return records
    del records  # the traceback would keep them
    if length == chunk.uncompressed_size:
        raise BrokenChunkError("chunk_crc", "the checksum differs")
    raise BrokenChunkError("chunk_unreadable", f"{length} bytes came instead of {chunk.uncompressed_size}")


def _inflate(chunk: Chunk, data: memoryview | bytes) -> bytes:
    if chunk.compression not in _INFLATE:
        raise BrokenChunkError("chunk_unreadable", f"the compression {chunk.compression!r} is unknown")
    return _INFLATE[chunk.compression](data, chunk.uncompressed_size)


def _zstd(data: memoryview | bytes, size: int) -> bytes:
    """One frame of the stated size at once; several, or of unknown size, as a stream that stops behind `size` bytes.

    The frame's own statement would decide how much is allocated, so it must agree first. A stream's window is limited
    to 128 MiB by the library.
    """
    stated = zstandard.get_frame_parameters(data).content_size
    if stated == size > 0:
        return zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
    with zstandard.ZstdDecompressor().stream_reader(data, read_across_frames=True) as stream:
        return stream.read(size + 1)


def _lz4(data: memoryview | bytes, size: int) -> bytes:
    """One frame, or a few behind each other; no more than one byte beyond `size`."""
    records, rest = b"", data
    for _ in range(MAX_LZ4_FRAMES):
        frame = lz4.frame.LZ4FrameDecompressor()
        more: bytes = frame.decompress(rest, max_length=size + 1 - len(records))
        records = records + more if records else more
        rest = frame.unused_data
        if not frame.eof or not rest or len(records) > size:
            break
    return records


def _none(data: memoryview | bytes, size: int) -> bytes:
    return bytes(data[: size + 1])


_INFLATE: dict[str, Callable[[memoryview | bytes, int], bytes]] = {"zstd": _zstd, "lz4": _lz4, "": _none}
