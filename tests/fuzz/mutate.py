"""Mutations of a log: each a pure function of the logs, a name and a seed.

Half of the places are where the structure of the file is (heads of records, the fields behind them, the summary),
because most bytes of a log are pixels. Operators on whole records leave a file that is well-formed record by record.
"""

import struct
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from stsem.log.container.layout import FRAME
from stsem.log.container.records import MAGIC

LONGEST = 4000
TAIL = 600
FIELDS = 80
INTERESTING = {
    1: (0, 1, 0x7F, 0x80, 0xFF),
    2: (0, 1, 0x7FFF, 0xFFFF),
    4: (0, 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 1 << 24),
    8: (0, 1, (1 << 63) - 1, 1 << 63, (1 << 64) - 1, 1 << 60, 1 << 32, 1 << 30),
}
FORMATS = {1: "<B", 2: "<H", 4: "<I", 8: "<Q"}


@dataclass(frozen=True)
class Mutant:
    """A mutated log, and the names of the operators in their order."""

    data: bytes
    operators: tuple[str, ...]


@dataclass
class Draw:
    """What an operator may look at: the random numbers, the log as it is now, its records, and another log."""

    random: np.random.Generator
    data: bytearray
    other: bytes

    def below(self, n: int) -> int:
        """A number of range(max(n, 1))."""
        return int(self.random.integers(max(n, 1)))

    def place(self) -> int:
        """Where to change something."""
        size, heads = len(self.data), record_places(self.data)
        where = self.random.random()
        if where < 0.3:
            at = self.below(size)
        elif where < 0.55:
            at = heads[self.below(len(heads))] + self.below(FRAME.size)
        elif where < 0.85:
            at = heads[self.below(len(heads))] + FRAME.size + self.below(FIELDS)
        else:
            at = size - 1 - self.below(min(size, TAIL))
        return max(0, min(at, size - 1))

    def stretch(self) -> slice:
        """A stretch of up to LONGEST bytes, short ones as often as long ones."""
        start = self.place()
        return slice(start, start + 1 + int(LONGEST ** self.random.random()))

    def records(self) -> slice:
        """One to four whole records."""
        heads = record_places(self.data)
        first = self.below(len(heads))
        last = min(first + 1 + self.below(4), len(heads) - 1)
        return slice(heads[first], max(heads[last], heads[first]))


def record_places(data: bytes | bytearray) -> list[int]:
    """The place of each record at the top level, and of what ends them; at least one."""
    places, at = [min(len(MAGIC), max(len(data) - 1, 0))], len(MAGIC)
    while at + FRAME.size <= len(data):
        places.append(at)
        at += FRAME.size + FRAME.unpack_from(data, at)[1]
    return places


def flip(draw: Draw) -> None:
    """One to eight bits, anywhere or within a few bytes of each other."""
    together, at = draw.below(2), draw.place()
    for _ in range(1 + draw.below(8)):
        here = min(at + draw.below(8), len(draw.data) - 1) if together else draw.place()
        draw.data[here] ^= 1 << draw.below(8)


def flip_one(draw: Draw) -> None:
    """One bit."""
    draw.data[draw.place()] ^= 1 << draw.below(8)


def overwrite(draw: Draw) -> None:
    """A number that lengths and counts are often wrong by."""
    size = (1, 2, 4, 8)[draw.below(4)]
    value = INTERESTING[size][draw.below(len(INTERESTING[size]))]
    at = min(draw.place(), len(draw.data) - size)
    draw.data[max(at, 0) : at + size] = struct.pack(FORMATS[size], value)


def add_little(draw: Draw) -> None:
    """A length or an offset that is wrong by a little."""
    draw.data += bytes(max(0, 4 - len(draw.data)))
    at = min(draw.place(), len(draw.data) - 4)
    (value,) = struct.unpack_from("<I", draw.data, at)
    struct.pack_into("<I", draw.data, at, (value + draw.below(33) - 16) % (1 << 32))


def cut_end(draw: Draw) -> None:
    del draw.data[draw.place() :]


def cut_middle(draw: Draw) -> None:
    del draw.data[draw.stretch()]


def cut_front(draw: Draw) -> None:
    """Behind the magic, so that it is still opened."""
    del draw.data[len(MAGIC) : draw.place()]


def duplicate(draw: Draw) -> None:
    stretch = draw.stretch()
    at = stretch.stop if draw.below(2) else draw.place()
    draw.data[at:at] = draw.data[stretch]


def swap(draw: Draw) -> None:
    _swap(draw, draw.stretch(), draw.stretch())


def zero(draw: Draw) -> None:
    stretch = draw.stretch()
    draw.data[stretch] = bytes(len(draw.data[stretch]))


def insert(draw: Draw) -> None:
    at, length = draw.place(), 1 + int(LONGEST ** draw.random.random())
    draw.data[at:at] = draw.random.integers(0, 256, length, np.uint8).tobytes()


def scramble(draw: Draw) -> None:
    stretch = draw.stretch()
    draw.data[stretch] = draw.random.integers(0, 256, len(draw.data[stretch]), np.uint8).tobytes()


def splice(draw: Draw) -> None:
    """A stretch of another log, put in or over."""
    length, source, at = 1 + int(LONGEST ** draw.random.random()), draw.below(len(draw.other)), draw.place()
    draw.data[at : at + draw.below(2) * length] = draw.other[source : source + length]


def splice_end(draw: Draw) -> None:
    """The front of this log and the end of another."""
    at = draw.place()
    draw.data[at:] = draw.other[min(at, len(draw.other)) - draw.below(50) :]


def concatenate(draw: Draw) -> None:
    """Another log, or this one again, behind or before."""
    added = draw.other if draw.below(2) else bytes(draw.data)
    if draw.below(2):
        draw.data += added
    else:
        draw.data[:0] = added


def drop_records(draw: Draw) -> None:
    del draw.data[draw.records()]


def repeat_records(draw: Draw) -> None:
    records = draw.records()
    draw.data[records.stop : records.stop] = draw.data[records]


def swap_records(draw: Draw) -> None:
    _swap(draw, draw.records(), draw.records())


def splice_records(draw: Draw) -> None:
    """Whole records of another log between those of this one, or instead of them."""
    places, here = record_places(draw.other), draw.records()
    first = draw.below(len(places))
    last = min(first + 1 + draw.below(4), len(places) - 1)
    target = here if draw.below(2) else slice(here.start, here.start)
    draw.data[target] = draw.other[places[first] : places[last]]


def cut_at_record(draw: Draw) -> None:
    del draw.data[draw.records().start :]


def _swap(draw: Draw, one: slice, other: slice) -> None:
    a, b = sorted((one, other), key=lambda s: s.start)
    b = slice(max(a.stop, b.start), max(a.stop, b.stop))
    draw.data[a.start : b.stop] = draw.data[b] + draw.data[a.stop : b.start] + draw.data[a]


OPERATORS: dict[Callable[[Draw], None], int] = {
    flip_one: 6, flip: 6, overwrite: 6, add_little: 3, cut_end: 2, cut_middle: 3, cut_front: 1, duplicate: 2, swap: 2,
    zero: 2, insert: 2, scramble: 2, splice: 3, splice_end: 1, concatenate: 1, drop_records: 2, repeat_records: 2,
    swap_records: 2, splice_records: 2, cut_at_record: 1,
}  # fmt: skip
WEIGHTS = np.array(list(OPERATORS.values())) / sum(OPERATORS.values())
HOW_MANY = (1, 1, 1, 1, 1, 1, 2, 2, 3, 4)


def mutant(logs: Mapping[str, bytes], name: str, seed: int) -> Mutant:
    """The log `name` with one to four mutations; equal arguments give equal bytes."""
    random = np.random.Generator(np.random.PCG64([zlib.crc32(name.encode()), seed]))
    others, table = [other for other in logs if other != name], list(OPERATORS)
    draw = Draw(random, bytearray(logs[name]), logs[others[int(random.integers(len(others)))]])
    applied = []
    for _ in range(HOW_MANY[draw.below(len(HOW_MANY))]):
        operator = table[int(random.choice(len(table), p=WEIGHTS))]
        if not draw.data:
            break
        operator(draw)
        applied.append(operator.__name__)
    return Mutant(bytes(draw.data), tuple(applied))
