"""What a training sees: pairs of consecutive frames, whatever they are read from."""

import zipfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from stsem.aside import aside
from stsem.classes import NO_LABEL
from stsem.errors import OutputError, TrainingError

Images = npt.NDArray[np.uint8]
MILLIMETRES = 1000.0
MAX_DEPTH_M = 65.0
"""Depth is kept in whole millimetres of 16 bits; what is farther counts as unknown."""
_TYPES = {"images": "uint8", "labels": "uint8", "depths_mm": "uint16"}
"""Array in the file of a pair -> type of its elements."""


@dataclass(frozen=True, eq=False)
class Pair:
    """Two consecutive frames; either that is labelled may be the current one, since motion has no preferred direction.

    Args:
        images: (2, H, W, 3) uint8 RGB.
        labels: (2, H, W) uint8, 255 ignored; 255 all over where a frame has no truth: it is only a partner.
        depths: (2, H, W) float32 metres, NaN unknown; None where no depth was kept.
    """

    images: Images
    labels: npt.NDArray[np.uint8]
    depths: npt.NDArray[np.float32] | None = None

    @property
    def labelled(self) -> tuple[int, ...]:
        """Which of the two frames, 0 and 1, have any label."""
        return tuple(i for i in range(2) if (self.labels[i] != NO_LABEL).any())


class Pairs(Protocol):
    """A data set of pairs, in a fixed order; safe to be asked from several threads."""

    @property
    def fingerprint(self) -> str:
        """Tells data sets apart: a training goes on only with the pairs that it began with."""
        ...

    def __len__(self) -> int: ...

    def pair(self, index: int) -> Pair:
        """The pair at `index`. Raises TrainingError when it cannot be read."""
        ...


class PairFolder:
    """The pairs in a folder, in order of their names; the list is fixed when it is opened.

    Args:
        folder: holds the `.npz` files that `save_pair` wrote.
        prefix: take only files whose name starts so.

    Raises:
        TrainingError: there is no pair.
    """

    def __init__(self, folder: Path, prefix: str = "") -> None:
        self._paths = sorted(folder.glob(f"{prefix}*.npz"))
        if not self._paths:
            raise TrainingError(f"There is no training pair {prefix}*.npz in {folder}; render or convert some first.")

    @cached_property
    def fingerprint(self) -> str:
        """Of the files' names and the checksums of their arrays: pairs of one shape all have one size.

        Raises:
            TrainingError: a file is damaged.
        """
        return fingerprint(f"{path.name} {_checksums(path)}" for path in self._paths)

    def __len__(self) -> int:
        return len(self._paths)

    def pair(self, index: int) -> Pair:
        """The pair at `index`. Raises TrainingError when its file is damaged."""
        path = self._paths[index]
        try:
            with path.open("rb") as file, np.load(file) as arrays:
                return _pair({name: arrays[name] for name in arrays.files if name in _TYPES})
        except (OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile) as err:
            raise _unreadable(path, err) from err


def _checksums(path: Path) -> list[tuple[str, int]]:
    """Name and CRC-32 of each array, from the file's directory alone. Raises TrainingError."""
    try:
        with zipfile.ZipFile(path) as arrays:
            return [(member.filename, member.CRC) for member in arrays.infolist()]
    except (OSError, ValueError, zipfile.BadZipFile) as err:
        raise _unreadable(path, err) from err


def _unreadable(path: Path, err: Exception) -> TrainingError:
    return TrainingError(f"The training pair {path} cannot be read ({err}); remove it and render it anew.")


def _pair(arrays: Mapping[str, npt.NDArray[Any]]) -> Pair:
    """The pair of what `save_pair` wrote. Raises KeyError or ValueError for anything else."""
    images, labels, depths = arrays["images"], arrays["labels"], arrays.get("depths_mm")
    if images.ndim != 4 or images.shape[3] != 3 or images.size == 0:
        raise ValueError(f"its images have the shape {images.shape}, not (2, H, W, 3)")
    for name, array in arrays.items():
        expected = (2, *images.shape[1:3], *((3,) if name == "images" else ()))
        if array.dtype != _TYPES[name] or array.shape != expected:
            raise ValueError(f"its {name} are {array.dtype} {array.shape}, not {_TYPES[name]} {expected}")
    return Pair(images, labels, None if depths is None else in_metres(depths))


def save_pair(path: Path, pair: Pair) -> None:
    """Write a pair, aside and renamed, so that a reader never sees half of it.

    Raises:
        OutputError: it cannot be written.
    """
    arrays: dict[str, npt.NDArray[Any]] = {"images": pair.images, "labels": pair.labels}
    if pair.depths is not None:
        arrays["depths_mm"] = in_millimetres(pair.depths)
    save_arrays(path, arrays)


def save_arrays(path: Path, arrays: Mapping[str, npt.NDArray[Any]]) -> None:
    """Write an uncompressed `.npz`, aside and renamed. Raises OutputError."""
    unfinished = aside(path)
    try:
        with unfinished.open("wb") as file:
            np.savez(file, allow_pickle=False, **arrays)
        unfinished.replace(path)
    except OSError as err:
        unfinished.unlink(missing_ok=True)
        raise OutputError(f"{path} cannot be written: {err.strerror or err}; the same command goes on.") from err


def in_millimetres(depth: npt.NDArray[np.float32]) -> npt.NDArray[np.uint16]:
    """Metres, NaN unknown, as whole millimetres, 0 unknown."""
    known = np.isfinite(depth) & (depth > 0) & (depth < MAX_DEPTH_M)
    return np.where(known, np.rint(np.where(known, depth, 0) * MILLIMETRES), 0).astype(np.uint16)


def in_metres(depth: npt.NDArray[np.uint16]) -> npt.NDArray[np.float32]:
    """What `in_millimetres` kept."""
    return np.where(depth > 0, depth / np.float32(MILLIMETRES), np.float32(np.nan)).astype(np.float32)


def fingerprint(lines: Iterable[str]) -> str:
    """Sixteen hexadecimal digits of lines of text in their order."""
    digest = sha256()
    for line in lines:
        digest.update(line.encode("utf-8", "surrogateescape") + b"\n")
    return digest.hexdigest()[:16]


def class_shares(pairs: Pairs, classes: int, sample: int = 200) -> npt.NDArray[np.float64]:
    """(classes,) share of the labelled pixels of every class, over at most `sample` pairs spread over the data.

    Raises:
        TrainingError: a label is beyond the classes, or there is none at all.
    """
    counts = np.zeros(256, np.int64)
    for index in np.linspace(0, len(pairs) - 1, min(sample, len(pairs))).round().astype(int):
        counts += np.bincount(pairs.pair(int(index)).labels[:, ::4, ::4].ravel(), minlength=256)
    if counts[classes:NO_LABEL].any():
        largest = int(np.flatnonzero(counts[:NO_LABEL]).max())
        raise TrainingError(
            f"The training pairs have the label {largest}, but there are {classes} classes, 0 to {classes - 1}, and "
            f"{NO_LABEL} for none; give the class table of these labels."
        )
    known = counts[:classes].astype(np.float64)
    if not known.any():
        raise TrainingError("No pixel of the training pairs has a label; give data with truth.")
    shares: npt.NDArray[np.float64] = known / known.sum()
    return shares
