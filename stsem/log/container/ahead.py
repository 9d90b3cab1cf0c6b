"""Chunks on their way: opened ahead on a thread, handed on in file order with the message indexes that follow them."""

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field

from stsem.log.container.chunk import MAX_CHUNK_BYTES, BrokenChunkError, Chunk, decompress, parse_chunk

CHUNKS_AHEAD = 3
MAX_AHEAD_BYTES = 1 << 28
MAX_INDEX_BYTES = 1 << 26


@dataclass
class Pending:
    """A chunk, or a place where one may have been lost, and the message indexes that follow it in the file.

    Args:
        place: bytes from the front of the log.
        chunk: None when it cannot be used.
        records: its content, when that is done.
        error: why it cannot be used; None for a gap.
        indexes: bodies of the records; those beyond MAX_INDEX_BYTES are left out.
    """

    place: int
    chunk: Chunk | None = None
    records: Future[bytes] | None = None
    error: BrokenChunkError | None = None
    indexes: list[bytes] = field(default_factory=list)
    index_bytes: int = 0


class ChunksAhead:
    """A queue of few chunks: those that wait are announced to hold MAX_AHEAD_BYTES together, or are a single one.

    Args:
        worker: opens them.
        take: called with each, in file order, once nothing can follow that belongs to it.
    """

    def __init__(self, worker: ThreadPoolExecutor, take: Callable[[Pending], None]) -> None:
        self._worker, self._take = worker, take
        self._waiting: deque[Pending] = deque()
        self._bytes = 0

    def chunk(self, place: int, body: bytes) -> None:
        """A chunk, by the body of its record."""
        try:
            chunk, data = parse_chunk(body)
            if chunk.uncompressed_size > MAX_CHUNK_BYTES:
                raise BrokenChunkError("chunk_unreadable", f"it would hold {chunk.uncompressed_size} bytes")
        except BrokenChunkError as err:
            self._append(Pending(place, error=err))
            return
        while self._waiting and self._bytes + chunk.uncompressed_size > MAX_AHEAD_BYTES:
            self._take_oldest()
        self._bytes += chunk.uncompressed_size
        self._append(Pending(place, chunk, self._worker.submit(decompress, chunk, data, check=True)))

    def gap(self, place: int) -> None:
        """A place that is no record: indexes behind it are those of a chunk that was lost."""
        self._append(Pending(place))

    @property
    def waiting(self) -> bool:
        """Whether an index here belongs to a chunk or a gap."""
        return bool(self._waiting)

    def index(self, body: bytes) -> None:
        """A message index, behind a chunk or a gap."""
        last = self._waiting[-1]
        last.index_bytes += len(body)
        if last.index_bytes <= MAX_INDEX_BYTES:
            last.indexes.append(body)

    def drain(self) -> None:
        """Hand on all."""
        while self._waiting:
            self._take_oldest()

    def _append(self, pending: Pending) -> None:
        self._waiting.append(pending)
        while len(self._waiting) > CHUNKS_AHEAD:
            self._take_oldest()

    def _take_oldest(self) -> None:
        pending = self._waiting.popleft()
        self._bytes -= pending.chunk.uncompressed_size if pending.chunk else 0
        self._take(pending)
