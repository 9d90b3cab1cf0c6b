"""The container: records of an MCAP file from front to back, in one pass, believing nothing but what it reads.

Neither the summary nor an index is used to find anything. Every checksum that is there is checked: of chunks, of
attachments, of the data section and of the summary. Specification: https://mcap.dev/spec.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

from mcap.opcode import Opcode

from stsem.errors import LogError
from stsem.log.container.damage import Damage
from stsem.log.container.fingerprint import Fingerprint
from stsem.log.container.source import Source

MAGIC = b"\x89MCAP0\r\n"
FRAME = struct.Struct("<BQ")
MESSAGE_HEAD = struct.Struct("<HIQQ")
MAX_RECORD_BYTES = 1 << 31
MAX_ATTACHMENT_BYTES = 1 << 26
FOOTER_BYTES = 20
BLOCK = 1 << 20

KNOWN_HEADS = {
    b"\x89PNG": "a PNG image", b"\xff\xd8\xff": "a JPEG image", b"#ROSBAG": "a ROS 1 bag",
    b"SQLite f": "a ROS 2 bag in sqlite3 (db3)", b"PK\x03\x04": "a zip archive", b"\x28\xb5\x2f\xfd": "a zstd archive",
}  # fmt: skip


@dataclass(frozen=True)
class Record:
    """One record at the top level of a file.

    Args:
        opcode: as in the specification; unknown ones are passed on.
        body: without opcode and length.
        place: bytes from the front of the file to its opcode.
        in_summary: whether it stands behind the end of the data section.
    """

    opcode: int
    body: bytes
    place: int
    in_summary: bool


def read_records(source: Source, damage: Damage, fingerprint: Fingerprint) -> Iterator[Record]:
    """All whole records of `source`, in file order, up to the end or to the place where it can no longer be followed.

    Every byte of the file goes through `fingerprint`, also behind such a place.

    Raises:
        LogError: the file is missing, empty or not MCAP.
    """
    with source.open() as file:
        size = source.size
        _check_magic(source, file.read(len(MAGIC)), size)
        fingerprint.restart(MAGIC)
        yield from _walk(file, size, damage, fingerprint)
        while block := file.read(BLOCK):
            fingerprint.feed(block)


def _walk(file: BinaryIO, size: int, damage: Damage, fingerprint: Fingerprint) -> Iterator[Record]:
    place, in_summary = len(MAGIC), False
    while True:
        head = file.read(FRAME.size)
        opcode, length = FRAME.unpack(head) if len(head) == FRAME.size else (0, size)
        if length > size - place - FRAME.size:
            fingerprint.feed(head)
            _lost_track(file, size, place, damage)
            return
        if opcode == Opcode.DATA_END:
            body = _data_end(file, head, length, damage, fingerprint)
        elif opcode == Opcode.FOOTER:
            body = _footer(file, head, length, damage, fingerprint)
        else:
            body = _body(file, head, opcode, length, fingerprint)
        yield Record(opcode, body, place, in_summary)
        in_summary = in_summary or opcode == Opcode.DATA_END
        place += FRAME.size + length
        if opcode == Opcode.FOOTER:
            return


def _body(file: BinaryIO, head: bytes, opcode: int, length: int, fingerprint: Fingerprint) -> bytes:
    """The body of a record; of one too large to be of use, only the front."""
    kept = MAX_RECORD_BYTES if opcode in (Opcode.CHUNK, Opcode.MESSAGE) else MAX_ATTACHMENT_BYTES
    body = file.read(min(length, kept))
    fingerprint.feed(head)
    fingerprint.feed(body)
    for done in range(len(body), length, BLOCK):
        fingerprint.feed(file.read(min(BLOCK, length - done)))
    return body


def _data_end(file: BinaryIO, head: bytes, length: int, damage: Damage, fingerprint: Fingerprint) -> bytes:
    """DataEnd: the checksum is over everything before this record, from the magic on."""
    found = fingerprint.crc()
    body = _body(file, head, Opcode.DATA_END, length, fingerprint)
    stated = int.from_bytes(body[:4], "little")
    if stated not in (0, found):
        damage.count("data_crc")
    fingerprint.restart_section()
    return body


def _footer(file: BinaryIO, head: bytes, length: int, damage: Damage, fingerprint: Fingerprint) -> bytes:
    """Footer: the checksum is over the summary and this record up to the checksum itself; the magic closes the file."""
    body, end = file.read(length), file.read(len(MAGIC))
    fingerprint.feed(head + body[:-4])
    stated = int.from_bytes(body[-4:], "little")
    if stated not in (0, fingerprint.crc()):
        damage.count("summary_crc")
    fingerprint.feed(body[-4:] + end)
    if length != FOOTER_BYTES or end != MAGIC:
        damage.count("truncated" if len(end) < len(MAGIC) else "bad_record")
    return body


def _lost_track(file: BinaryIO, size: int, place: int, damage: Damage) -> None:
    """A record would reach behind the end of the file: either the file is cut, or its length is wrong."""
    here = file.tell()
    file.seek(size - len(MAGIC))
    complete = size - len(MAGIC) >= place and file.read(len(MAGIC)) == MAGIC
    file.seek(here)
    damage.count("bad_record" if complete else "truncated")
    if complete:
        damage.count("unread_byte", n=size - place)


def _check_magic(source: Source, head: bytes, size: int) -> None:
    if size == 0:
        raise LogError(f"{source} is empty (0 bytes); give an MCAP recording.")
    if head != MAGIC:
        came = next((what for begin, what in KNOWN_HEADS.items() if head.startswith(begin)), None)
        came = came or f"something that begins with the bytes {head.hex(' ')}"
        raise LogError(f"{source} is not an MCAP file but {came}; give an MCAP recording.")
