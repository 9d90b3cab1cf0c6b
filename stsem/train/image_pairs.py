"""Pairs of a folder of images and their label images.

    folder/images/*.png       colour (png, jpg, webp), in the natural order of their names; one folder deep each folder
                              is a sequence of its own: images/office/0001.png, images/lab/0001.png
    folder/labels/*.png       labels of equal stem: ids of 8 or 16 bits, or colours of the class table
    folder/depth/*.png        if there is any: depth of equal stem, 16 bits, millimetres, 0 unknown
    folder/classes.json       the class table, as for a log (.json or .toml), or .txt with a name a line

Images without labels are the predecessors of others. Where the size changes from one to the next, the labelled one
stands alone.
"""

import zlib
from collections.abc import Callable, Iterable
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from stsem.classes import NO_LABEL
from stsem.errors import TrainingError
from stsem.log.classtable import ClassTable, Translator
from stsem.log.container.files import natural
from stsem.log.pixels import decode
from stsem.log.pixels.exif import UPRIGHT, orientation
from stsem.log.pixels.formats import UNKNOWN, file_format
from stsem.log.schemas.messages import CompressedImage
from stsem.train.consecutive import consecutive
from stsem.train.dataset import Pair, fingerprint

IMAGES, LABELS, DEPTH = "images", "labels", "depth"
SUFFIXES = (".png", ".jpg", ".jpeg", ".webp")
_HEAD = 4096
"""Bytes of a JPEG that its EXIF tags are looked for in."""


class ImagePairs:
    """The pairs of a folder laid out as above; images are read when they are asked for.

    Args:
        folder: with `images` and `labels`.
        table: class table of the label images.
        depth: read it, too.

    Attributes:
        classes: of the table; labels have its ids.
        orphans: label images without a colour image.

    Raises:
        TrainingError: there is no labelled image, two images have one stem, or one is to be turned for viewing.
    """

    def __init__(self, folder: Path, table: ClassTable, *, depth: bool = True) -> None:
        self._folder, self._table, self.classes, self._with_depth = folder, table, table.classes, depth
        self._translate, self._colour_of = Translator(table), table.colour_of
        self._images, labels = _by_stem(folder / IMAGES), _by_stem(folder / LABELS)
        self._labels = {stem: path for stem, path in labels.items() if stem in self._images}
        self._depths = _by_stem(folder / DEPTH)
        self.orphans = len(labels) - len(self._labels)
        self._pairs = [pair for sequence in _sequences(self._images)
                       for pair in _stem_pairs(sequence, self._labels)]  # fmt: skip
        if not self._pairs:
            raise TrainingError(f"The folder {folder} has {len(self._images)} images (png, jpg, webp) in {IMAGES} and "
                                f"{len(labels)} label images (png) in {LABELS}, but none of equal name; lay it out as "
                                "docs/train.md says.")  # fmt: skip
        _refuse_turned(self._images.values())

    @cached_property
    def fingerprint(self) -> str:
        """Of the files' names and contents, and the class table; every file is read once, which takes a second per GB
        or what the disk takes. Their times tell less: copies have others.

        Raises:
            TrainingError: a file cannot be read.
        """
        files = (path for kind in (self._images, self._labels, self._depths) for path in kind.values())
        lines = [f"{path.relative_to(self._folder)} {_checksum(path)}" for path in files]
        return fingerprint([*lines, *self._table.meaning])

    def __len__(self) -> int:
        return len(self._pairs)

    def pair(self, index: int) -> Pair:
        """The pair at `index`. Raises TrainingError: a file cannot be read, has another size, or an unknown id."""
        stems = self._pairs[index]
        images = [_read(self._images[stem], decode.colour) for stem in stems]
        if images[0].shape != images[1].shape:
            alone = 1 if stems[1] in self._labels else 0
            stems, images = (stems[alone],) * 2, [images[alone]] * 2
        labels = [self._truth(stem, image) for stem, image in zip(stems, images, strict=True)]
        depths = None
        if self._depths and self._with_depth:
            depths = np.stack([self._depth(stem, image) for stem, image in zip(stems, images, strict=True)])
        return Pair(np.stack(images), np.stack(labels), depths)

    def _truth(self, stem: str, image: npt.NDArray[Any]) -> npt.NDArray[np.uint8]:
        path = self._labels.get(stem)
        if path is None:
            return np.full(image.shape[:2], NO_LABEL, np.uint8)
        labels, unknown = _read(path, lambda message: self._translate(decode.labels(message, self._colour_of)))
        if unknown:
            raise TrainingError(f"The label image {path} has {unknown} pixels with an id or colour that the class "
                                f"table of {len(self.classes)} classes does not have; mend one of them.")  # fmt: skip
        _same_size(path, labels, self._images[stem], image)
        return np.asarray(labels, np.uint8)

    def _depth(self, stem: str, image: npt.NDArray[Any]) -> npt.NDArray[np.float32]:
        path = self._depths.get(stem)
        if path is None:
            return np.full(image.shape[:2], np.nan, np.float32)
        depth = _read(path, decode.depth)
        _same_size(path, depth, self._images[stem], image)
        return np.asarray(depth, np.float32)


def is_image_folder(path: Path) -> bool:
    """Whether it has folders `images` and `labels`."""
    return (path / IMAGES).is_dir() and (path / LABELS).is_dir()


def _by_stem(folder: Path) -> dict[str, Path]:
    """Path below `folder` without suffix -> image file, in natural order. Raises TrainingError for two of one stem."""
    found: dict[str, Path] = {}
    files = [path for pattern in ("*", "*/*") for path in folder.glob(pattern)
             if path.suffix.lower() in SUFFIXES and path.is_file() and not path.name.startswith(".")]  # fmt: skip
    for path in sorted(files, key=lambda path: natural(path.relative_to(folder).as_posix())):
        stem = path.relative_to(folder).with_suffix("").as_posix()
        if stem in found:
            raise TrainingError(f"The images {found[stem]} and {path} have one name; rename one of them.")
        found[stem] = path
    return found


def _sequences(images: dict[str, Path]) -> list[list[str]]:
    """Stems by folder."""
    by_folder: dict[str, list[str]] = {}
    for stem in images:
        by_folder.setdefault(stem.rpartition("/")[0], []).append(stem)
    return list(by_folder.values())


def _stem_pairs(sequence: list[str], labels: dict[str, Path]) -> list[tuple[str, str]]:
    return [(sequence[a], sequence[b]) for a, b in consecutive([stem in labels for stem in sequence])]


def _refuse_turned(images: Iterable[Path]) -> None:
    """Of an image that viewers turn nobody knows which way round its labels are. Raises TrainingError."""
    for path in images:
        if path.suffix.lower() not in (".jpg", ".jpeg"):
            continue
        try:
            with path.open("rb") as file:
                turned = orientation(file.read(_HEAD)) != UPRIGHT
        except OSError as err:
            raise TrainingError(f"The image {path} cannot be used: {err.strerror or err}.") from err
        if turned:
            raise TrainingError(f"The image {path} has an EXIF tag that turns it for viewing, and its labels may be "
                                "either way round; turn its pixels and drop the tag (mogrify -auto-orient), and look "
                                "whether the labels fit.")  # fmt: skip


def _checksum(path: Path) -> int:
    """CRC-32 of a file. Raises TrainingError."""
    try:
        return zlib.crc32(path.read_bytes())
    except OSError as err:
        raise TrainingError(f"The image {path} cannot be used: {err.strerror or err}.") from err


def _read(path: Path, convert: Callable[[CompressedImage], Any]) -> Any:
    try:
        message = CompressedImage(None, "", path.suffix[1:], memoryview(path.read_bytes()))
        if file_format(message) == UNKNOWN:
            raise ValueError("it is neither png nor jpeg nor webp" if message.data else "it is empty")
        return convert(message)
    except (OSError, ValueError) as err:
        reason = err.strerror if isinstance(err, OSError) else err
        raise TrainingError(f"The image {path} cannot be used: {reason}.") from err


def _same_size(path: Path, image: npt.NDArray[Any], other: Path, like: npt.NDArray[Any]) -> None:
    if image.shape[:2] != like.shape[:2]:
        (height, width), (high, wide) = image.shape[:2], like.shape[:2]
        raise TrainingError(f"{path} is {width}x{height}, but {other} is {wide}x{high}; "
                            "an image, its labels and its depth need one size.")  # fmt: skip
