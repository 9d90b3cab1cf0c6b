"""Where the bytes of a log come from: a file of this machine, or an address; either is read through `Source`."""

import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Protocol
from urllib.parse import unquote, urlsplit

from stsem.errors import LogError

_URL = re.compile(r"([A-Za-z][\w+.-]*::)*[A-Za-z][\w+.-]*://")
_LINKS = re.compile(r"::(?=[A-Za-z][\w+.-]*:(?:/|:[A-Za-z]))")
"""Between the addresses of a chain (simplecache::s3://...), and not within that of a host ([::1])."""


class Source(Protocol):
    """Bytes that can be opened more than once; `str()` is what people are shown, without credentials."""

    @property
    def name(self) -> str:
        """The last part of its path."""

    @property
    def size(self) -> int:
        """Bytes, when it was found."""

    def open(self) -> BinaryIO:
        """A seekable stream from the front.

        Raises:
            LogError: it cannot be read, or is no longer what it was when it was found.
        """


@dataclass(frozen=True)
class LocalFile:
    """A file of this machine; made by `local_file`."""

    path: Path
    size: int
    modified_ns: int

    @property
    def name(self) -> str:
        """The last part of its path."""
        return self.path.name

    def __str__(self) -> str:
        return str(self.path)

    def open(self) -> BinaryIO:
        """The file; LogError when that cannot be, or when it changed since it was found."""
        try:
            stream = self.path.open("rb")
        except OSError as err:
            raise unreadable(self.path, err) from err
        status = os.fstat(stream.fileno())
        if (status.st_size, status.st_mtime_ns) != (self.size, self.modified_ns):
            stream.close()
            raise changed(self)
        return stream


def local_file(path: Path) -> LocalFile:
    """The file at `path`.

    Raises:
        LogError: there is none, or it is not a file.
    """
    try:
        status = path.stat()
    except (OSError, ValueError) as err:
        raise unreadable(path, err) from err
    if not path.is_file():
        raise LogError(f"{path} is not a file; give the path of an MCAP recording.")
    return LocalFile(path, status.st_size, status.st_mtime_ns)


def unreadable(path: Path, err: Exception) -> LogError:
    """The sentence for a path that the system refuses."""
    if isinstance(err, FileNotFoundError | NotADirectoryError):
        if path.is_symlink():
            return LogError(f"{path} is a link to nothing; fetch what it stands for, or take it away.")
        return LogError(f"There is no file {path}; give the path of an MCAP recording.")
    reason = getattr(err, "strerror", None) or str(err)
    return LogError(f"{path} cannot be read ({reason}); give a readable MCAP recording.")


def changed(source: object) -> LogError:
    """The sentence for a log that is not at rest."""
    return LogError(f"{source} changed while it was being read; run again on a file at rest.")


def is_url(text: Path | str) -> bool:
    """Whether `text` is an address such as `https://...` or `s3://...`; a `Path` never is, nor is a `file://` one."""
    return isinstance(text, str) and bool(_URL.match(text)) and not text.lower().startswith("file://")


def local_path(given: Path | str) -> Path:
    """The path that `given` means: itself, or that of a `file://` address."""
    if isinstance(given, str) and given.lower().startswith("file://"):
        return Path(unquote(urlsplit(given).path))
    return Path(given)


def shown_name(given: Path | str) -> str:
    """The last part of the path that `given` means, for people: unquoted, without query."""
    if not is_url(given):
        return local_path(given).name
    bare = next(part for part in _LINKS.split(without_secrets(str(given))) if "://" in part)
    last = bare.partition("://")[2].rstrip("/").rpartition("/")[2]
    return unquote(last) if bare.lower().startswith("http") else last


def without_secrets(text: str) -> str:
    """`text` without `user:password@`, query and fragment if it is an address; other texts as they are."""
    return "::".join(map(_bare, _LINKS.split(text))) if is_url(text) else text


def _bare(address: str) -> str:
    scheme, mark, rest = address.partition("://")
    host, slash, path = re.split(r"[?#]", rest, maxsplit=1)[0].partition("/")
    host = host.rpartition("@")[2]
    if not host.startswith("["):  # an address of numbers
        host = re.sub(r":(?!\d+$).*", "", host)
    return f"{scheme}{mark}{host}{slash}{path}"
