"""What the scan keeps of each channel: for images a compact reference per message, for small messages their content."""

from array import array
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from mcap.records import Schema

from stsem.log.damage import Damage
from stsem.log.decode import TABLE, MessageReader, Row, StampReader
from stsem.log.messages import Calibration, ClassNames, Kind, Transform

Int64 = npt.NDArray[np.int64]


@dataclass(frozen=True)
class References:
    """Where the messages of a channel are, ordered by (stamp, log time, position in the file); (n,) int64 each.

    Args:
        stamp_ns: capture stamp, the log time where the sensor gave none.
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


class Track:
    """One channel during and after the scan.

    Args:
        topic, schema, encoding: of the channel; `encoding` is that of its messages.
        row: of the decoder table; None when stsem does not read such messages, which are then only counted.
    """

    def __init__(self, topic: str, schema: Schema, encoding: str, damage: Damage) -> None:
        self.topic, self.schema, self.encoding = topic, schema.name, encoding
        self.row: Row | None = TABLE.get((encoding, schema.name))
        self.trouble = ""
        self.count = self.unstamped = 0
        self.first_log_ns: int | None = None
        self.last_log_ns: int | None = None
        self.largest_gap_ns = 0
        self.transforms: list[tuple[Transform, int]] = []
        self.calibrations: list[Calibration] = []
        self.class_names: list[ClassNames] = []
        self._damage = damage
        self._last_tail = b""
        self._previous_log_ns: int | None = None
        self._columns = [array("q") for _ in range(5)]
        self.decode: MessageReader | None = None
        self._stamp: StampReader | None = None
        self._make_readers(schema)

    def _make_readers(self, schema: Schema) -> None:
        if self.row is None:
            return
        try:
            self.decode = self.row.reader(schema)
            self._stamp = self.row.stamp(schema) if self.row.stamp else None
        except Exception as err:  # noqa: BLE001  a schema is foreign input to three parsers with errors of their own
            self.trouble = f"the schema of {self.topic} cannot be read ({err or type(err).__name__})"
            self.row = None

    @property
    def kind(self) -> Kind | None:
        """What it holds; None when stsem does not read such messages."""
        return self.row.kind if self.row else None

    def add(self, payload: memoryview, log_ns: int, place: int, offset: int) -> None:
        """Take in one message, in file order."""
        self._count(log_ns)
        if self.row is None:
            return
        try:
            stamp_ns = self._stamp(payload) if self._stamp else self._read(payload, log_ns)
            if self._stamp and self.row.kind is Kind.CALIBRATION:
                self._read_if_new(payload, log_ns)
        except Exception:  # noqa: BLE001  any error of a foreign parser means: undecodable
            self._damage.undecodable(self.topic, place, offset)
            stamp_ns = None
            if self.row.kind not in (Kind.IMAGE, Kind.COMPRESSED):
                return
        if stamp_ns is None:
            self.unstamped += 1
            stamp_ns = log_ns
        for column, value in zip(self._columns, (stamp_ns, log_ns, place, offset, len(payload)), strict=True):
            column.append(value)

    def _count(self, log_ns: int) -> None:
        self.count += 1
        if self._previous_log_ns is not None:
            self.largest_gap_ns = max(self.largest_gap_ns, log_ns - self._previous_log_ns)
        self._previous_log_ns = log_ns
        self.first_log_ns = log_ns if self.first_log_ns is None else min(self.first_log_ns, log_ns)
        self.last_log_ns = log_ns if self.last_log_ns is None else max(self.last_log_ns, log_ns)

    def _read_if_new(self, payload: memoryview, log_ns: int) -> None:
        assert self.row is not None
        tail = bytes(payload[self.row.unstamped_tail or 0 :])
        if tail != self._last_tail:
            self._read(payload, log_ns)
            self._last_tail = tail

    def _read(self, payload: memoryview, log_ns: int) -> int | None:
        assert self.decode is not None
        message = self.decode(payload)
        if isinstance(message, tuple):
            self.transforms.extend((transform, log_ns) for transform in message)
            return message[0].stamp_ns if message else None
        if isinstance(message, Calibration) and [message.camera] != [c.camera for c in self.calibrations[-1:]]:
            self.calibrations.append(message)
        if isinstance(message, ClassNames) and [message.names] != [c.names for c in self.class_names[-1:]]:
            self.class_names.append(message)
        return message.stamp_ns

    def references(self) -> References:
        """All stamped messages, in order."""
        stamp, log, place, offset, length = (_as_int64(column) for column in self._columns)
        order = np.lexsort((offset, place, log, stamp))
        return References(stamp[order], log[order], place[order], offset[order], length[order])

    def stamp_offsets_ns(self) -> Int64:
        """(n,) log time minus stamp of every stamped message, in file order."""
        return _as_int64(self._columns[1]) - _as_int64(self._columns[0])


def _as_int64(column: "array[Any]") -> Int64:
    return np.frombuffer(column, np.int64) if len(column) else np.zeros(0, np.int64)
