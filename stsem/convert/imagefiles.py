"""Image files in folders: listed in natural order, read one by one, and nothing outside the source is opened."""

import os
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from itertools import islice
from pathlib import Path
from typing import Any

import numpy.typing as npt

from stsem.classes import Labels
from stsem.convert.recording import ColorEvent, DepthEvent, Event, Loss, Options, PoseEvent, TruthEvent
from stsem.convert.truth import Truth
from stsem.errors import ConversionError
from stsem.frame import Depth
from stsem.log.container.files import natural
from stsem.log.pixels import decode, formats
from stsem.log.schemas.messages import CompressedImage
from stsem.pose import Pose

IMAGE_FORMATS = (formats.JPEG, formats.PNG, formats.WEBP)
IMAGE_SUFFIXES = (".png", ".jpg", ".jpeg", ".webp")
MAX_FILE_BYTES = 256 << 20
MAX_TEXT_BYTES = 16 << 20
_LISTED = 8
_LOOKED_AT = 500
_Kind = tuple[str, Callable[["Capture"], Path | None], Callable[[int, bytes], Event]]


@dataclass(frozen=True, eq=False)
class Capture:
    """What belongs to one stamp: a colour image, the files that lie beside it, its pose T_WC (4, 4); any may lack."""

    stamp_ns: int
    color: Path | None = None
    truth: Path | None = None
    depth: Path | None = None
    T_WC: Pose | None = None


def first_folders(root: Path, depth: int) -> Iterator[Path]:
    """The first of `walk`, enough to tell what a data set is, few enough for a folder that is none."""
    return islice(walk(root, depth), _LOOKED_AT)


def walk(root: Path, depth: int) -> Iterator[Path]:
    """Folders under `root`, itself included, at most `depth` levels down, in natural order; links are not followed."""
    yield root
    if depth > 0:
        try:
            below = sorted((e.name for e in os.scandir(root) if e.is_dir(follow_symlinks=False)), key=natural)
        except OSError:
            return
        for name in below:
            yield from walk(root / name, depth - 1)


def files(folder: Path, suffixes: Collection[str] = IMAGE_SUFFIXES) -> list[Path]:
    """Files of a folder with one of the `suffixes`, in natural order; empty when it cannot be listed."""
    try:
        names = [e.name for e in os.scandir(folder) if e.name.lower().endswith(tuple(suffixes)) and _is_file(e)]
    except OSError:
        return []
    return [folder / name for name in sorted(names, key=natural) if not name.startswith(".")]


def _is_file(entry: os.DirEntry[str]) -> bool:
    """Whether it may be opened: a file, or a link that leads nowhere, which is a loss later on."""
    try:
        return entry.is_file() or (entry.is_symlink() and not entry.is_dir())
    except OSError:
        return True


def read_bytes(path: Path, root: Path, limit: int = MAX_FILE_BYTES) -> bytes:
    """All bytes of a file.

    Raises:
        ValueError: it is outside `root`, larger than `limit`, no file, or cannot be read.
    """
    try:
        if not path.resolve(strict=True).is_relative_to(root.resolve(strict=True)):
            raise ValueError("it is a link that leads out of the source")
        if not path.is_file():
            raise ValueError("it is no file")
        with path.open("rb") as stream:
            data = stream.read(limit + 1)
    except OSError as err:
        raise ValueError(f"it cannot be read ({err.strerror or err})") from err
    except RuntimeError as err:  # what Python before 3.13 makes of a circle of links
        raise ValueError("it is a link to itself") from err
    if len(data) > limit:
        raise ValueError(f"it is larger than {limit >> 20} MiB")
    return data


def read_text(path: Path, root: Path, errors: str = "strict") -> str:
    """A text file that a data set cannot be read without; `errors` says what becomes of bytes that are no UTF-8.

    Raises:
        ConversionError: it cannot be read, or is no text.
    """
    try:
        return read_bytes(path, root, MAX_TEXT_BYTES).decode("utf-8-sig", errors)
    except ValueError as err:
        raise ConversionError(f"{path} cannot be read as text: {err}; mend or remove the file.") from err


def samples(data: bytes) -> npt.NDArray[Any]:
    """What a png holds: (H, W) uint8 or uint16, or (H, W, 3) uint8 RGB.

    Raises:
        ValueError: it is no png, or a broken one.
    """
    return decode.labels(_message(data))


def truth_labels(truth: Truth, data: bytes) -> Labels:
    """(H, W) uint8 labels of a label image; ValueError when it cannot be read."""
    return truth.labels(decode.labels(_message(data), truth.colour_of))


def image_file(data: bytes) -> bytes:
    """The bytes of an image file as they came; ValueError when they do not begin like one that a log may hold."""
    if formats.file_format(_message(data)) not in IMAGE_FORMATS:
        raise ValueError("it is no jpeg, png or webp")
    return data


def _message(data: bytes) -> CompressedImage:
    return CompressedImage(None, "", "", memoryview(data))


def image_size(captures: Iterable[Capture], root: Path) -> tuple[int, int] | None:
    """(width, height) of the first colour image that can be decoded; None when none can."""
    for path in (capture.color for capture in captures if capture.color is not None):
        try:
            data = read_bytes(path, root)
            height, width = decode.colour(_message(data)).shape[:2]
        except ValueError:
            continue
        return width, height
    return None


def chosen(names: Collection[str], options: Options, source: Path) -> str:
    """The sequence to convert: the one that was asked for, else the only one.

    Raises:
        ConversionError: there is no such sequence, or no clear choice.
    """
    known = sorted(names, key=natural)
    if options.sequence is None and len(known) == 1:
        return known[0]
    if options.sequence in known:
        return options.sequence
    some = ", ".join(known[:_LISTED]) + (f" and {len(known) - _LISTED} more" if len(known) > _LISTED else "")
    if options.sequence is None:
        raise ConversionError(
            f"{source} holds {len(known)} sequences ({some}), and a log is one of them; choose with --sequence NAME."
        )
    near = get_close_matches(options.sequence, known, 1)
    meant = f" (did you mean {near[0]}?)" if near else ""
    raise ConversionError(f"{source} has no sequence {options.sequence!r}{meant}; it has {some}.")


def events(
    captures: Iterable[Capture],
    root: Path,
    notes: list[str],
    *,
    truth: Truth | None = None,
    depth: Callable[[npt.NDArray[Any]], Depth] | None = None,
) -> Iterator[Event]:
    """The events of all captures, one file in memory at a time; what cannot be read is a Loss.

    Args:
        captures: in ascending order of stamps.
        root: the source.
        notes: gets a sentence on the first file of each kind that is lost.
        truth: what becomes of label images; None leaves them out.
        depth: from the samples of a png to metres; None leaves it out.
    """
    kinds: list[_Kind] = [("colour images", lambda c: c.color, lambda stamp, data: ColorEvent(stamp, image_file(data)))]
    if depth is not None:
        kinds.append(("depth images", lambda c: c.depth, lambda stamp, data: DepthEvent(stamp, depth(samples(data)))))
    if truth is not None:
        kinds.append(
            ("label images", lambda c: c.truth, lambda stamp, data: TruthEvent(stamp, truth_labels(truth, data)))
        )
    return _events(captures, root, notes, kinds)


def _events(captures: Iterable[Capture], root: Path, notes: list[str], kinds: Sequence[_Kind]) -> Iterator[Event]:
    complained: set[str] = set()
    for capture in captures:
        stamp_ns = capture.stamp_ns
        if capture.T_WC is not None:
            yield PoseEvent(stamp_ns, capture.T_WC)
        for kind, find, make in kinds:
            if (path := find(capture)) is None:
                continue
            try:
                event = make(stamp_ns, read_bytes(path, root))
            except ValueError as err:
                event = Loss(f"{kind} that cannot be read", stamp_ns)
                if kind not in complained:
                    complained.add(kind)
                    notes.append(f"The first of the {event.what} is {path.name}: {err}.")
            yield event


def count(captures: Iterable[Capture]) -> int:
    """How many events the captures give."""
    return sum(part is not None for c in captures for part in (c.color, c.truth, c.depth, c.T_WC))
