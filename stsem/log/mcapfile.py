"""An MCAP file in the making: written beside its place, renamed when complete, and whole or not there at all."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import IO, Self

from mcap.writer import CompressionType, Writer

from stsem.aside import aside
from stsem.errors import OutputError

_CHUNK_BYTES = 2 << 20


class McapFile:
    """Channels and messages, in zstd chunks with checksums; equal input gives equal bytes.

    With an exception inside the `with` block nothing is left behind.

    Args:
        path: the file.
        profile: of the MCAP header: `ros1`, `ros2` or nothing.

    Attributes:
        counts: topic -> messages written.
        last_ns: largest log time so far, 0 before the first message.

    Raises:
        OutputError: the file cannot be written; a place that cannot be is found out at once.
    """

    def __init__(self, path: Path, profile: str = "") -> None:
        if path.is_dir():
            raise OutputError(f"The log {path} cannot be written: it is a folder; give the name of a file in it.")
        self._path, self._aside = path, aside(path)
        self.counts: dict[str, int] = {}
        self.last_ns = 0
        self._topics: dict[int, str] = {}
        self._stream: IO[bytes] = self._open()
        self._writer = Writer(
            self._stream, chunk_size=_CHUNK_BYTES, compression=CompressionType.ZSTD, enable_data_crcs=True
        )
        with self._whole_or_nothing():
            self._writer.start(profile, "stsem")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        if kind is not None:
            self.discard()
            return
        with self._whole_or_nothing():
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._stream.close()
            self._aside.replace(self._path)

    def schema(self, name: str, encoding: str, text: bytes) -> int:
        """Id of a new schema."""
        with self._whole_or_nothing():
            return int(self._writer.register_schema(name, encoding, text))

    def channel(self, topic: str, schema: int, encoding: str, metadata: Mapping[str, str] | None = None) -> int:
        """Id of a new channel."""
        with self._whole_or_nothing():
            channel = self._writer.register_channel(topic, encoding, schema, dict(metadata or {}))
        self._topics[channel] = topic
        self.counts.setdefault(topic, 0)
        return channel

    def message(self, channel: int, log_ns: int, publish_ns: int, data: bytes, sequence: int) -> None:
        """One message."""
        with self._whole_or_nothing():
            self._writer.add_message(channel, log_ns, data, publish_ns, sequence)
        self.counts[self._topics[channel]] += 1
        self.last_ns = max(self.last_ns, log_ns)

    def metadata(self, name: str, record: Mapping[str, str]) -> None:
        """A metadata record."""
        with self._whole_or_nothing():
            self._writer.add_metadata(name, dict(record))

    def attachment(self, name: str, media_type: str, data: bytes) -> None:
        """An attachment, at the largest log time so far."""
        with self._whole_or_nothing():
            self._writer.add_attachment(0, self.last_ns, name, media_type, data)

    def discard(self) -> None:
        """Give up; closing flushes, which fails once more on a full disk."""
        with suppress(OSError):
            self._stream.close()
        self._aside.unlink(missing_ok=True)

    def _open(self) -> IO[bytes]:
        try:
            return self._aside.open("wb")
        except OSError as err:
            raise self._unwritable(err) from err

    @contextmanager
    def _whole_or_nothing(self) -> Iterator[None]:
        try:
            yield
        except OSError as err:
            self.discard()
            raise self._unwritable(err) from err
        except BaseException:
            self.discard()
            raise

    def _unwritable(self, err: OSError) -> OutputError:
        return OutputError(f"The log {self._path} cannot be written: {err.strerror or err}; choose another place.")
