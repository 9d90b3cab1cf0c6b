"""Chunks: heads that are believed no further than they can be checked, and decompression to exactly the stated size."""

import struct
import zlib
from dataclasses import dataclass

import lz4.frame  # type: ignore[import-untyped]
import zstandard

from stsem.log.container.records import FRAME, Record

CHUNK_HEAD = struct.Struct("<QQQII")
MAX_CHUNK_BYTES = 1 << 30


@dataclass(frozen=True)
class Chunk:
    """A chunk as it stands in the file: `length` compressed bytes, `start` bytes behind the opcode of its record."""

    start: int
    length: int
    compression: str
    uncompressed_size: int
    crc: int


class BrokenChunkError(Exception):
    """A chunk cannot be used; `kind` is the kind of damage."""

    def __init__(self, kind: str, reason: str) -> None:
        self.kind = kind
        super().__init__(reason)


def parse_chunk(record: Record) -> tuple[Chunk, memoryview]:
    """Head of a chunk record and its compressed bytes.

    Raises:
        BrokenChunkError: the lengths inside do not fit.
    """
    body = memoryview(record.body)
    try:
        _, _, size, crc, name_length = CHUNK_HEAD.unpack_from(body)
        at = CHUNK_HEAD.size + name_length
        compression = bytes(body[CHUNK_HEAD.size : at]).decode()
        (length,) = struct.unpack_from("<Q", body, at)
    except (struct.error, UnicodeDecodeError) as err:
        raise BrokenChunkError("chunk_unreadable", str(err)) from err
    data = body[at + 8 :]
    if length > len(data):
        raise BrokenChunkError("chunk_unreadable", f"{length} bytes are announced but {len(data)} are there")
    start = FRAME.size + at + 8
    return Chunk(start, length, compression, size, crc), data[:length]


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
    if len(records) != chunk.uncompressed_size:
        raise BrokenChunkError("chunk_unreadable", f"{len(records)} bytes came instead of {chunk.uncompressed_size}")
    if check and chunk.crc and zlib.crc32(records) != chunk.crc:
        raise BrokenChunkError("chunk_crc", "the checksum differs")
    return records


def _inflate(chunk: Chunk, data: memoryview | bytes) -> bytes:
    size = chunk.uncompressed_size
    if chunk.compression == "zstd":
        # The frame's own statement would decide how much is allocated, so it must agree first.
        stated = zstandard.get_frame_parameters(data).content_size
        if stated not in (size, zstandard.CONTENTSIZE_UNKNOWN, 0):
            raise BrokenChunkError("chunk_unreadable", f"zstd states {stated} bytes, the chunk {size}")
        return zstandard.ZstdDecompressor().decompress(data, max_output_size=max(size, 1))
    if chunk.compression == "lz4":
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=size + 1))
    if chunk.compression == "":
        return bytes(data)
    raise BrokenChunkError("chunk_unreadable", f"the compression {chunk.compression!r} is unknown")
