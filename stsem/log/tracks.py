"""What the scan keeps of each channel: for images a compact reference per message, for small messages their content."""

from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt
from mcap.records import Schema

from stsem.log.container.damage import Damage
from stsem.log.schemas.messages import Calibration, ClassNames, Decoded, Kind, Transform
from stsem.log.schemas.table import TABLE, MessageReader, Row, StampReader, why_not
from stsem.log.unstamped import stand_in
from stsem.packed import packed_time
from stsem.plain import plain

Int64 = npt.NDArray[np.int64]
Float64 = npt.NDArray[np.float64]
MAX_NS = 1 << 63
MAX_SCHEMA_BYTES = 1 << 20
MAX_PAIRS = 1 << 14
"""Pairs of frames on one channel; robots have hundreds."""
MAX_DIFFERENT = 64
"""A camera that focuses by itself has another calibration for every image."""
Differing = TypeVar("Differing", Calibration, ClassNames)


@dataclass(frozen=True)
class References:
    """Where the messages of a channel are, ordered by (stamp, log time, position in the file); (n,) int64 each.

    Args:
        stamp_ns: capture stamp, or what stands in for it (`unstamped.py`) where the sensor gave none.
        log_ns: log time.
        place: bytes from the front of the log to the chunk, or to the message itself when it is in no chunk.
        offset: of the payload inside the decompressed chunk, or inside the log when it is in no chunk.
        length: of the payload.
    """

    stamp_ns: Int64
    log_ns: Int64
    place: Int64
    offset: Int64
    length: Int64

    def __len__(self) -> int:
        return len(self.stamp_ns)


class Samples:
    """Transforms of one pair of frames, in file order, packed: 72 bytes each."""

    def __init__(self) -> None:
        self._times = array("q")
        self._values = array("d")

    def __len__(self) -> int:
        return len(self._times) // 2

    def add(self, transform: Transform, log_ns: int) -> None:
        """Take in one, with a stamp or without."""
        self._times.extend((packed_time(transform.stamp_ns), log_ns))
        self._values.extend((*transform.translation, *transform.quaternion))

    def arrays(self) -> tuple[Int64, Int64, Float64, Float64]:
        """(stamps (n,), log times (n,), translations (n, 3), quaternions (n, 4) x y z w)."""
        times = _as_int64(self._times).reshape(-1, 2)
        values = np.asarray(self._values, np.float64).reshape(-1, 7)
        return stand_in(times[:, 0], times[:, 1])[0], times[:, 1], values[:, :3], values[:, 3:]


class Track:
    """One channel during and after the scan.

    Attributes:
        topic, schema, encoding: of the channel; `encoding` is that of its messages.
        row: of the decoder table; None when stsem does not read such messages, which are then only counted.
        trouble: why a row could not be used; "" otherwise.
        definition: the text of its schema.
        count, first_log_ns, last_log_ns, largest_gap_ns: of all messages.
        out_of_order: messages whose log time is below that of the one before in the file.
        unstamped: messages without a capture stamp.
        transforms: (parent, child) -> samples.
        calibrations, class_names: those that differ from the one before; of many the first, and the last.
        changes: how often one differed from the one before.
    """

    def __init__(self, topic: str, schema: Schema, encoding: str, damage: Damage) -> None:
        self.topic, self.schema, self.encoding = plain(topic), plain(schema.name), plain(encoding)
        self.row: Row | None = TABLE.get((encoding, schema.name))
        self.trouble = f"{self.topic}: {plain(why)}" if (why := why_not(encoding, schema.name)) else ""
        self.definition = schema.data
        self.count = self.unstamped = self.out_of_order = self.largest_gap_ns = self.changes = 0
        self.first_log_ns: int | None = None
        self.last_log_ns: int | None = None
        self.transforms: dict[tuple[str, str], Samples] = {}
        self.calibrations: list[Calibration] = []
        self.class_names: list[ClassNames] = []
        self.decode: MessageReader | None = None
        self._stamp: StampReader | None = None
        self._damage = damage
        self._behind_stamp = b""
        self._previous_log_ns: int | None = None
        self._times = [array("q"), array("q")]
        self._where = [array("q"), array("q"), array("q")]
        if self.row is not None:
            self._make_readers(self.row, schema)

    def _make_readers(self, row: Row, schema: Schema) -> None:
        try:
            if len(schema.data) > MAX_SCHEMA_BYTES:
                raise ValueError(f"it has {len(schema.data)} bytes, more than any message definition")
            self.decode = row.reader(schema)
            self._stamp = row.stamp(schema) if row.stamp else None
        except Exception as err:  # noqa: BLE001  a schema is foreign input to three parsers with errors of their own
            self.trouble = f"the schema of {self.topic} cannot be read ({plain(str(err)) or type(err).__name__})"
            self.row = None

    @property
    def kind(self) -> Kind | None:
        """What it holds; None when stsem does not read such messages."""
        return self.row.kind if self.row else None

    @property
    def is_image(self) -> bool:
        """Whether its messages hold pixels."""
        return self.row is not None and self.row.kind.is_image

    def add(self, payload: memoryview, log_ns: int, place: int, offset: int) -> None:
        """Take in one message, in file order. An image whose stamp cannot be read stays, without."""
        self._count(log_ns)
        if self.row is None or self.decode is None:
            return
        stamp_ns = None
        try:
            stamp_ns = self._take(self.row, self.decode, payload, log_ns)
        except Exception as err:  # noqa: BLE001  any error of a foreign parser means: undecodable
            self._damage.undecodable(self.topic, place, offset, str(err) or type(err).__name__)
            if not self.is_image:
                return
        if stamp_ns is None:
            self.unstamped += 1
        _append(self._times, (packed_time(stamp_ns), log_ns))
        if self.is_image:
            _append(self._where, (place, offset, len(payload)))

    def _count(self, log_ns: int) -> None:
        self.count += 1
        if self._previous_log_ns is not None:
            self.largest_gap_ns = max(self.largest_gap_ns, log_ns - self._previous_log_ns)
            self.out_of_order += log_ns < self._previous_log_ns
        self._previous_log_ns = log_ns
        self.first_log_ns = log_ns if self.first_log_ns is None else min(self.first_log_ns, log_ns)
        self.last_log_ns = log_ns if self.last_log_ns is None else max(self.last_log_ns, log_ns)

    def _take(self, row: Row, decode: MessageReader, payload: memoryview, log_ns: int) -> int | None:
        """Stamp of a message; small ones are read wholly, calibrations only when they differ from the one before."""
        if self._stamp is None:
            return self._read(decode(payload), log_ns)
        if row.kind is Kind.CALIBRATION and (behind := bytes(payload[row.stamp_bytes :])) != self._behind_stamp:
            self._read(decode(payload), log_ns)
            self._behind_stamp = behind
        return plausible(self._stamp(payload))

    def _read(self, message: Decoded, log_ns: int) -> int | None:
        if isinstance(message, tuple):
            return self._read_transforms(message, log_ns)
        if isinstance(message, Calibration):
            self.changes += _keep(self.calibrations, message)
        if isinstance(message, ClassNames):
            self.changes += _keep(self.class_names, message)
        return plausible(message.stamp_ns)

    def _read_transforms(self, message: tuple[Transform, ...], log_ns: int) -> int | None:
        """Stamp of the first; of a message without any, its log time: nothing in it lacks a stamp."""
        stamps = [plausible(transform.stamp_ns) for transform in message]
        pairs = [(plain(transform.parent), plain(transform.child)) for transform in message]
        if len(self.transforms) + len({pair for pair in pairs if pair not in self.transforms}) > MAX_PAIRS:
            raise ValueError(f"there are more than {MAX_PAIRS} pairs of frames")
        for pair, transform in zip(pairs, message, strict=True):
            self.transforms.setdefault(pair, Samples()).add(transform, log_ns)
        return stamps[0] if stamps else log_ns

    def references(self) -> References:
        """Where the images are, in order, once all have come in; other messages are not looked up again."""
        if not self.is_image:
            return References(*(np.zeros(0, np.int64) for _ in range(5)))
        log, where = _as_int64(self._times[1]), [_as_int64(column) for column in self._where]
        columns = stamp, log, place, offset, _ = self._stamps()[0], log, *where
        order = np.lexsort((offset, place, log, stamp))
        if (np.diff(order) == 1).all():  # as they were recorded: nothing is copied
            return References(*columns)
        return References(*(column[order] for column in columns))

    @property
    def duplicates(self) -> int:
        """Messages that were read and have the stamp of an earlier one; several transforms may share one."""
        return len(self._times[0]) - len(np.unique(self._stamps()[0]))

    def stamp_offsets_ns(self) -> Int64:
        """(n,) log time minus stamp of every message that was read, in file order."""
        return _as_int64(self._times[1]) - self._stamps()[0]

    @property
    def stand_in(self) -> str:
        """What stands in for stamps that are not there, in a few words; "" when all are."""
        return self._stamps()[1]

    def _stamps(self) -> tuple[Int64, str]:
        return stand_in(_as_int64(self._times[0]), _as_int64(self._times[1]))


def plausible(stamp_ns: int | None) -> int | None:
    """`stamp_ns` if it can be a time; ValueError otherwise."""
    if stamp_ns is not None and not 0 < stamp_ns < MAX_NS:
        raise ValueError(f"{stamp_ns} ns is no time")
    return stamp_ns


def _keep(kept: list[Differing], message: Differing) -> bool:
    """Take in what differs from the last one; whether it is a change, which the first one is not."""
    if not kept:
        kept.append(message)
        return False
    if message.same_as(kept[-1]):
        return False
    kept[MAX_DIFFERENT - 1 :] = [message]
    return True


def _append(columns: "Sequence[array[int]]", values: Sequence[int]) -> None:
    for column, value in zip(columns, values, strict=True):
        column.append(value)


def _as_int64(column: "array[int]") -> Int64:
    """A view: while it lives, the column cannot grow."""
    return np.asarray(column, np.int64)
