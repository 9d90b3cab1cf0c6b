"""The first pass over one file: its chunks, messages and definitions, and what it says of itself."""

import zlib
from array import array
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from itertools import islice

from mcap.opcode import Opcode

from stsem.log import classtable
from stsem.log.container.ahead import ChunksAhead, Pending
from stsem.log.container.audit import Audit
from stsem.log.container.chunk import BrokenChunkError, Chunk
from stsem.log.container.files import File
from stsem.log.container.layout import FRAME, MESSAGE_HEAD, is_whole, split, string_map
from stsem.log.container.records import GAP, Record
from stsem.log.container.store import Store
from stsem.log.definitions import Definitions
from stsem.log.scanned import Scan
from stsem.log.tracks import MAX_NS
from stsem.plain import plain

MAX_TABLE_BYTES = 1 << 22
MAX_HOMELESS = 1 << 22
MAX_WRONG = 1000
"""Behind so many records that are none the rest of a chunk is not looked at."""
MIN_RECORDS = 1 << 12
"""A chunk may have so many records, and one more for each of its bytes in the file: log times alone pack no tighter."""


class FileScan:
    """The walk over one file; `take` each record in order, then `finish`."""

    def __init__(self, result: Scan, file: File, worker: ThreadPoolExecutor) -> None:
        self._result, self._file, self._damage = result, file, result.damage
        self._definitions = Definitions(result.tracks, result.damage)
        self._channels = self._definitions.channels
        self._audit = Audit(result.damage, self._definitions.name)
        self._ahead = ChunksAhead(worker, self._take_chunk)
        self._homeless: array[int] = array("q")
        self._unprotected_bytes = 0

    def take(self, record: Record) -> None:
        """One record of the top level, or a gap."""
        place = self._file.base + record.place
        if record.opcode == GAP:
            self._ahead.gap(place)
            return
        self._audit.record(record)
        if record.opcode == Opcode.MESSAGE and record.in_summary:
            return  # a wrong bit made it of something else, which is a contradiction
        if record.length != len(record.body):
            self._damage.count("bad_record", n=int(record.opcode != Opcode.ATTACHMENT))
        elif record.opcode == Opcode.CHUNK:
            self._ahead.chunk(place, record.body)
        elif record.opcode == Opcode.MESSAGE_INDEX:
            self._index(record.body, place)
        elif record.opcode == Opcode.MESSAGE and self._ahead.waiting and is_whole(Opcode.MESSAGE_INDEX, record.body):
            self._damage.count("bad_record")  # behind a chunk: an index with a wrong bit in its opcode
            self._index(record.body, place)
        else:
            self._ahead.drain()
            self._outside(record, place)

    def _index(self, body: bytes, place: int) -> None:
        """A message index; one that follows no chunk is that of a lost one."""
        if not self._ahead.waiting:
            self._damage.count("contradiction")
            self._ahead.gap(place)
        self._ahead.index(body)

    def finish(self, *, data_has_crc: bool, summary_is_right: bool) -> None:
        """Behind the last record: messages whose channel came too late, or never; and what the file says of itself."""
        self._ahead.drain()
        if not data_has_crc:
            self._result.unprotected_bytes += self._unprotected_bytes
        rows = zip(*[iter(self._homeless)] * 5, strict=True)
        with Store(self._result.files, self._result.chunks) as store:
            for channel, log_ns, place, offset, length in rows:
                track = self._channels.get(channel)
                if track is None:
                    self._damage.count("unknown_channel", f"channel {channel}")
                else:
                    track.add(store.payload(place, offset, length), log_ns, place, offset)
        self._audit.close(self._definitions.counts, trusted=summary_is_right)

    def _take_chunk(self, pending: Pending) -> None:
        try:
            if pending.error:
                raise pending.error
            if pending.chunk is None or pending.records is None:
                self._audit.lost_chunk(pending.indexes)
                return
            records = pending.records.result()
        except BrokenChunkError as err:
            self._damage.count(err.kind)
            self._audit.lost_chunk(pending.indexes)
            return
        self._inside(pending, pending.chunk, records)

    def _inside(self, pending: Pending, chunk: Chunk, records: bytes) -> None:
        """All records of a chunk."""
        view, found, end, wrong = memoryview(records), _Found(), 0, 0
        before = self._result.message_bytes
        for opcode, start, end in islice(_records(records), MIN_RECORDS + chunk.length):
            body = view[start:end]
            if opcode == Opcode.MESSAGE and len(body) >= MESSAGE_HEAD.size:
                channel, _, log_ns, _ = MESSAGE_HEAD.unpack_from(body)
                found.add(channel, log_ns, start - FRAME.size)
                self._message(channel, log_ns, body[MESSAGE_HEAD.size :], pending.place, start + MESSAGE_HEAD.size)
            elif opcode in _DEFINES:
                self._read(_DEFINES[opcode], body, in_summary=False)
            else:
                wrong += 1
                if wrong >= MAX_WRONG:
                    break
        wrong += end != len(records)
        self._damage.count("bad_record", n=wrong)
        if found:
            self._result.keep_chunk(pending.place, chunk, records)
        if not chunk.crc:
            self._unprotected_bytes += self._result.message_bytes - before
        self._audit.chunk(chunk, found, pending.indexes, whole=not wrong)

    def _outside(self, record: Record, place: int) -> None:
        """A record in no chunk."""
        body = memoryview(record.body)
        if record.opcode == Opcode.MESSAGE:
            channel, _, log_ns, _ = MESSAGE_HEAD.unpack_from(body)
            payload = body[MESSAGE_HEAD.size :]
            self._audit.message(channel, log_ns)
            self._unprotected_bytes += len(payload)
            self._message(channel, log_ns, payload, place, place + FRAME.size + MESSAGE_HEAD.size)
        elif (read := _READERS.get(record.opcode)) is not None:
            self._read(read, body, in_summary=record.in_summary)

    def _read(self, read: "_Reader", body: memoryview, *, in_summary: bool) -> None:
        try:
            read(self, bytes(body), in_summary)
        except ValueError:
            self._damage.count("bad_record")

    def _message(self, channel: int, log_ns: int, payload: memoryview, place: int, offset: int) -> None:
        """One message; `offset` is that of its payload inside its chunk, or inside the log."""
        track = self._channels.get(channel)
        self._result.message_bytes += len(payload)
        if log_ns >= MAX_NS:
            self._damage.count("bad_record", track.topic if track else "")
        elif track is not None:
            track.add(payload, log_ns, place, offset)
        elif len(self._homeless) < 5 * MAX_HOMELESS:
            self._homeless.extend((channel, log_ns, place, offset, len(payload)))
        else:
            self._damage.count("unknown_channel", f"channel {channel}")

    def header(self, body: bytes, in_summary: bool) -> None:
        """Profile and library; those of the first file stay."""
        (profile, library), _ = split(Opcode.HEADER, body)
        if self._file.base == 0 and not in_summary:
            self._result.profile, self._result.library = plain(str(profile, "utf-8")), plain(str(library, "utf-8"))

    def schema(self, body: bytes, in_summary: bool) -> None:
        """A schema."""
        self._definitions.schema(body, in_summary=in_summary)

    def channel(self, body: bytes, in_summary: bool) -> None:
        """A channel."""
        self._definitions.channel(body, in_summary=in_summary)

    def metadata(self, body: bytes, _: bool) -> None:
        """A metadata record; only a class table is kept."""
        (name, entries), _end = split(Opcode.METADATA, body)
        if name == classtable.METADATA.encode():
            if len(entries) > MAX_TABLE_BYTES:
                raise ValueError(f"a class table of {len(entries)} bytes")
            self._result.metadata[classtable.METADATA] = string_map(entries)

    def attachment(self, body: bytes, _: bool) -> None:
        """An attachment, with its checksum over everything before it; only a class table is kept, if it is whole."""
        (_times, name, _type, data, crc), end = split(Opcode.ATTACHMENT, body)
        if int.from_bytes(crc, "little") not in (0, zlib.crc32(body[: end - len(crc)])):
            self._damage.count("attachment_crc")
        elif name == classtable.ATTACHMENT.encode():
            if len(data) > MAX_TABLE_BYTES:
                raise ValueError(f"a class table of {len(data)} bytes")
            self._result.attachments[classtable.ATTACHMENT] = bytes(data)


class _Found(dict[int, "array[int]"]):
    """Channel -> log time and place in the chunk of each message, one after the other."""

    def add(self, channel: int, log_ns: int, place: int) -> None:
        """Take in one message."""
        entries = self.get(channel)
        if entries is None:
            entries = self[channel] = array("Q")
        entries.extend((log_ns, place))


def _records(records: bytes) -> Iterator[tuple[int, int, int]]:
    """(opcode, start, end) of the body of each whole record of a chunk."""
    at, size, unpack = 0, len(records), FRAME.unpack_from
    while at + FRAME.size <= size:
        opcode, length = unpack(records, at)
        at += FRAME.size
        if length > size - at:
            return
        yield opcode, at, at + length
        at += length


_Reader = Callable[[FileScan, bytes, bool], None]
_DEFINES: dict[int, _Reader] = {Opcode.SCHEMA: FileScan.schema, Opcode.CHANNEL: FileScan.channel}
_READERS: dict[int, _Reader] = {
    **_DEFINES,
    Opcode.HEADER: FileScan.header,
    Opcode.METADATA: FileScan.metadata,
    Opcode.ATTACHMENT: FileScan.attachment,
}
