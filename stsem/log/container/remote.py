"""Logs at an address, through fsspec (extra `remote`): few, large requests, and one sentence for what goes wrong."""

import io
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any, BinaryIO, TypeVar, cast

from stsem.errors import LogError, MissingExtraError, StsemError
from stsem.log.container.source import changed, shown_name, without_secrets

T = TypeVar("T")

BLOCK_BYTES = 8 << 20
BLOCKS_KEPT = 6
IN_A_ROW = 2
"""Steps from block to next block after which the one behind is fetched ahead: a look here and there is no run."""
ATTEMPTS = 3
MAX_LISTED = 10_000
VERSIONS = ("ETag", "etag", "LastModified", "Last-Modified", "mtime", "created")
_WEB = ("http", "https")
_EXTRAS = {"s3": "s3", "s3a": "s3"}
_NO_RANGES = "its server does not send parts of files; download it and give the file"


@dataclass(frozen=True)
class RemoteFile:
    """A file at an address; made by `remote_files`.

    Args:
        shown: the address without credentials.
        size: bytes.
        version: what changes with the content: ETag or the time of the last change; None if the server tells none.
    """

    shown: str
    size: int
    version: str | None
    _system: Any = field(repr=False, compare=False)
    _path: str = field(repr=False, compare=False)

    @property
    def name(self) -> str:
        """The last part of its path."""
        return shown_name(self.shown)

    def __str__(self) -> str:
        return self.shown

    def open(self) -> BinaryIO:
        """A stream in blocks; LogError when it cannot be read, or when it changed since it was found."""
        self._system.invalidate_cache()
        info = _asked(self.shown, lambda: self._system.info(self._path))
        if (info.get("size"), _version(info)) != (self.size, self.version):
            raise changed(self)
        raw = _asked(self.shown, lambda: self._system.open(self._path, "rb", block_size=BLOCK_BYTES, cache_type="none"))
        return cast(BinaryIO, BlockStream(raw, self.size, self.shown))


class BlockStream(io.BufferedIOBase):
    """A stream that asks its source for aligned blocks only, keeps a few, and fetches the next one ahead.

    Args:
        raw: seekable; used by one thread at a time.
        size: bytes in all.
        shown: what people know it as.
    """

    def __init__(self, raw: BinaryIO, size: int, shown: str) -> None:
        self._raw, self._size, self._shown = raw, size, shown
        self._blocks: OrderedDict[int, Future[bytes]] = OrderedDict()
        self._worker = ThreadPoolExecutor(1, "stsem-remote")
        self._place, self._last, self._in_a_row = 0, -1, 0

    def readable(self) -> bool:
        """True."""
        return True

    def seekable(self) -> bool:
        """True."""
        return True

    def tell(self) -> int:
        """Bytes from the front."""
        return self._place

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Move; returns the new place."""
        self._place = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self._place, io.SEEK_END: self._size}[whence]
        return self._place

    def read(self, size: int | None = -1) -> bytes:
        """The next `size` bytes, fewer only at the end.

        Raises:
            LogError: they cannot be had.
        """
        end = self._size if size is None or size < 0 else min(self._size, self._place + size)
        parts = []
        while self._place < end:
            number, at = divmod(self._place, BLOCK_BYTES)
            part = self._block(number)[at : at + end - self._place]
            parts.append(part)
            self._place += len(part)
        return parts[0] if len(parts) == 1 else b"".join(parts)

    def close(self) -> None:
        """Close the source; a request on its way is waited for."""
        if not self.closed:
            self._worker.shutdown(wait=True, cancel_futures=True)
            self._blocks.clear()
            self._raw.close()
        super().close()

    def _block(self, number: int) -> bytes:
        found = self._ask(number)
        if number != self._last:
            self._in_a_row = self._in_a_row + 1 if number == self._last + 1 else 0
            self._last = number
            if self._in_a_row >= IN_A_ROW and (number + 1) * BLOCK_BYTES < self._size:
                self._ask(number + 1)
        while len(self._blocks) > BLOCKS_KEPT:
            self._blocks.popitem(last=False)
        return found.result()

    def _ask(self, number: int) -> Future[bytes]:
        found = self._blocks.get(number)
        if found is None:
            found = self._blocks[number] = self._worker.submit(self._fetch, number)
        self._blocks.move_to_end(number)
        return found

    def _fetch(self, number: int) -> bytes:
        start = number * BLOCK_BYTES
        wanted = min(BLOCK_BYTES, self._size - start)

        def fetch() -> bytes:
            self._raw.seek(start)
            return self._raw.read(wanted)

        data = _asked(self._shown, fetch)
        if len(data) != wanted:
            raise LogError(
                f"{self._shown} ends after {start + len(data)} bytes, but its server said {self._size}; "
                "run again on a file at rest, or download it."
            )
        return data


def remote_files(url: str) -> list[RemoteFile]:
    """The .mcap files that an address means: one file, the files in a folder, or those that a pattern (*) fits.

    Raises:
        LogError: there are none, or they cannot be read; MissingExtraError: what reads such addresses is not installed.
    """
    shown = without_secrets(url)
    system, path = _system(url, shown)
    paths = _paths(system, path, shown)
    if paths is None:
        return [_file(system, path, shown)]
    found = sorted(p for p in paths if without_secrets(p).lower().endswith(".mcap"))
    if not found:
        raise LogError(f"{shown} holds no .mcap file that its server lists; give the address of a recording.")
    return [_file(system, p, _shown(system, p)) for p in found[:MAX_LISTED]]


def _system(url: str, shown: str) -> tuple[Any, str]:
    protocol = url.split("::")[0].partition("://")[0].lower()
    extra = _EXTRAS.get(protocol, "remote")
    try:
        import fsspec

        system, path = fsspec.core.url_to_fs(url, **_options(protocol, url))
    except ImportError as err:
        if protocol in (*_WEB, *_EXTRAS) or err.name == "fsspec":
            raise MissingExtraError(extra, f"Reading {protocol}:// addresses") from err
        raise LogError(f"{shown} cannot be read: {err}.") from err
    except ValueError as err:
        raise LogError(f"{shown} cannot be read: {protocol}:// is unknown; give a path, https:// or s3://.") from err
    except Exception as err:
        raise _refused(shown, err) from err
    return system, str(path)


def _options(protocol: str, url: str) -> dict[str, Any]:
    """An address with % in it is encoded already: to encode it again would spoil a signature in it."""
    if protocol not in _WEB:
        return {}
    import aiohttp

    timeout = aiohttp.ClientTimeout(total=None, sock_connect=30, sock_read=60)
    return {
        "encoded": "%" in url, "headers": {"Accept-Encoding": "identity"}, "client_kwargs": {"timeout": timeout},
    }  # fmt: skip


def _paths(system: Any, path: str, shown: str) -> list[str] | None:
    """What a folder or a pattern holds; None for a single file."""
    web = "http" in system.protocol
    if "*" in path and not web:
        return list(_asked(shown, lambda: system.glob(path)))
    folder = shown.endswith("/") if web else _asked(shown, lambda: system.isdir(path))
    return list(_asked(shown, lambda: system.ls(path, detail=False))) if folder else None


def _file(system: Any, path: str, shown: str) -> RemoteFile:
    info = _asked(shown, lambda: system.info(path))
    if info.get("size") is None:
        raise LogError(f"{shown} has no known size; download it and give the file.")
    if info.get("partial") is False and info["size"] > BLOCK_BYTES:
        raise LogError(f"{shown} cannot be read: {_NO_RANGES}.")
    return RemoteFile(shown, int(info["size"]), _version(info), system, path)


def _version(info: dict[str, Any]) -> str | None:
    return next((str(info[key]) for key in VERSIONS if info.get(key)), None)


def _shown(system: Any, path: str) -> str:
    return without_secrets(path if "://" in path else str(system.unstrip_protocol(path)))


def _asked(shown: str, ask: Callable[[], T]) -> T:
    """What `ask` returns; a lost connection is tried again."""
    for attempt in range(1, ATTEMPTS + 1):
        try:
            return ask()
        except StsemError:
            raise
        except Exception as err:
            if attempt == ATTEMPTS or not isinstance(err, ConnectionError | TimeoutError | EOFError):
                raise _refused(shown, err) from err
    raise AssertionError("the last attempt returned or raised")


def _refused(shown: str, err: Exception) -> LogError:
    """One sentence for an error of a stranger; its own text may hold the whole address and is left out."""
    status = getattr(err, "status", None) or getattr(err.__cause__, "status", None)
    if isinstance(err, PermissionError) or status in (401, 403):
        return LogError(f"{shown} may not be read: its server refuses access; check the address and the credentials.")
    if isinstance(err, FileNotFoundError) and (status in (404, 410) or err.__cause__ is None):
        return LogError(f"There is no file {shown}; check the address.")
    if isinstance(err, ValueError) and "range" in str(err):
        return LogError(f"{shown} cannot be read: {_NO_RANGES}.")
    if status:
        return LogError(f"{shown} cannot be read: its server answers with status {status}; try again later.")
    cause = type(err.__cause__ if isinstance(err, FileNotFoundError) and err.__cause__ else err).__name__
    return LogError(f"{shown} cannot be read ({cause}); check the address and the connection, or download it.")
