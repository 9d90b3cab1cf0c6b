"""Data bases of recorders, opened to be read only: packed ones, cut ones, and those that were never closed.

sqlite changes a data base that was not closed when it opens it, so that is done with a copy beside the log that is
being written. Nothing is written beside the bag.
"""

import os
import shutil
import sqlite3
import struct
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO
from urllib.parse import quote

import zstandard

from stsem.errors import ConversionError, OutputError

PACKED_SUFFIX = ".zstd"
MAX_UNPACKING = 1000
WRITE_AHEAD, JOURNAL, SHARED = "-wal", "-journal", "-shm"
_PIECE = 1 << 20
_MAX_PAGE_BYTES = 1 << 16


@dataclass(frozen=True)
class SqliteFile:
    """An open data base.

    Args:
        db: the connection.
        size_bytes: of the file and of what belongs to it: it cannot hold more.
        unclosed: whether its writer did not close it.
    """

    db: sqlite3.Connection
    size_bytes: int
    unclosed: bool


@contextmanager
def open_sqlite(path: Path, scratch: Path, max_value_bytes: int) -> Iterator[SqliteFile]:
    """Open `path` as far as it goes: one that was cut is opened, too, and its lost pages are errors when they are read.

    Args:
        path: the file; packed as a whole when its name ends in `.zstd`.
        scratch: where a copy goes if one is needed; gone afterwards.
        max_value_bytes: longer values are errors.

    Raises:
        ConversionError: it cannot be unpacked, or not be opened; OutputError: there is no room for the copy.
    """
    packed, unclosed = path.name.endswith(PACKED_SUFFIX), bool(_companions(path))
    try:
        if packed:
            with _room(path, scratch):
                _unpack(path, scratch)
        copied = _copied(scratch if packed else path, path, scratch)
        file = scratch if packed or copied else path
        with closing(_connect(file, max_value_bytes, writable=copied)) as db:
            size = sum(part.stat().st_size for part in (file, *_companions(file)))
            yield SqliteFile(db, size, unclosed)
    finally:
        for ending in ("", WRITE_AHEAD, JOURNAL, SHARED):
            scratch.with_name(scratch.name + ending).unlink(missing_ok=True)


def _companions(path: Path) -> list[Path]:
    """What a writer leaves beside a file that it did not close: changes to be made, or to be taken back."""
    beside = (path.with_name(path.name + ending) for ending in (WRITE_AHEAD, JOURNAL))
    return [part for part in beside if part.is_file() and part.stat().st_size]


def _copied(file: Path, path: Path, scratch: Path) -> bool:
    """Copy `file` to `scratch` if it must be mended; whether it was.

    The rest of a cut page is cut off: sqlite would read it as zeros. Changes are not made in a file that lacks pages.
    """
    page_bytes, stated_pages = _stated(file)
    pages, rest = divmod(file.stat().st_size, page_bytes)
    beside = [] if pages < stated_pages else _companions(path)
    if not rest and not beside:
        return False
    with _room(path, scratch):
        if file != scratch:
            shutil.copyfile(file, scratch)
        if rest:
            os.truncate(scratch, pages * page_bytes)
        for part in beside:
            copy = scratch.with_name(scratch.name + part.name.removeprefix(path.name))
            shutil.copyfile(part, copy)
            if copy.name.endswith(JOURNAL):
                _without_super_journal(copy)
    return True


def _without_super_journal(journal: Path) -> None:
    """Hide the end of a journal: it may name another file, which sqlite deletes when it is done."""
    with journal.open("ab") as stream:
        stream.write(bytes(16))


def _stated(file: Path) -> tuple[int, int]:
    """(bytes of a page, number of pages) by the header; (1, 0) when it is none."""
    with file.open("rb") as stream:
        header = stream.read(32)
    if len(header) < 32:
        return 1, 0
    size, pages = struct.unpack(">H", header[16:18])[0], struct.unpack(">I", header[28:32])[0]
    size = _MAX_PAGE_BYTES if size == 1 else size
    return (size, pages) if size >= 512 and size.bit_count() == 1 else (1, 0)


def _connect(file: Path, max_value_bytes: int, *, writable: bool) -> sqlite3.Connection:
    try:
        how = "mode=rw" if writable else "mode=ro&immutable=1"
        db = sqlite3.connect(f"file:{quote(os.path.abspath(file))}?{how}", uri=True)
    except sqlite3.Error as err:
        raise ConversionError(f"The bag {file} cannot be opened ({err}).") from err
    db.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, max_value_bytes)
    db.execute("PRAGMA trusted_schema = OFF")
    db.execute("PRAGMA writable_schema = ON")  # else sqlite refuses a file that has fewer pages than its header states
    db.text_factory = lambda data: data.decode(errors="replace")
    return db


@contextmanager
def _room(path: Path, scratch: Path) -> Iterator[None]:
    try:
        yield
    except OSError as err:
        raise OutputError(f"{path} cannot be copied to {scratch} ({err.strerror or err}); make room there.") from err


def _unpack(path: Path, scratch: Path) -> None:
    with path.open("rb") as packed, scratch.open("wb") as plain:
        _copy(path, packed, plain)


def _copy(path: Path, packed: BinaryIO, plain: BinaryIO) -> None:
    """Unpack as far as it goes: what a cut file still holds is a cut data base."""
    limit = MAX_UNPACKING * path.stat().st_size
    try:
        for piece in zstandard.ZstdDecompressor().read_to_iter(packed, read_size=_PIECE, write_size=_PIECE):
            if plain.tell() > limit:
                raise ConversionError(f"{path} unpacks to more than {MAX_UNPACKING} times its size: no bag does.")
            plain.write(piece)
    except zstandard.ZstdError as err:
        if not plain.tell():
            raise ConversionError(f"{path} cannot be decompressed ({err}); unpack it with zstd if you can.") from err
