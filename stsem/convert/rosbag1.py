"""ROS 1 bags (version 2.0), read from front to back: an unindexed or damaged bag gives what it still holds.

The format is that of http://wiki.ros.org/Bags/Format/2.0: records of a header (fields name=value) and data, with
messages and connections in chunks.
"""

import bz2
import struct
from bisect import bisect_right
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import lz4.frame  # type: ignore[import-untyped]

from stsem.convert.recording import Loss
from stsem.errors import ConversionError

MAGIC = b"#ROSBAG V2.0\n"
MAX_HEADER_BYTES = 16 << 20
MAX_DATA_BYTES = 1 << 28
DAMAGED = "places in the bag that are damaged or cut off"
UNINDEXED = "indexes that are missing or damaged, so that nobody knows whether the end of the bag is there"
MISSING = "messages that the bag's index names and that cannot be read"

_MESSAGE, _BAG, _INDEX, _CHUNK, _CHUNK_INFO, _CONNECTION = (bytes([op]) for op in range(2, 8))
_KNOWN = (_MESSAGE, _BAG, _INDEX, _CHUNK, _CHUNK_INFO, _CONNECTION)
_PIECE = 1 << 16
_U32, _TIME = struct.Struct("<I"), struct.Struct("<II")
_DECOMPRESSORS: dict[bytes, Callable[[], Any]] = {
    b"bz2": bz2.BZ2Decompressor,
    b"lz4": lz4.frame.LZ4FrameDecompressor,
}


@dataclass(frozen=True)
class Connection:
    """One publisher of one topic: type as ROS names it (`sensor_msgs/Image`), its definition with all dependencies."""

    topic: str
    type_name: str
    definition: str
    md5sum: str


@dataclass(frozen=True, eq=False)
class Message:
    """One message as it was recorded."""

    connection: Connection
    log_ns: int
    data: bytes


@dataclass(frozen=True, slots=True)
class _Record:
    """Its header, the position of its data, and how many bytes that should have."""

    header: dict[bytes, bytes]
    data_at: int
    length: int

    @property
    def op(self) -> bytes:
        return self.header.get(b"op", b"")


@dataclass
class _Index:
    """What the end of a bag says about it; empty of a bag without."""

    connections: dict[int, Connection] = field(default_factory=dict)
    chunks: list[int] = field(default_factory=list)
    messages: int = 0
    whole: bool = False

    def next_chunk(self, at: int, size: int) -> int:
        """Position of the first chunk behind `at`; `size` when there is none."""
        k = bisect_right(self.chunks, at)
        return self.chunks[k] if k < len(self.chunks) else size


def messages(path: Path) -> Iterator[tuple[int, Message | Loss]]:
    """(bytes of the file done, a message or a loss), in the order in which they were recorded.

    Raises:
        ConversionError: it is no bag of version 2.0, it is encrypted, or it cannot be read.
    """
    try:
        with path.open("rb") as stream:
            yield from _messages(path, stream, path.stat().st_size)
    except OSError as err:
        raise ConversionError(f"The bag {path} cannot be read ({err.strerror or err}).") from err


def _messages(path: Path, stream: BinaryIO, size: int) -> Iterator[tuple[int, Message | Loss]]:
    _check(path, stream, size)
    index = _index(stream, size)
    at, read = len(MAGIC), 0
    while at < size:
        try:
            record = _record(stream, at, size)
        except ValueError:
            yield at, Loss(DAMAGED)
            at = index.next_chunk(at, size)
            continue
        end = record.data_at + record.length
        if record.op == _CHUNK:
            for found in _in_chunk(record, _data(stream, record), index.connections):
                read += isinstance(found, Message)
                yield min(end, size), found
        at = end
    if at > size:
        yield size, Loss(DAMAGED)
    if not index.whole:
        yield size, Loss(UNINDEXED)
    if read < index.messages:
        yield size, Loss(MISSING, count=index.messages - read)


def _check(path: Path, stream: BinaryIO, size: int) -> None:
    head = stream.read(len(MAGIC))
    if head != MAGIC:
        text = head.split(b"\n")[0].decode("ascii", "replace")
        raise ConversionError(
            f"{path} is not a ROS bag of version 2.0, it begins with {text!r}; `rosbag fix` renews old bags."
        )
    try:
        encryptor = _record(stream, len(MAGIC), size).header.get(b"encryptor", b"")
    except ValueError:
        return
    if encryptor:
        raise ConversionError(f"The bag {path} is encrypted ({encryptor.decode(errors='replace')}); decrypt it first.")


def _index(stream: BinaryIO, size: int) -> _Index:
    """Connections, chunks and counts at the end of the file; as far as they can be read."""
    index = _Index()
    try:
        header = _record(stream, len(MAGIC), size).header
        at = int.from_bytes(header[b"index_pos"], "little")
        indexed = at > len(MAGIC)
        while len(MAGIC) < at < size:
            record = _record(stream, at, size)
            at = record.data_at + record.length
            if record.op == _CONNECTION:
                _learn(record.header, _data(stream, record), index.connections)
            elif record.op == _CHUNK_INFO:
                data = _data(stream, record)
                index.chunks.append(int.from_bytes(record.header[b"chunk_pos"], "little"))
                index.messages += sum(_u32(data, i + 4) for i in range(0, len(data) - 7, 8))
        index.whole = indexed and at == size and len(index.chunks) == _u32(header[b"chunk_count"], 0)
    except (ValueError, KeyError):
        pass
    index.chunks.sort()
    return index


def _record(stream: BinaryIO, at: int, size: int) -> _Record:
    """The record at `at`, its data not read.

    Raises:
        ValueError: there is none, or it says sizes that cannot be.
    """
    stream.seek(at)
    length = _u32(stream.read(4), 0)
    if length > min(MAX_HEADER_BYTES, size - at):
        raise ValueError(f"a header of {length} bytes")
    header = _fields(stream.read(length))
    record = _Record(header, at + length + 8, _u32(stream.read(4), 0))
    if record.op not in _KNOWN or record.length > MAX_DATA_BYTES:
        raise ValueError("not a record of a bag")
    return record


def _data(stream: BinaryIO, record: _Record) -> bytes:
    """Data of a record; less than announced when the file ends early."""
    stream.seek(record.data_at)
    return stream.read(record.length)


def _in_chunk(chunk: _Record, data: bytes, connections: dict[int, Connection]) -> Iterator[Message | Loss]:
    content, whole = _decompressed(chunk, data)
    at = 0
    while at < len(content):
        try:
            body = at + 4 + _u32(content, at)
            end = body + 4 + _u32(content, body)
            if end > len(content):
                raise ValueError("a record that ends behind its chunk")
        except ValueError:
            whole = False
            break
        try:
            header, payload = _fields(content[at + 4 : body]), content[body + 4 : end]
            if header[b"op"] == _CONNECTION:
                _learn(header, payload, connections)
            elif header[b"op"] == _MESSAGE:
                yield _message(header, payload, connections)
        except (ValueError, KeyError):
            whole = False
        at = end
    if not whole:
        yield Loss(DAMAGED)


def _decompressed(chunk: _Record, data: bytes) -> tuple[bytes, bool]:
    """(content as far as it can be had, never more than the chunk announces; whether that is all of it)."""
    compression = chunk.header.get(b"compression", b"none")
    size = min(int.from_bytes(chunk.header.get(b"size", b""), "little"), MAX_DATA_BYTES)
    if compression == b"none":
        return data[:size], len(data) >= size
    if compression not in _DECOMPRESSORS:
        return b"", False
    decompressor, content = _DECOMPRESSORS[compression](), bytearray()
    try:
        for start in range(0, len(data), _PIECE):
            if decompressor.eof or len(content) >= size:
                break
            content += decompressor.decompress(data[start : start + _PIECE], size - len(content))
    except (OSError, RuntimeError, EOFError):
        return bytes(content), False
    return bytes(content), len(content) == size


def _learn(header: dict[bytes, bytes], data: bytes, connections: dict[int, Connection]) -> None:
    told = _fields(data)
    connections.setdefault(
        _u32(header[b"conn"], 0),
        Connection(
            topic=(header.get(b"topic") or told[b"topic"]).decode(errors="replace"),
            type_name=told[b"type"].decode(errors="replace"),
            definition=told[b"message_definition"].decode(errors="replace"),
            md5sum=told.get(b"md5sum", b"").decode(errors="replace"),
        ),
    )


def _message(header: dict[bytes, bytes], data: bytes, connections: dict[int, Connection]) -> Message:
    if len(header[b"time"]) != _TIME.size:
        raise ValueError("a time is not 8 bytes long")
    seconds, nanoseconds = _TIME.unpack(header[b"time"])
    return Message(connections[_u32(header[b"conn"], 0)], seconds * 10**9 + nanoseconds, data)


def _fields(data: bytes) -> dict[bytes, bytes]:
    """Fields `name=value`, each behind its length."""
    found: dict[bytes, bytes] = {}
    at = 0
    while at < len(data):
        end = at + 4 + _u32(data, at)
        name, equals, value = data[at + 4 : end].partition(b"=")
        if end > len(data) or not equals:
            raise ValueError("a field that is none")
        found[name] = value
        at = end
    return found


def _u32(data: bytes, at: int) -> int:
    if at + 4 > len(data):
        raise ValueError("4 bytes were expected")
    return int(_U32.unpack_from(data, at)[0])
