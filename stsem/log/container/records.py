"""The container: records of an MCAP file from front to back, in one pass, believing nothing but what it reads.

Neither the summary nor an index is used to find anything. Every checksum that is there is checked: of chunks, of
attachments, of the data section and of the summary. A record is followed only if another one can stand behind it;
otherwise reading goes on at the next place that is one. What stands behind the closing magic is not read: a second
recording there has to be given as a file of its own. Specification: https://mcap.dev/spec.
"""

from collections.abc import Iterator
from dataclasses import dataclass

from mcap.opcode import Opcode

from stsem.errors import LogError
from stsem.log.container.damage import Damage
from stsem.log.container.fingerprint import Fingerprint
from stsem.log.container.layout import FRAME, LAYOUT, is_head, is_whole
from stsem.log.container.resync import Resync, own_length
from stsem.log.container.source import Source, changed

MAGIC = b"\x89MCAP0\r\n"
GAP = 0
"""Opcode of no record; here it stands for a stretch of bytes that is none."""
MAX_RECORD_BYTES = 1 << 28
MAX_ATTACHMENT_BYTES = 1 << 26
MAX_READ_TWICE = 1 << 26
BLOCK = 1 << 20

KNOWN_HEADS = {
    b"\x89PNG": "a PNG image", b"\xff\xd8\xff": "a JPEG image", b"#ROSBAG": "a ROS 1 bag",
    b"SQLite f": "a ROS 2 bag in sqlite3 (db3)", b"PK\x03\x04": "a zip archive", b"\x28\xb5\x2f\xfd": "a zstd archive",
}  # fmt: skip


@dataclass(frozen=True)
class Record:
    """One record at the top level of a file.

    Args:
        opcode: as in the specification, private ones too, or GAP.
        body: without opcode and length; b"" when it is too large to be of use.
        length: of the body in the file.
        place: bytes from the front of the file to its opcode.
        in_summary: whether it stands behind the end of the data section.
    """

    opcode: int
    body: bytes
    length: int
    place: int
    in_summary: bool


class RecordWalk:
    """All records of one file, in file order; every byte of the file goes through `fingerprint`.

    Attributes:
        data_has_crc: whether the data section had a checksum, right or wrong; known behind it.
        summary_is_right: whether the summary had a checksum and it was right; known at the end.

    Raises:
        LogError: on iterating: the file is missing, empty or not MCAP.
    """

    def __init__(self, source: Source, damage: Damage, fingerprint: Fingerprint) -> None:
        self._source, self._damage, self._fingerprint = source, damage, fingerprint
        self._size = source.size
        self._place = len(MAGIC)
        self._in_summary = self._behind_footer = self._ended = False
        self._in_chunks: bool | None = None
        self._dropped_bytes = 0
        self.data_has_crc = self.summary_is_right = False

    def __iter__(self) -> Iterator[Record]:
        with self._source.open() as file:
            _check_magic(self._source, file.read(len(MAGIC)), self._size)
            self._fingerprint.restart(MAGIC)
            self._file, self._resync = file, Resync(file, self._size)
            self._head = file.read(FRAME.size)
            while len(self._head) == FRAME.size and not self._ended:
                if (record := self._step()) is not None:
                    yield record
            if not self._ended:
                self._close()
            self._feed(self._place, self._size)

    def _step(self) -> Record | None:
        """The record at this place; None when there is none that can be used."""
        place, (opcode, length) = self._place, FRAME.unpack(self._head)
        end = place + FRAME.size + length
        if not is_head(opcode, length, self._size - place - FRAME.size):
            return self._go_on(opcode, self._search(opcode, place + 1))
        if length > (MAX_RECORD_BYTES if opcode in (Opcode.CHUNK, Opcode.MESSAGE) else MAX_ATTACHMENT_BYTES):
            return self._pass_by(opcode, length)
        body, following = self._file.read(length), self._file.read(FRAME.size)
        if len(body) < length:
            raise changed(self._source)
        if opcode == Opcode.FOOTER and following.startswith(MAGIC):
            self._ended = True
            self._damage.count("unread_byte", n=self._size - end - len(MAGIC))
        elif not self._can_follow(end, following):
            found = self._instead(opcode, body)
            if found is not None:
                self._dropped_bytes += length
                return self._go_on(opcode, found)
            self._file.seek(end + len(following))
        head, self._place, self._head = self._head, end, following
        return self._accept(opcode, head, body, place)

    def _instead(self, opcode: int, body: bytes) -> int | None:
        """Nothing can stand behind this record: where the next one is if that is the fault of this record's length."""
        behind = self._place + FRAME.size
        own = own_length(opcode, body)
        found = self._search(opcode, self._place + 1 if own is None else behind + own)
        broken = own is None and opcode in LAYOUT and opcode != Opcode.MESSAGE
        return found if found is not None and (found < behind + len(body) or broken) else None

    def _can_follow(self, end: int, following: bytes) -> bool:
        """Whether a record may stand at `end`, or the file ends there; also when too much was read twice already."""
        if len(following) < FRAME.size or self._dropped_bytes > self._size + MAX_READ_TWICE:
            return True
        opcode, length = FRAME.unpack(following)
        return is_head(opcode, length, self._size - end - FRAME.size)

    def _search(self, opcode: int, start: int) -> int | None:
        in_chunks = opcode == Opcode.CHUNK if self._in_chunks is None else self._in_chunks
        return self._resync.next_record(start, chunked=in_chunks and not self._in_summary)

    def _go_on(self, opcode: int, found: int | None) -> Record | None:
        """The record here has a wrong length, or is none; `found` is where the next one is."""
        place, head, behind = self._place, self._head, self._place + FRAME.size
        if found is None:
            self._lose_rest()
            return None
        self._damage.count("bad_record")
        self._file.seek(behind)
        body = self._file.read(found - behind) if 0 <= found - behind <= MAX_RECORD_BYTES else b""
        self._file.seek(found)
        self._place, self._head = found, self._file.read(FRAME.size)
        if opcode in LAYOUT and found >= behind and is_whole(opcode, body):
            return self._accept(opcode, head, body, place)
        self._damage.count("unread_byte", n=found - place)
        self._feed(place, found)
        return Record(GAP, b"", found - place, place, self._in_summary)

    def _lose_rest(self) -> None:
        """Nothing behind this place can be read: either the file is cut, or it is broken up to its end."""
        self._file.seek(max(0, self._size - len(MAGIC)))
        complete = self._size - len(MAGIC) >= self._place and self._file.read(len(MAGIC)) == MAGIC
        self._damage.count("bad_record" if complete else "truncated")
        if complete:
            self._damage.count("unread_byte", n=self._size - self._place)
        self._ended = True

    def _close(self) -> None:
        """The file ends without a footer and its magic."""
        whole = self._head == MAGIC or (self._behind_footer and len(self._head) == len(MAGIC))
        self._damage.count("bad_record" if whole else "truncated")

    def _pass_by(self, opcode: int, length: int) -> Record | None:
        """A record too large to be read at once."""
        place, end = self._place, self._place + FRAME.size + length
        self._file.seek(end)
        following = self._file.read(FRAME.size)
        if not self._can_follow(end, following):
            return self._go_on(opcode, self._search(opcode, place + 1))
        self._feed(place, end)
        self._file.seek(end + len(following))
        self._place, self._head = end, following
        return Record(opcode, b"", length, place, self._in_summary)

    def _feed(self, start: int, end: int) -> None:
        """The bytes from `start` to `end`, which are no record that was read, to the fingerprint."""
        self._file.seek(start)
        for at in range(start, end, BLOCK):
            self._fingerprint.feed(self._file.read(min(BLOCK, end - at)))
        self._file.seek(self._place + len(self._head))

    def _accept(self, opcode: int, head: bytes, body: bytes, place: int) -> Record:
        """A record, with the checksum of the section that it ends."""
        record, crc = Record(opcode, body, len(body), place, self._in_summary), body[-4:]
        if self._in_chunks is None and opcode in (Opcode.CHUNK, Opcode.MESSAGE):
            self._in_chunks = opcode == Opcode.CHUNK
        self._behind_footer = opcode == Opcode.FOOTER
        if opcode == Opcode.DATA_END:
            self.data_has_crc = self._check("data_crc", crc) is not None
            self._in_summary = True
            self._fingerprint.feed(head + body)
            self._fingerprint.restart_section()
        elif opcode == Opcode.FOOTER:
            self._fingerprint.feed(head + body[:-4])
            self.summary_is_right = bool(self._check("summary_crc", crc))
            self._fingerprint.feed(crc)
            if len(self._head) == FRAME.size and not self._ended:
                self._damage.count("bad_record")
        else:
            self._fingerprint.feed(head)
            self._fingerprint.feed(body)
        return record

    def _check(self, kind: str, crc: bytes) -> bool | None:
        """Whether the section up to here has the checksum; None when none is stated."""
        stated = int.from_bytes(crc, "little")
        if stated == 0:
            return None
        right = stated == self._fingerprint.crc()
        self._damage.count(kind, n=0 if right else 1)
        return right


def _check_magic(source: Source, head: bytes, size: int) -> None:
    if size == 0:
        raise LogError(f"{source} is empty (0 bytes); give an MCAP recording.")
    if head != MAGIC:
        came = next((what for begin, what in KNOWN_HEADS.items() if head.startswith(begin)), None)
        came = came or f"something that begins with the bytes {head.hex(' ')}"
        raise LogError(f"{source} is not an MCAP file but {came}; give an MCAP recording.")
