"""The first pass: one walk over the file or files of a log that leaves a compact index, and checks every checksum."""

import struct
import zlib
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from io import BytesIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Header, MessageIndex, Metadata, Schema

from stsem.log.container.chunk import BrokenChunkError, Chunk, decompress, parse_chunk
from stsem.log.container.damage import Damage
from stsem.log.container.files import File
from stsem.log.container.fingerprint import Fingerprint
from stsem.log.container.records import FRAME, MAX_ATTACHMENT_BYTES, MESSAGE_HEAD, Record, read_records
from stsem.log.container.store import CACHE_BYTES, Store
from stsem.log.tracks import MAX_NS, Track
from stsem.plain import plain

Progress = Callable[[int, int], None]
CHUNKS_AHEAD = 3
PROGRESS_BYTES = 1 << 20
SPOILT = (McapError, struct.error, ValueError, IndexError)
"""What mcap's parsers raise on bytes that are not such a record."""


@dataclass
class Scan:
    """What the first pass leaves.

    Args:
        files: in order.
        damage: what was wrong.
        sha256: of all bytes of all files, in order.
        tracks: by (topic, encoding, schema name), in order of first appearance.
        chunks: place in the log -> chunk, of the chunks whose content can be trusted.
        metadata: name -> the content of its last record.
        opened: place in the log -> content of the first chunks, as much as a Store may hold.
        attachments: name -> bytes, of those that are not huge.
        profile, library: of the first file.
        opened_bytes: of all chunks, kept or not.
    """

    files: Sequence[File]
    damage: Damage
    sha256: str = ""
    tracks: dict[tuple[str, str, str], Track] = field(default_factory=dict)
    chunks: dict[int, Chunk] = field(default_factory=dict)
    opened: dict[int, bytes] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    profile: str = ""
    library: str = ""
    opened_bytes: int = 0


def scan(files: Sequence[File], progress: Progress | None = None) -> Scan:
    """Walk over the files once; `progress` is called with (bytes done, bytes in all).

    Raises:
        LogError: a file is missing, empty, or not MCAP.
    """
    result, total, told = Scan(files, Damage()), sum(file.size for file in files), 0
    with Fingerprint() as fingerprint, ThreadPoolExecutor(1, "stsem-chunk") as worker:
        for file in files:
            if not file.size and total:  # what a recorder that crashed leaves of its last part
                result.damage.count("truncated")
                continue
            one = _FileScan(result, file, worker)
            for record in read_records(file.source, result.damage, fingerprint):
                one.take(record)
                if progress and fingerprint.bytes_fed >= told + PROGRESS_BYTES:
                    told = fingerprint.bytes_fed
                    progress(told, total)
            one.finish()
        if progress:
            progress(total, total)
        result.sha256 = fingerprint.hexdigest()
    return result


def _open(record: Record) -> tuple[Chunk, bytes]:
    chunk, data = parse_chunk(record)
    return chunk, decompress(chunk, data, check=True)


@dataclass
class _Pending:
    """A chunk on its way through the worker, and the message indexes that follow it in the file."""

    place: int
    opened: Future[tuple[Chunk, bytes]]
    indexes: list[bytes] = field(default_factory=list)


class _FileScan:
    """The walk over one file: chunks are opened ahead on a thread, their messages are taken in in order."""

    def __init__(self, result: Scan, file: File, worker: ThreadPoolExecutor) -> None:
        self._result, self._file, self._worker = result, file, worker
        self._damage = result.damage
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Track] = {}
        self._ahead: deque[_Pending] = deque()
        self._homeless: list[tuple[int, int, int, int, int]] = []

    def take(self, record: Record) -> None:
        """One record of the top level."""
        place = self._file.base + record.place
        if record.opcode == Opcode.CHUNK:
            self._ahead.append(_Pending(place, self._worker.submit(_open, record)))
            if len(self._ahead) > CHUNKS_AHEAD:
                self._take_chunk(self._ahead.popleft())
        elif record.opcode == Opcode.MESSAGE_INDEX:
            if self._ahead:
                self._ahead[-1].indexes.append(record.body)
        else:
            self._drain()
            self._record(record.opcode, memoryview(record.body), place, FRAME.size + place)

    def finish(self) -> None:
        """Behind the last record: messages whose channel came too late, or never."""
        self._drain()
        with Store(self._result.files, self._result.chunks) as store:
            for channel_id, log_ns, place, offset, length in self._homeless:
                track = self._channels.get(channel_id)
                if track is None:
                    self._damage.count("unknown_channel", f"channel {channel_id}")
                else:
                    track.add(store.payload(place, offset, length), log_ns, place, offset)

    def _drain(self) -> None:
        while self._ahead:
            self._take_chunk(self._ahead.popleft())

    def _take_chunk(self, pending: _Pending) -> None:
        try:
            chunk, records = pending.opened.result()
        except BrokenChunkError as err:
            self._damage.count(err.kind)
            self._count_lost(pending.indexes)
            return
        self._result.chunks[pending.place] = chunk
        self._keep(pending.place, records)
        view = memoryview(records)
        for opcode, start, end in self._inside(records):
            self._record(opcode, view[start:end], pending.place, start)

    def _keep(self, place: int, records: bytes) -> None:
        """Short logs need no second decompression."""
        self._result.opened_bytes += len(records)
        if self._result.opened_bytes <= CACHE_BYTES:
            self._result.opened[place] = records

    def _count_lost(self, indexes: list[bytes]) -> None:
        """Nothing is ever found by an index; it only tells how many messages a lost chunk had."""
        for body in indexes:
            try:
                index = MessageIndex.read(ReadDataStream(BytesIO(body)))
            except SPOILT:
                self._damage.count("bad_record")
                continue
            track = self._channels.get(index.channel_id)
            self._damage.count(
                "lost_message", track.topic if track else f"channel {index.channel_id}", len(index.records)
            )

    def _inside(self, records: bytes) -> Iterator[tuple[int, int, int]]:
        """(opcode, start, end) of each record of a chunk."""
        at, size, unpack = 0, len(records), FRAME.unpack_from
        while at + FRAME.size <= size:
            opcode, length = unpack(records, at)
            at += FRAME.size
            if length > size - at:
                break
            yield opcode, at, at + length
            at += length
        if at != size:
            self._damage.count("bad_record")

    def _record(self, opcode: int, body: memoryview, place: int, offset: int) -> None:
        """One record; `offset` is that of its body inside its chunk, or inside the log."""
        if opcode == Opcode.MESSAGE:
            self._message(body, place, offset)
        elif (read := _READERS.get(opcode)) is not None:
            try:
                read(self, bytes(body))
            except SPOILT:
                self._damage.count("bad_record")

    def _message(self, body: memoryview, place: int, offset: int) -> None:
        if len(body) < MESSAGE_HEAD.size:
            self._damage.count("bad_record")
            return
        channel_id, _, log_ns, _ = MESSAGE_HEAD.unpack_from(body)
        track, payload = self._channels.get(channel_id), body[MESSAGE_HEAD.size :]
        offset += MESSAGE_HEAD.size
        if log_ns >= MAX_NS:
            self._damage.count("bad_record", track.topic if track else "")
        elif track is None:
            self._homeless.append((channel_id, log_ns, place, offset, len(payload)))
        else:
            track.add(payload, log_ns, place, offset)

    def header(self, body: bytes) -> None:
        """Profile and library; those of the first file stay."""
        record = Header.read(ReadDataStream(BytesIO(body)))
        if self._file.base == 0:
            self._result.profile, self._result.library = plain(record.profile), plain(record.library)

    def schema(self, body: bytes) -> None:
        """A schema; the first of an id stays."""
        record = Schema.read(ReadDataStream(BytesIO(body)))
        self._schemas.setdefault(record.id, record)

    def channel(self, body: bytes) -> None:
        """A channel; the first of an id stays, and a topic of several files is one track."""
        record = Channel.read(ReadDataStream(BytesIO(body)))
        schema = self._schemas.get(record.schema_id)
        if schema is None and record.schema_id == 0:
            schema = Schema(id=0, data=b"", encoding="", name="")
        if schema is None or record.id in self._channels:
            return
        key = (record.topic, record.message_encoding, schema.name)
        if key not in self._result.tracks:
            self._result.tracks[key] = Track(record.topic, schema, record.message_encoding, self._damage)
        self._channels[record.id] = self._result.tracks[key]

    def metadata(self, body: bytes) -> None:
        """A metadata record."""
        record = Metadata.read(ReadDataStream(BytesIO(body)))
        self._result.metadata[record.name] = record.metadata

    def attachment(self, body: bytes) -> None:
        """An attachment, with its checksum over everything before it."""
        if len(body) >= MAX_ATTACHMENT_BYTES:
            return
        if int.from_bytes(body[-4:], "little") not in (0, zlib.crc32(body[:-4])):
            self._damage.count("attachment_crc")
        record = Attachment.read(ReadDataStream(BytesIO(body)))
        self._result.attachments[record.name] = record.data


_READERS: dict[int, Callable[[_FileScan, bytes], None]] = {
    Opcode.HEADER: _FileScan.header,
    Opcode.SCHEMA: _FileScan.schema,
    Opcode.CHANNEL: _FileScan.channel,
    Opcode.METADATA: _FileScan.metadata,
    Opcode.ATTACHMENT: _FileScan.attachment,
}
