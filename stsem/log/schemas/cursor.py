"""Reads the bytes of a ROS message from the front, in any of the ways that ROS writes them, without a copy.

Readers raise ValueError, struct.error or IndexError when the bytes are not such a message, and no announced length
makes them take more memory than the message has.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass

NS = 1_000_000_000
MAX_TEXT = 4096
"""Bytes of the longest text: names of frames, encodings, models and classes are short."""


@dataclass(frozen=True)
class Wire:
    """How numbers and sequences are written.

    Args:
        order: `<` little endian, `>` big endian, as in struct.
        align: the largest alignment; numbers are aligned to their size, or to this where they are larger.
        counts_headers: whether a std_msgs/Header begins with a sequence number (ROS 1).
        sizes_sequences: whether a sequence of messages begins with its size in bytes (XCDR2).
    """

    order: str
    align: int
    counts_headers: bool = False
    sizes_sequences: bool = False


ROS1 = Wire("<", align=1, counts_headers=True)
ENCAPSULATIONS = {
    b"\0\0": Wire(">", align=8),
    b"\0\1": Wire("<", align=8),
    b"\0\6": Wire(">", align=4, sizes_sequences=True),
    b"\0\7": Wire("<", align=4, sizes_sequences=True),
}
"""First two bytes of cdr: the plain representations of XCDR1 and XCDR2 (DDS-XTypes 1.3, 7.6.3.1.2)."""

_NUMBERS = {order: (struct.Struct(order + "H"), struct.Struct(order + "I")) for order in "<>"}


class Cursor:
    """Place in one message; every method reads the next thing and moves behind it.

    Args:
        data: the message from where alignment is counted.
        wire: how it is written.
    """

    __slots__ = ("_at", "_data", "_u16", "_u32", "_wire")

    def __init__(self, data: memoryview, wire: Wire) -> None:
        self._data, self._wire, self._at = data, wire, 0
        u16, u32 = _NUMBERS[wire.order]
        self._u16, self._u32 = u16.unpack_from, u32.unpack_from

    def u8(self) -> int:
        """Next byte."""
        self._at += 1
        return self._data[self._at - 1]

    def u16(self) -> int:
        """Next 16-bit unsigned integer."""
        at = self._aligned(2)
        self._at = at + 2
        return int(self._u16(self._data, at)[0])

    def u32(self) -> int:
        """Next 32-bit unsigned integer."""
        at = self._aligned(4)
        self._at = at + 4
        return int(self._u32(self._data, at)[0])

    def f64s(self, count: int) -> tuple[float, ...]:
        """Next `count` 64-bit floats."""
        if count == 0:
            return ()
        at = self._aligned(8)
        if count * 8 > len(self._data) - at:
            raise ValueError(f"{count} numbers are announced but {len(self._data) - at} bytes are there")
        self._at = at + count * 8
        return struct.unpack_from(f"{self._wire.order}{count}d", self._data, at)

    def blob(self) -> memoryview:
        """Next sequence of bytes, as a view."""
        length = self.u32()
        start, self._at = self._at, self._at + length
        if self._at > len(self._data):
            raise ValueError(f"{length} bytes are announced but {len(self._data) - start} are there")
        return self._data[start : self._at]

    def text(self) -> str:
        """Next string, without its closing zero."""
        blob = self.blob()
        if len(blob) > MAX_TEXT:
            raise ValueError(f"a name of {len(blob)} bytes is announced")
        return bytes(blob).rstrip(b"\0").decode()

    def items(self, smallest: int) -> range:
        """Indices of the messages of the next sequence, each of which has at least `smallest` bytes."""
        if self._wire.sizes_sequences:
            self.u32()
        count = self.u32()
        if count * smallest > len(self._data) - self._at:
            raise ValueError(f"{count} items are announced but {len(self._data) - self._at} bytes are there")
        return range(count)

    def stamp(self) -> int | None:
        """Next time in nanoseconds; None when it is zero, which means unset."""
        seconds, rest = self.u32(), self.u32()
        return seconds * NS + rest or None

    def header(self) -> tuple[int | None, str]:
        """(stamp_ns, frame_id) of the next std_msgs/Header."""
        return self.header_stamp(), self.text()

    def header_stamp(self) -> int | None:
        """Stamp of the next std_msgs/Header; its frame_id remains to be read."""
        if self._wire.counts_headers:
            self.u32()
        return self.stamp()

    def _aligned(self, size: int) -> int:
        mask = min(size, self._wire.align) - 1
        return (self._at + mask) & ~mask


Open = Callable[[memoryview], Cursor]


def cdr(payload: memoryview) -> Cursor:
    """Cursor at the front of a ROS 2 message.

    Raises:
        ValueError: the encapsulation is not plain cdr (parameter lists and delimited ones are not read).
    """
    wire = ENCAPSULATIONS.get(bytes(payload[:2]))
    if wire is None or len(payload) < 4:
        raise ValueError(f"the payload does not begin as plain cdr but with {bytes(payload[:4]).hex() or 'nothing'}")
    return Cursor(payload[4:], wire)


def ros1(payload: memoryview) -> Cursor:
    """Cursor at the front of a ROS 1 message."""
    return Cursor(payload, ROS1)
