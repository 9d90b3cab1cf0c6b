"""The sha256 of a log and the checksum of its current section, computed beside the reading on a thread of its own."""

import hashlib
import zlib
from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from types import TracebackType
from typing import Self

BATCH_BYTES = 1 << 18
MAX_PENDING = 4
MAX_PENDING_BYTES = 1 << 25


class Fingerprint:
    """sha256 over all bytes fed; CRC-32 over the bytes since the last restart. Context manager."""

    def __init__(self) -> None:
        self._sha = hashlib.sha256()
        self._crc = 0
        self._batch = bytearray()
        self._worker = ThreadPoolExecutor(1, "stsem-sha256")
        self._pending: deque[tuple[int, Future[None]]] = deque()
        self._pending_bytes = 0
        self.bytes_fed = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self._worker.shutdown(wait=True, cancel_futures=True)

    def feed(self, data: bytes) -> None:
        """Add `data`."""
        self.bytes_fed += len(data)
        if len(data) < BATCH_BYTES:
            self._batch += data
            if len(self._batch) >= BATCH_BYTES:
                self._flush()
        else:
            self._flush()
            self._submit(data)

    def crc(self) -> int:
        """CRC-32 of the section so far."""
        self._settle()
        return self._crc

    def restart_section(self) -> None:
        """Begin a new section behind what was fed."""
        self._settle()
        self._crc = 0

    def restart(self, data: bytes) -> None:
        """Begin a new file whose first bytes are `data`."""
        self.restart_section()
        self.feed(data)

    def hexdigest(self) -> str:
        """sha256 of everything fed, in hexadecimal."""
        self._settle()
        return self._sha.hexdigest()

    def _flush(self) -> None:
        if self._batch:
            self._submit(bytes(self._batch))
            self._batch.clear()

    def _submit(self, data: bytes) -> None:
        self._pending.append((len(data), self._worker.submit(self._update, data)))
        self._pending_bytes += len(data)
        while len(self._pending) > MAX_PENDING or self._pending_bytes > MAX_PENDING_BYTES:
            self._wait_for_oldest()

    def _settle(self) -> None:
        self._flush()
        while self._pending:
            self._wait_for_oldest()

    def _wait_for_oldest(self) -> None:
        size, done = self._pending.popleft()
        done.result()
        self._pending_bytes -= size

    def _update(self, data: bytes) -> None:
        self._sha.update(data)
        self._crc = zlib.crc32(data, self._crc)
