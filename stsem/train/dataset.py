"""Pairs of consecutive labelled frames in a folder, one uncompressed .npz each."""

import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from stsem.errors import TrainingError

Images = npt.NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Pair:
    """Two consecutive frames; either may serve as the current one, since motion has no preferred direction.

    Args:
        images: (2, H, W, 3) uint8 RGB.
        labels: (2, H, W) uint8, 255 ignored.
    """

    images: Images
    labels: npt.NDArray[np.uint8]


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

    def __len__(self) -> int:
        return len(self._paths)

    def pair(self, index: int) -> Pair:
        """The pair at `index`. Raises TrainingError when its file is damaged."""
        path = self._paths[index]
        try:
            with path.open("rb") as file, np.load(file) as arrays:
                return Pair(arrays["images"], arrays["labels"])
        except (OSError, KeyError, ValueError, zipfile.BadZipFile) as err:
            raise TrainingError(
                f"The training pair {path} cannot be read ({err}); remove it and render it anew."
            ) from err


def save_pair(path: Path, pair: Pair) -> None:
    """Write a pair, aside and renamed, so that a reader never sees half of it."""
    aside = path.with_suffix(".part")
    with aside.open("wb") as file:
        np.savez(file, images=pair.images, labels=pair.labels)
    aside.replace(path)


def class_shares(pairs: PairFolder, classes: int, sample: int = 200) -> npt.NDArray[np.float64]:
    """(classes,) share of the labelled pixels of every class, over at most `sample` pairs spread over the folder."""
    counts = np.zeros(256, np.int64)
    for index in np.linspace(0, len(pairs) - 1, min(sample, len(pairs))).round().astype(int):
        counts += np.bincount(pairs.pair(int(index)).labels[:, ::4, ::4].ravel(), minlength=256)
    known = counts[:classes].astype(np.float64)
    shares: npt.NDArray[np.float64] = known / max(1.0, float(known.sum()))
    return shares
