"""The files of a log."""

import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from stsem.errors import LogError
from stsem.log.container.source import Source, is_url, local_file, local_path, unreadable
from stsem.log.remark import Remark
from stsem.plain import plain

Given = Path | str
"""A path, or as a string also an address such as `https://host/run.mcap`."""

METADATA = "metadata.yaml"
MAX_METADATA_BYTES = 1 << 20
MAX_LISTED = 10_000
_LIST = re.compile(
    r"^ *relative_file_paths:[ \t]*(?:\[(?P<flow>[^\]]*)\]|\r?\n(?P<block>(?: *- [^\n]*(?:\n|\Z))*))", re.MULTILINE
)
_ITEM = re.compile(r"^ *- ([^\r\n]*)", re.MULTILINE)
_UNFINISHED = (".mcap.active", ".mcap.tmp", ".mcap.part")
_PACKED = (".mcap.zst", ".mcap.zstd", ".mcap.lz4", ".mcap.gz")


@dataclass(frozen=True)
class File:
    """A file of a log: where its bytes come from, and the place of its first byte in the log."""

    source: Source
    base: int

    @property
    def size(self) -> int:
        """Its bytes."""
        return self.source.size


def find_files(paths: Sequence[Given]) -> tuple[File, ...]:
    """The .mcap files that `paths` mean, in natural order of their names: files as they are, folders by what they hold.

    The natural order is also the one that a ROS 2 recorder's metadata.yaml states.

    Raises:
        LogError: nothing was given, a path does not exist, or a folder holds no recording.
        MissingExtraError: for an address, when fsspec is not installed.
    """
    if not paths:
        raise LogError("No log was given; give the path of an MCAP recording.")
    unique = {_identity(given, source): source for given in paths for source in _sources(given)}
    files: list[File] = []
    for source in sorted(unique.values(), key=lambda s: (natural(s.name), str(s))):
        files.append(File(source, files[-1].base + files[-1].size if files else 0))
    return tuple(files)


def left_out(paths: Iterable[Given]) -> list[str]:
    """A sentence for each file of a folder that looks like a part of the recording, but is not read."""
    folders = [path for given in paths if not is_url(given) and (path := local_path(given)).is_dir()]
    return [
        Remark(
            "file-unfinished",
            f"{path.name} was left unfinished by a recorder or a copy and is not read; "
            "give it by name if it belongs here.",
        )
        for folder in folders
        for path in sorted(folder.iterdir())
        if path.name.lower().endswith(_UNFINISHED)
    ]


def missing_files(paths: Iterable[Given]) -> list[str]:
    """Names of .mcap files that a ROS 2 recorder's metadata.yaml lists and that its folder does not hold.

    Where the folder holds none of those that are listed they were renamed, and the list says nothing.
    """
    folders = [path for given in paths if not is_url(given) and (path := local_path(given)).is_dir()]
    return [name for folder in folders for name in _missing(folder)]


def _missing(folder: Path) -> Sequence[str]:
    path = folder / METADATA
    try:
        if not path.is_file():
            return ()
        with path.open("rb") as stream:
            text = stream.read(MAX_METADATA_BYTES).decode("utf-8", "replace")
        there = {inside.name for inside in folder.iterdir()}
    except OSError:
        return ()
    listed = [name for name in listed_files(text) if name.lower().endswith(".mcap")]
    return [plain(name) for name in listed if name not in there] if there.intersection(listed) else ()


def listed_files(text: str) -> tuple[str, ...]:
    """The names under `relative_file_paths` of a metadata.yaml, packed ones by the name of what is in them.

    Only this list is looked for, in either way that YAML writes lists; other things, and other texts, give none.
    """
    found = _LIST.search(text)
    if found is None:
        return ()
    items = found["flow"].split(",") if found["flow"] is not None else _ITEM.findall(found["block"])
    names = (item.strip().strip("'\"").rpartition("/")[2] for item in items[:MAX_LISTED])
    return tuple(dict.fromkeys(re.sub(r"\.zstd?$", "", name) for name in names if name))


def natural(name: str) -> tuple[tuple[tuple[bool, int, str], ...], str]:
    """Sort key under which frame 9 comes before frame 10, however many zeros they have; numbers before words."""
    parts = re.findall(r"\d{1,18}|\D+", name)  # int() refuses numbers of thousands of digits
    return tuple((False, int(p), "") if p.isdecimal() else (True, 0, p) for p in parts), name


def _identity(given: Given, source: Source) -> tuple[str, str]:
    """What tells files apart: links to one file are one; of addresses also what is not shown, as a query may choose."""
    return (str(given), str(source)) if is_url(given) else ("", os.path.realpath(str(source)))


def _sources(given: Given) -> Sequence[Source]:
    if is_url(given):
        from stsem.log.container.remote import remote_files

        return remote_files(str(given))
    path = local_path(given)
    try:
        inside = sorted(path.iterdir()) if path.is_dir() else None
    except (OSError, ValueError) as err:
        raise unreadable(path, err) from err
    return [local_file(path)] if inside is None else _of_folder(path, inside)


def _of_folder(folder: Path, inside: Sequence[Path]) -> Sequence[Source]:
    found = [p for p in inside if p.suffix.lower() == ".mcap" and not p.name.startswith("._") and not p.is_dir()]
    if found:
        return [local_file(path) for path in found]
    odd = [p.name for p in inside if p.name.lower().endswith((*_UNFINISHED, *_PACKED))]
    below = [p.name for p in inside if p.is_dir() and _holds_mcap(p)]
    if odd:
        raise LogError(
            f"The folder {folder} holds no .mcap file, but {odd[0]}; give an unfinished recording by its own path, "
            "and unpack a packed one first."
        )
    if below:
        names = ", ".join(below[:5]) + (", ..." if len(below) > 5 else "")
        raise LogError(f"The folder {folder} holds no .mcap file itself; give one of the recordings in it: {names}.")
    raise LogError(f"The folder {folder} holds no .mcap file; give a recording or a folder with one.")


def _holds_mcap(folder: Path) -> bool:
    try:
        return any(path.suffix.lower() == ".mcap" for path in folder.iterdir())
    except OSError:
        return False
