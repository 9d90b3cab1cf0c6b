"""Where reading can go on behind a place that is no record: the next place that can hardly be anything else.

A place counts when the lengths inside its record agree with the record's own, or, for messages, when two more heads
follow it. Inside a chunked file only what stands between chunks counts: what looks like a message there is the inside
of a chunk whose checksum can no longer be checked.
"""

import re
from collections.abc import Iterator
from typing import BinaryIO

from mcap.opcode import Opcode

from stsem.log.container.layout import FRAME, LAYOUT, SHORTEST, is_head, is_whole, split

HEAD = re.compile(rb"[\x01-\x0f](?=.{5}\x00\x00\x00)", re.DOTALL)
"""An opcode and a length below 2^40."""
FIRST_WINDOW, LAST_WINDOW = 1 << 12, 1 << 20
MAX_READ = 1 << 20
MAX_SEARCHES = 10_000
MAX_CANDIDATES = 200_000
IN_CHUNKS = frozenset((Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE))
FRONT = 128


class Resync:
    """Searches one file, in time that is linear in its size; after very many searches nothing is found any more."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file, self._size = file, size
        self._searches = self._candidates = 0
        self._last = (size, False, size)

    def next_record(self, start: int, *, chunked: bool) -> int | None:
        """The first place from `start` on that is a record; None when there is none. Moves the file's position."""
        searched, mode, found = self._last
        if mode != chunked or not searched <= start <= found:
            self._searches += 1
            found = self._search(start, chunked) if self._searches <= MAX_SEARCHES else self._size
            self._last = (start, chunked, found)
        return found if found < self._size else None

    def _search(self, start: int, chunked: bool) -> int:
        """The place of the next record; the end of the file when there is none."""
        for place, opcode, length in self._heads(start):
            if chunked and opcode in IN_CHUNKS:
                continue
            self._candidates += 1
            if self._candidates > MAX_CANDIDATES:
                break
            if self._is_record(place, opcode, length):
                return place
        return self._size

    def _heads(self, start: int) -> Iterator[tuple[int, int, int]]:
        """(place, opcode, length) of everything that has the look of a head."""
        window = FIRST_WINDOW
        while start + FRAME.size <= self._size:
            self._file.seek(start)
            data = self._file.read(window + FRAME.size - 1)
            for match in HEAD.finditer(data):
                at = match.start()
                opcode, length = FRAME.unpack_from(data, at)
                if is_head(opcode, length, self._size - start - at - FRAME.size):
                    yield start + at, opcode, length
            start, window = start + window, min(2 * window, LAST_WINDOW)

    def _is_record(self, place: int, opcode: int, length: int) -> bool:
        behind = place + FRAME.size + length
        if opcode == Opcode.MESSAGE:
            following = self._head(behind)
            return following is not None and self._head(behind + FRAME.size + following[1]) is not None
        if opcode == Opcode.CHUNK:
            return _is_chunk(self._read(place, min(length, FRONT)), length)
        whole = length <= MAX_READ and is_whole(opcode, self._read(place, length))
        return whole and (opcode == Opcode.FOOTER or self._head(behind) is not None)

    def _read(self, place: int, length: int) -> bytes:
        self._file.seek(place + FRAME.size)
        return self._file.read(length)

    def _head(self, place: int) -> tuple[int, int] | None:
        """(opcode, length) of the known record at `place`; None when there can be none."""
        self._file.seek(place)
        head = self._file.read(FRAME.size)
        if len(head) < FRAME.size:
            return None
        opcode, length = FRAME.unpack(head)
        fits = opcode in LAYOUT and is_head(opcode, length, self._size - place - FRAME.size)
        return (opcode, length) if fits else None


def _is_chunk(front: bytes, length: int) -> bool:
    """Whether the lengths at the front of a chunk agree with the `length` of its record."""
    name_length = int.from_bytes(front[28:32], "little")
    behind = SHORTEST[Opcode.CHUNK] + name_length
    return behind <= len(front) and behind + int.from_bytes(front[behind - 8 : behind], "little") == length


def own_length(opcode: int, body: bytes) -> int | None:
    """Bytes that the parts of a record take; None for a message, and when they do not fit into `body`."""
    if opcode == Opcode.MESSAGE or opcode not in LAYOUT:
        return None
    try:
        return split(opcode, body)[1]
    except ValueError:
        return None
