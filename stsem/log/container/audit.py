"""What a file says of itself against what was found in it: nothing is found by an index, but a loss is noticed by it.

Statements that agree are forgotten. One that does not is damage: `lost_message` with a number where the statement can
be trusted (an index behind a lost chunk, statistics under a right checksum), else `contradiction`.
"""

import struct
from array import array
from collections import Counter
from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt
from mcap.opcode import Opcode

from stsem.log.container.chunk import Chunk
from stsem.log.container.damage import Damage
from stsem.log.container.layout import FIRST_PRIVATE, FRAME, is_whole, split
from stsem.log.container.records import Record

Found = Mapping[int, "array[int]"]
"""Channel -> log time and place in the chunk of each of its messages, one after the other."""

STATISTICS = struct.Struct("<QHIIIIQQ")
PLACE_AND_LENGTH = struct.Struct("<QQ")
COUNT = np.dtype([("channel", "<u2"), ("messages", "<u8")])
POINTERS = {Opcode.CHUNK_INDEX: 16, Opcode.ATTACHMENT_INDEX: 0, Opcode.METADATA_INDEX: 0}
"""Records of the summary that name the place and the length of another, and where in their body."""
POINTED_AT = (Opcode.CHUNK, Opcode.ATTACHMENT, Opcode.METADATA)
IN_DATA = (*POINTED_AT, Opcode.MESSAGE, Opcode.MESSAGE_INDEX)
IN_SUMMARY = (*POINTERS, Opcode.STATISTICS, Opcode.SUMMARY_OFFSET)
HOLDS_DATA = (*POINTED_AT, Opcode.SCHEMA, Opcode.CHANNEL)
MAX_PLACES = 1 << 20


class Audit:
    """Of one file.

    Args:
        damage: to be counted in.
        name: what a channel is called.
    """

    def __init__(self, damage: Damage, name: Callable[[int], str]) -> None:
        self._damage, self._name = damage, name
        self._opcodes: Counter[int] = Counter()
        self._messages: Counter[int] = Counter()
        self._lost: Counter[int] = Counter()
        self._lengths: dict[int, int] = {}
        self._pointers: list[tuple[int, int]] = []
        self._with_crc = self._without_crc = 0
        self._statistics: bytes | None = None
        self._summary_start = self._stated_start = 0
        self._start_ns, self._end_ns = 1 << 64, 0

    def record(self, record: Record) -> None:
        """One record of the top level."""
        opcode = record.opcode
        misplaced = opcode in (IN_DATA if record.in_summary else IN_SUMMARY)
        if misplaced or (opcode == Opcode.HEADER) != (not self._opcodes):
            self._damage.count("contradiction")
        self._opcodes[opcode] += 1
        if opcode in POINTED_AT and len(self._lengths) < MAX_PLACES:
            self._lengths[record.place] = FRAME.size + record.length
        hidden = opcode - FIRST_PRIVATE
        if hidden in HOLDS_DATA and is_whole(hidden, record.body):  # a bit of its opcode was flipped
            self._damage.count("bad_record")
        self._take_statement(record)

    def _take_statement(self, record: Record) -> None:
        if record.opcode in POINTERS and len(self._pointers) < MAX_PLACES:
            at = POINTERS[Opcode(record.opcode)]
            if len(record.body) >= at + PLACE_AND_LENGTH.size:
                self._pointers.append(PLACE_AND_LENGTH.unpack_from(record.body, at))
        elif record.opcode == Opcode.STATISTICS:
            self._statistics = record.body
        elif record.opcode == Opcode.DATA_END:
            self._summary_start = record.place + FRAME.size + record.length
        elif record.opcode == Opcode.FOOTER:
            self._stated_start = int.from_bytes(record.body[:8], "little")

    def message(self, channel: int, log_ns: int) -> None:
        """A message outside of chunks."""
        self._messages[channel] += 1
        self._start_ns, self._end_ns = min(self._start_ns, log_ns), max(self._end_ns, log_ns)

    def chunk(self, chunk: Chunk, found: Found, indexes: list[bytes], *, whole: bool) -> None:
        """A chunk that was read, its messages and the indexes behind it; `whole` unless its content broke off."""
        for channel, entries in found.items():
            self._messages[channel] += len(entries) // 2
        if found:
            self._with_crc += chunk.crc != 0
            self._without_crc += chunk.crc == 0
            start_ns = min(min(entries[::2]) for entries in found.values())
            end_ns = max(max(entries[::2]) for entries in found.values())
            self._start_ns, self._end_ns = min(self._start_ns, start_ns), max(self._end_ns, end_ns)
            if whole and (start_ns, end_ns) != (chunk.start_ns, chunk.end_ns):
                self._damage.count("contradiction")
        stated = self._read(indexes)
        for channel in sorted(stated.keys() | found.keys()) if stated else ():
            self._compare(channel, stated.get(channel, b""), found.get(channel, array("Q")), whole)

    def lost_chunk(self, indexes: list[bytes]) -> None:
        """A chunk that was not read."""
        for channel, entries in self._read(indexes).items():
            self._lose(channel, len(entries) // 16)

    def _read(self, indexes: list[bytes]) -> dict[int, bytes]:
        """Channel -> entries of its index."""
        stated: dict[int, list[memoryview]] = {}
        for body in indexes:
            try:
                (channel, entries), _ = split(Opcode.MESSAGE_INDEX, body)
            except ValueError:
                self._damage.count("bad_record")
                continue
            stated.setdefault(int.from_bytes(channel, "little"), []).append(entries)
        return {channel: b"".join(entries) for channel, entries in stated.items()}

    def _compare(self, channel: int, stated: bytes, found: "array[int]", whole: bool) -> None:
        if stated == found.tobytes():
            return
        missing = len(stated) // 16 - len(found) // 2
        if not whole and missing > 0:
            self._lose(channel, missing)
        elif not np.array_equal(_sorted(np.frombuffer(stated[: len(stated) // 16 * 16], "<u8")), _sorted(found)):
            self._damage.count("contradiction", self._name(channel))

    def _lose(self, channel: int, messages: int) -> None:
        self._lost[channel] += messages
        self._damage.count("lost_message", self._name(channel), messages)

    def close(self, definitions: Mapping[int, int], *, trusted: bool) -> None:
        """The file has ended.

        Args:
            definitions: opcode -> number of schemas and of channels that were defined.
            trusted: whether the summary stands under a right checksum.
        """
        self._damage.count("contradiction", n=self._without_crc if self._with_crc else 0)
        if not self._opcodes[Opcode.FOOTER]:
            return
        found = self._opcodes
        wrong = [self._lengths.get(place) != length for place, length in self._pointers if self._all_places_kept]
        wrong.append(self._stated_start not in (0, self._summary_start))
        wrong.append(not found[Opcode.DATA_END])
        wrong.append(found[Opcode.CHUNK_INDEX] not in (0, found[Opcode.CHUNK]))
        self._damage.count("contradiction", n=sum(wrong))
        if self._statistics is not None:
            self._check_statistics(self._statistics, definitions, trusted)

    @property
    def _all_places_kept(self) -> bool:
        return len(self._lengths) < MAX_PLACES

    def _check_statistics(self, body: bytes, definitions: Mapping[int, int], trusted: bool) -> None:
        try:
            (head, counts), _ = split(Opcode.STATISTICS, body)
            by_channel = np.frombuffer(counts, COUNT)
        except ValueError:
            self._damage.count("bad_record")
            return
        if len(by_channel):
            self._check_channels(dict(by_channel.tolist()), trusted)
        messages, schemas, channels, attachments, metadata, chunks, start_ns, end_ns = STATISTICS.unpack(head)
        found, total = self._opcodes, self._messages.total()
        wrong = (
            messages != total + self._lost.total(),
            attachments != found[Opcode.ATTACHMENT],
            metadata != found[Opcode.METADATA],
            chunks != found[Opcode.CHUNK],
            schemas > definitions[Opcode.SCHEMA],
            channels > definitions[Opcode.CHANNEL],
            bool(total) and total == messages and (start_ns, end_ns) != (self._start_ns, self._end_ns),
        )
        self._damage.count("contradiction", n=sum(wrong))

    def _check_channels(self, stated: dict[int, int], trusted: bool) -> None:
        for channel in sorted(stated.keys() | self._messages.keys()):
            missing = stated.get(channel, 0) - self._messages[channel] - self._lost[channel]
            if missing > 0 and trusted:
                self._lose(channel, missing)
            elif missing:
                self._damage.count("contradiction", self._name(channel))


def _sorted(entries: "npt.ArrayLike") -> npt.NDArray[np.uint64]:
    """Pairs in order of both numbers."""
    pairs = np.asarray(entries, np.uint64).reshape(-1, 2)
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
