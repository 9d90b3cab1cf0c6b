"""ROS 2 bags in sqlite3: the files of a folder, plain or packed with zstd as a whole or message by message.

The tables are read with sqlite3 of the standard library, so that a bag whose metadata.yaml is missing or wrong is read,
too. Message definitions stand in the bag since ROS 2 Iron; for older ones see `definitions.py`.
"""

import re
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import zstandard

from stsem.convert.recording import Loss
from stsem.convert.sqlitefile import SqliteFile, open_sqlite
from stsem.errors import ConversionError
from stsem.log.container.files import natural
from stsem.log.container.records import MAX_RECORD_BYTES

SUFFIX, PACKED_SUFFIX, METADATA = ".db3", ".db3.zstd", "metadata.yaml"
MAX_MESSAGE_BYTES = MAX_RECORD_BYTES  # what is larger could not be read from the log
MAX_METADATA_CHARACTERS = 16 << 20
_ZSTD = b"\x28\xb5\x2f\xfd"
_LISTED = re.compile(r"^\s*-\s*[\"']?([^\s\"']+\.(?:db3|mcap)(?:\.zstd)?)[\"']?\s*$", re.MULTILINE)
_COUNT = re.compile(r"^  message_count:\s*(\d{1,15})\s*$", re.MULTILINE)
_MIN_ROW_BYTES = 8
_FIRST, _LAST = 0, (1 << 63) - 1
_FROM = "SELECT rowid, topic_id, timestamp, data FROM messages WHERE rowid >= ? ORDER BY rowid"
_Row = tuple[Any, ...]

UNCLOSED = "recordings that were not closed, by a write-ahead file or a journal: their last messages may be missing"
MISSING = "messages in damaged parts of a bag file"
NO_END = "bag files that are damaged from some message on"


@dataclass(frozen=True)
class Topic:
    """One topic of a bag: type as ROS 2 names it (`sensor_msgs/msg/Image`).

    Args:
        name, type_name: of the topic.
        serialization: how messages are encoded, `cdr` of all that is known.
        schema_encoding: `ros2msg` or `ros2idl`; "" of a bag without definitions.
        definition: the text; "" of a bag without definitions.
    """

    name: str
    type_name: str
    serialization: str
    schema_encoding: str = ""
    definition: str = ""


@dataclass(frozen=True, eq=False)
class Message:
    """One message as it was recorded."""

    topic: Topic
    log_ns: int
    data: bytes


def bag_files(source: Path) -> list[Path]:
    """The sqlite3 files of a bag in their order: those of a folder, or the one file."""
    if source.is_file():
        return [source] if source.name.endswith((SUFFIX, PACKED_SUFFIX)) else []
    with suppress(OSError):
        found = [path for path in source.iterdir() if path.name.endswith((SUFFIX, PACKED_SUFFIX)) and path.is_file()]
        return sorted(found, key=lambda path: natural(path.name))
    return []


def stated(source: Path) -> tuple[int, int]:
    """(files that metadata.yaml names and that are not there, messages that it counts); zeros without one."""
    try:
        with (source / METADATA).open(errors="replace") as stream:
            text = stream.read(MAX_METADATA_CHARACTERS)
        names = {name.rsplit("/", 1)[-1] for name in _LISTED.findall(text)}
        count = _COUNT.search(text)
        return sum(not (source / name).exists() for name in names), int(count[1]) if count else 0
    except OSError:
        return 0, 0


def messages(path: Path, scratch: Path) -> Iterator[Message | Loss]:
    """Messages of one file in the order in which they were recorded.

    Args:
        path: the file.
        scratch: where a packed file is unpacked to; gone afterwards.

    Raises:
        ConversionError: it is no such file.
    """
    with open_sqlite(path, scratch, MAX_MESSAGE_BYTES) as file:
        try:
            topics = _topics(file)
            file.db.execute(f"{_FROM} LIMIT 0", (0,))
        except sqlite3.Error as err:
            raise ConversionError(f"{path} is not a ROS 2 bag in sqlite3 ({err}); give the folder of a bag.") from err
        if file.unclosed:
            yield Loss(UNCLOSED)
        for row in _rows(file):
            try:
                yield row if isinstance(row, Loss) else _message(row[1:], topics)
            except ValueError as err:
                yield Loss(str(err))


def _rows(file: SqliteFile) -> Iterator[_Row | Loss]:
    """Rows, as far as they fit into the file."""
    limit = _Limit(file.size_bytes)
    for row in _readable(file):
        if isinstance(row, tuple) and not limit.holds(row):
            yield Loss(NO_END)
            return
        yield row


def _readable(file: SqliteFile) -> Iterator[_Row | Loss]:
    """Rows in the order of their numbers; behind damaged pages from the next on that can be read."""
    last = _FIRST - 1
    while True:
        with suppress(sqlite3.Error, OverflowError):
            for row in file.db.execute(_FROM, (last + 1,)):
                if row[0] <= last:
                    raise sqlite3.DatabaseError("its pages go round in a circle")
                last = row[0]
                yield row
            return
        found = _behind(file.db, last)
        if found is None:
            yield Loss(NO_END)
            return
        number, row = found
        yield Loss(MISSING, count=min(number - last - 1, file.size_bytes // _MIN_ROW_BYTES))
        if row is None:
            return
        last = number
        yield row


_Place = tuple[int, _Row | None]
"""The number of a row and the row, or the number that follows the last row and None."""


def _behind(db: sqlite3.Connection, last: int) -> _Place | None:
    """The place behind `last` from which on rows can be read again; None when there is none."""
    step = 1
    while (found := _place(db, last + step)) is None:
        step *= 2
        if last + step > _LAST:
            return None
    broken, whole = last + step // 2, last + step
    while whole - broken > 1:
        middle = (broken + whole) // 2
        if nearer := _place(db, middle):
            whole, found = middle, nearer
        else:
            broken = middle
    return found


def _place(db: sqlite3.Connection, number: int) -> _Place | None:
    """What stands at `number`, or next; None when that cannot be read."""
    try:
        row = db.execute(f"{_FROM} LIMIT 1", (number,)).fetchone()
    except (sqlite3.Error, OverflowError):
        return None
    if row is None:
        return number, None
    return (row[0], row) if row[0] >= number else None


class _Limit:
    """What is read must fit into the file: columns may be made up by a formula."""

    def __init__(self, size_bytes: int) -> None:
        self._left = size_bytes

    def holds(self, row: Iterable[Any]) -> bool:
        """Whether it still does with this row."""
        self._left -= sum(len(value) for value in row if isinstance(value, str | bytes))
        return self._left >= 0


def _message(row: _Row, topics: dict[int, Topic]) -> Message:
    topic, log_ns, data = topics.get(row[0]), row[1], row[2]
    if topic is None:
        raise ValueError("messages of a topic that the bag does not list")
    if not (isinstance(log_ns, int) and log_ns >= 0 and isinstance(data, bytes)):
        raise ValueError("messages without time or content")
    if data.startswith(_ZSTD):
        data = _unpacked(data)
    return Message(topic, log_ns, data)


def _unpacked(data: bytes) -> bytes:
    """A message; the recorder states its size in front, and only so much memory is taken."""
    try:
        if not 0 <= zstandard.get_frame_parameters(data).content_size <= MAX_MESSAGE_BYTES:
            raise ValueError("compressed messages that do not state a size that can be")
        return zstandard.ZstdDecompressor().decompress(data)
    except (zstandard.ZstdError, MemoryError) as err:
        raise ValueError("messages that cannot be decompressed") from err


def _topics(file: SqliteFile) -> dict[int, Topic]:
    tables = {name for (name,) in file.db.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    if not {"topics", "messages"} <= tables:
        raise sqlite3.DatabaseError("it has no tables of topics and messages")
    definitions: dict[str, tuple[str, str]] = {}
    if "message_definitions" in tables:
        query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
        definitions = {str(name): (str(encoding), str(text)) for name, encoding, text in _fitting(file, query)}
    query = "SELECT id, name, type, serialization_format FROM topics"
    return {
        number: Topic(str(name), str(type_name), str(serialization), *definitions.get(str(type_name), ()))
        for number, name, type_name, serialization in _fitting(file, query)
    }


def _fitting(file: SqliteFile, query: str) -> Iterator[_Row]:
    """What is found.

    Raises:
        sqlite3.Error: it does not fit into the file, or the file is damaged.
    """
    limit = _Limit(file.size_bytes)
    for row in file.db.execute(query):
        if not limit.holds(row):
            raise sqlite3.DatabaseError("it holds more than its bytes")
        yield row
