"""Random access to the payloads of a log's messages."""

import threading
from bisect import bisect_right
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import BinaryIO, Self

from stsem.errors import LogError
from stsem.log.container.chunk import BrokenChunkError, Chunk, decompress
from stsem.log.container.files import File
from stsem.log.container.source import changed

CACHE_BYTES = 96 << 20


class Store:
    """Payloads by reference, from a bounded cache of decompressed chunks; safe from several threads.

    Going through a log in order decompresses each chunk once, and a channel that is logged late costs no more than a
    chunk of its own in the cache.

    Args:
        files: of the log.
        chunks: place in the log -> chunk; a place that is not among them is that of a message in no chunk.
        opened: content of chunks that are decompressed already.
        cache_bytes: the most that decompressed chunks may take (the newest chunk is always kept).
    """

    def __init__(
        self, files: Sequence[File], chunks: Mapping[int, Chunk], opened: Mapping[int, bytes] | None = None,
        cache_bytes: int = CACHE_BYTES,
    ) -> None:  # fmt: skip
        self._files, self._chunks, self._limit = files, chunks, cache_bytes
        self._bases = [file.base for file in files]
        self._handles: dict[int, BinaryIO] = {}
        self._cache: OrderedDict[int, bytes] = OrderedDict(opened or {})
        self._held = sum(map(len, self._cache.values()))
        self._closed = False
        self._lock = threading.Lock()
        self.decompressed = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Close the files and forget the cache; nothing can be read afterwards."""
        with self._lock:
            self._closed = True
            for handle in self._handles.values():
                handle.close()
            self._handles.clear()
            self._cache.clear()
            self._held = 0

    @property
    def held_bytes(self) -> int:
        """Bytes of decompressed chunks in the cache."""
        return self._held

    def payload(self, place: int, offset: int, length: int) -> memoryview:
        """The payload of one message, as a view that keeps its chunk alive.

        Raises:
            LogError: the file is no longer what it was when it was scanned.
        """
        with self._lock:
            chunk = self._chunks.get(place)
            if chunk is None:
                return memoryview(self._read(place, offset - place, length))
            records = self._cache.get(place)
            if records is None:
                records = self._load(place, chunk)
            self._cache.move_to_end(place)
        return memoryview(records)[offset : offset + length]

    def _load(self, place: int, chunk: Chunk) -> bytes:
        data = self._read(place, chunk.start, chunk.length)
        try:
            records = decompress(chunk, data, check=False)
        except BrokenChunkError as err:
            raise self._changed(place) from err
        self.decompressed += 1
        while self._cache and self._held + len(records) > self._limit:
            _, oldest = self._cache.popitem(last=False)
            self._held -= len(oldest)
        self._cache[place] = records
        self._held += len(records)
        return records

    def _read(self, place: int, behind: int, length: int) -> bytes:
        """`length` bytes of the log from `behind` bytes after `place`."""
        file = self._file(place)
        if self._closed:
            raise LogError(f"{file.source} was closed; open the log again to read from it.")
        handle = self._handles.get(file.base)
        if handle is None:
            handle = self._handles[file.base] = file.source.open()
        handle.seek(place - file.base + behind)
        data = handle.read(length)
        if len(data) != length:
            raise self._changed(place)
        return data

    def _file(self, place: int) -> File:
        return self._files[bisect_right(self._bases, place) - 1]

    def _changed(self, place: int) -> LogError:
        return changed(self._file(place).source)
