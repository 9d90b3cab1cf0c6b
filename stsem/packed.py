"""What grows with the length of a log, packed: records in rows of bytes, integers by log index."""

from abc import ABC, abstractmethod
from array import array
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from struct import Struct, error
from typing import Any, ClassVar, Generic, TypeVar, overload

from stsem.errors import LogError

T = TypeVar("T")
K = TypeVar("K", bound=Hashable)

ABSENT = -(1 << 63)
"""The 64-bit integer that stands for None."""


def packed_time(time_ns: int | None) -> int:
    """`time_ns`, or ABSENT for None."""
    return ABSENT if time_ns is None else time_ns


def unpacked_time(value: int) -> int | None:
    """None for ABSENT."""
    return None if value == ABSENT else value


class Packed(ABC, Sequence[T]):
    """A list that packs an item when it is appended, and makes an equal one whenever it is asked for.

    A subclass states the layout of a row and how an item becomes one. Safe to be read from several threads.

    Args:
        items: the first ones.
    """

    layout: ClassVar[Struct]

    def __init__(self, items: Iterable[T] = ()) -> None:
        self._rows = bytearray()
        for item in items:
            self.append(item)

    @abstractmethod
    def _pack(self, item: T) -> tuple[Any, ...]:
        """The values of a row."""

    @abstractmethod
    def _unpack(self, *values: Any) -> T:
        """The item of a row."""

    def append(self, item: T) -> None:
        """Add `item` at the end.

        Raises:
            LogError: a time in it is beyond 64 bits.
        """
        try:
            self._rows += self.layout.pack(*self._pack(item))
        except error as err:
            raise LogError(
                "A simulated time lies more than 292 years from the first frame, and 64 bits do not hold it in ns; "
                "look for stamps that are far off (stsem inspect), and at the rate and the costs."
            ) from err

    def __len__(self) -> int:
        return len(self._rows) // self.layout.size

    @overload
    def __getitem__(self, place: int) -> T: ...
    @overload
    def __getitem__(self, place: slice) -> list[T]: ...
    def __getitem__(self, place: int | slice) -> T | list[T]:
        chosen = range(len(self))[place]
        return self._item(chosen) if isinstance(chosen, int) else [self._item(row) for row in chosen]

    def __iter__(self) -> Iterator[T]:
        return map(self._item, range(len(self)))

    def _item(self, row: int) -> T:
        return self._unpack(*self.layout.unpack_from(self._rows, row * self.layout.size))

    def sort(self, key: Callable[[T], int]) -> None:
        """Sort in place, as a list does."""
        order = sorted(range(len(self)), key=lambda row: key(self._item(row)))
        size, rows = self.layout.size, bytearray()
        for row in order:
            rows += self._rows[row * size : (row + 1) * size]
        self._rows = rows


class Codes(Generic[K]):
    """Small numbers for values that come again and again, in order of their first coming."""

    def __init__(self) -> None:
        self._values: list[K] = []
        self._codes: dict[K, int] = {}

    def code(self, value: K) -> int:
        """The number of `value`."""
        found = self._codes.get(value)
        if found is None:
            found = self._codes[value] = len(self._values)
            self._values.append(value)
        return found

    def value(self, code: int) -> K:
        """The value with number `code`."""
        return self._values[code]


class IntByIndex(Mapping[int, int]):
    """An integer for some of the log indices, which start near 0: eight bytes each."""

    def __init__(self) -> None:
        self._values = array("q")

    def __setitem__(self, index: int, value: int) -> None:
        if index >= len(self._values):
            self._values.extend([ABSENT] * (index + 1 - len(self._values)))
        self._values[index] = value

    def __getitem__(self, index: int) -> int:
        if not 0 <= index < len(self._values) or self._values[index] == ABSENT:
            raise KeyError(index)
        return self._values[index]

    def __iter__(self) -> Iterator[int]:
        return (index for index, value in enumerate(self._values) if value != ABSENT)

    def __len__(self) -> int:
        return sum(value != ABSENT for value in self._values)
