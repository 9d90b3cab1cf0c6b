"""ROS 2 bags in sqlite3: the files of a folder, plain or packed with zstd as a whole or message by message.

The tables are read with sqlite3 of the standard library, so that a bag whose metadata.yaml is missing or wrong is read,
too. Message definitions stand in the bag since ROS 2 Iron; for older ones see `definitions.py`.
"""

import os
import re
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO
from urllib.parse import quote

import zstandard

from stsem.convert.recording import Loss
from stsem.errors import ConversionError, OutputError
from stsem.log.container.files import natural
from stsem.log.container.records import MAX_RECORD_BYTES

SUFFIX, PACKED_SUFFIX, METADATA = ".db3", ".db3.zstd", "metadata.yaml"
MAX_MESSAGE_BYTES = MAX_RECORD_BYTES  # what is larger could not be read from the log
MAX_UNPACKING = 1000
MAX_METADATA_CHARACTERS = 16 << 20
_ZSTD = b"\x28\xb5\x2f\xfd"
_LISTED = re.compile(r"^\s*-\s*[\"']?([^\s\"']+\.(?:db3|mcap)(?:\.zstd)?)[\"']?\s*$", re.MULTILINE)
_COUNT = re.compile(r"^  message_count:\s*(\d{1,15})\s*$", re.MULTILINE)
_PIECE = 1 << 20


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
    if path.with_name(f"{path.name}-wal").exists():
        yield Loss("write-ahead files (-wal) that are not read, as the recorder did not close the bag")
    with _opened(path, scratch) as (db, size):
        try:
            topics = _topics(db, size)
            rows = _rows(db.execute("SELECT topic_id, timestamp, data FROM messages ORDER BY rowid"), size)
        except sqlite3.Error as err:
            raise ConversionError(f"{path} is not a ROS 2 bag in sqlite3 ({err}); give the folder of a bag.") from err
        yield from _messages(rows, topics)


def _rows(found: sqlite3.Cursor, size: int) -> Iterator[tuple[Any, ...]]:
    """What was found, as long as it fits into a file of `size` bytes: columns may be made up by a formula.

    Raises:
        sqlite3.Error: it does not, or the file is damaged.
    """
    left = size
    for row in found:
        left -= sum(len(value) for value in row if isinstance(value, str | bytes))
        if left < 0:
            raise sqlite3.DatabaseError("it holds more than its bytes")
        yield row


def _messages(rows: Iterator[tuple[Any, ...]], topics: dict[int, Topic]) -> Iterator[Message | Loss]:
    while True:
        try:
            row = next(rows, None)
        except (sqlite3.Error, OverflowError):
            yield Loss("bag files that are damaged from some message on")
            return
        if row is None:
            return
        try:
            yield _message(row, topics)
        except ValueError as err:
            yield Loss(str(err))


def _message(row: tuple[Any, ...], topics: dict[int, Topic]) -> Message:
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


def _topics(db: sqlite3.Connection, size: int) -> dict[int, Topic]:
    tables = {name for (name,) in db.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
    if not {"topics", "messages"} <= tables:
        raise sqlite3.DatabaseError("it has no tables of topics and messages")
    definitions: dict[str, tuple[str, str]] = {}
    if "message_definitions" in tables:
        query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
        rows = _rows(db.execute(query), size)
        definitions = {str(name): (str(encoding), str(text)) for name, encoding, text in rows}
    query = "SELECT id, name, type, serialization_format FROM topics"
    return {
        number: Topic(str(name), str(type_name), str(serialization), *definitions.get(str(type_name), ()))
        for number, name, type_name, serialization in _rows(db.execute(query), size)
    }


@contextmanager
def _opened(path: Path, scratch: Path) -> Iterator[tuple[sqlite3.Connection, int]]:
    """The data base and its bytes, read only: nothing is written beside the bag."""
    packed = path.name.endswith(PACKED_SUFFIX)
    try:
        if packed:
            _unpack(path, scratch)
        unpacked = scratch if packed else path
        with closing(_connect(unpacked)) as db:
            yield db, unpacked.stat().st_size
    finally:
        if packed:
            scratch.unlink(missing_ok=True)


def _connect(path: Path) -> sqlite3.Connection:
    try:
        db = sqlite3.connect(f"file:{quote(os.path.abspath(path))}?mode=ro&immutable=1", uri=True)
    except sqlite3.Error as err:
        raise ConversionError(f"The bag {path} cannot be opened ({err}).") from err
    db.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_MESSAGE_BYTES)
    db.execute("PRAGMA trusted_schema = OFF")
    db.text_factory = lambda data: data.decode(errors="replace")
    return db


def _unpack(path: Path, scratch: Path) -> None:
    try:
        with path.open("rb") as packed, scratch.open("wb") as plain:
            _copy(path, packed, plain)
    except OSError as err:
        raise OutputError(f"{path} cannot be unpacked to {scratch} ({err.strerror or err}); make room there.") from err


def _copy(path: Path, packed: BinaryIO, plain: BinaryIO) -> None:
    limit = MAX_UNPACKING * path.stat().st_size
    try:
        for piece in zstandard.ZstdDecompressor().read_to_iter(packed, read_size=_PIECE, write_size=_PIECE):
            if plain.tell() > limit:
                raise ConversionError(f"{path} unpacks to more than {MAX_UNPACKING} times its size: no bag does.")
            plain.write(piece)
    except zstandard.ZstdError as err:
        raise ConversionError(f"{path} cannot be decompressed ({err}); unpack it with zstd if you can.") from err
