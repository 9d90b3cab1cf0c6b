"""Recorded data to small pairs: the CamVid log of the shared logs, and Cityscapes' folders."""

from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from stsem.classes import NO_LABEL, ClassSet, translation
from stsem.convert.cityscapes import LABEL_IDS
from stsem.errors import UsageError
from stsem.log.log import open_log
from stsem.train.dataset import Pair, save_pair

Image = npt.NDArray[np.uint8]
CAMVID = ClassSet(("Sky", "Building", "Pole", "Road", "Pavement", "Tree", "SignSymbol", "Fence", "Car", "Pedestrian",
                   "Bicyclist"))  # fmt: skip
"""The 11 classes of the SegNet tutorial's form."""
WIDTH = 288
"""Pixels that an image is reduced to before it is kept; the height keeps its shape."""
TRAINING, GAP = 0.6, 0.15
"""Shares of a log's time: its start is trained on, then comes what nobody sees, the rest is the test."""
DONE = "complete.txt"


def small(image: Image) -> Image:
    """(H, W, 3) reduced to `WIDTH`, each pixel the mean of what it covers; a smaller one stays."""
    if image.shape[1] <= WIDTH:
        return image
    return np.asarray(cv2.resize(image, _size(image), interpolation=cv2.INTER_AREA), np.uint8)


def small_labels(labels: Image) -> Image:
    """(H, W) reduced likewise, by nearest neighbour."""
    if labels.shape[1] <= WIDTH:
        return labels
    return np.asarray(cv2.resize(labels, _size(labels), interpolation=cv2.INTER_NEAREST_EXACT), np.uint8)


def _size(image: Image) -> tuple[int, int]:
    height, width = image.shape[:2]
    return WIDTH, round(height * WIDTH / width)


def save(folder: Path, name: str, before: Image, image: Image, labels: Image) -> None:
    """A pair whose second frame alone is labelled."""
    kept = small_labels(labels)
    folder.mkdir(parents=True, exist_ok=True)
    images = np.stack([small(before), small(image)])
    save_pair(folder / f"{name}.npz", Pair(images, np.stack([np.full_like(kept, NO_LABEL), kept])))


def from_log(path: Path, folder: Path, say: Callable[[str], None]) -> None:
    """Pairs of a labelled log: its first part for training, its last for the test (CamVid)."""
    if (folder / DONE).exists():
        return
    say(f"reading {path}")
    with open_log([path]) as log:
        if log.classes is None:
            raise UsageError(f"{path} has no labels with a class table; give a log that has.")
        count, ids = len(log.plans), translation(log.classes, CAMVID)
        for loaded in log.frames(range(1, count), depth=False, previous=True, truth=True):
            which, frame = _part(loaded.index / count), loaded.frame
            if which and frame is not None and frame.previous is not None and loaded.truth is not None:
                save(folder / which, f"{loaded.index:06}", frame.previous, frame.image, ids[loaded.truth])
    _finish(folder, path)


def _part(share: float) -> str | None:
    if share < TRAINING:
        return "train"
    return "test" if share >= TRAINING + GAP else None


def from_cityscapes(source: Path, folder: Path, say: Callable[[str], None]) -> None:
    """Pairs of leftImg8bit_sequence and gtFine: the split `train` is trained on, `val` is the test."""
    if (folder / DONE).exists():
        return
    for which, split in (("train", "train"), ("test", "val")):
        for name, before, image, labels in _labelled(source, split):
            if not (folder / which / f"{name}.npz").exists():
                say(f"reading {name}")
                save(folder / which, name, _read(before), _read(image), _class_ids(labels))
    _finish(folder, source)


def _labelled(source: Path, split: str) -> Iterator[tuple[str, Path, Path, Path]]:
    """(name, previous image, image, labels) of every labelled frame of a split, in order of names."""
    for labels in sorted(source.glob(f"gtFine/{split}/*/*_gtFine_labelIds.png")):
        name = labels.name.removesuffix("_gtFine_labelIds.png")
        sequence, _, number = name.rpartition("_")
        city = source / "leftImg8bit_sequence" / split / labels.parent.name
        before, image = (city / f"{sequence}_{int(number) - step:06}_leftImg8bit.png" for step in (1, 0))
        if before.is_file() and image.is_file():
            yield name, before, image, labels


def _read(path: Path) -> Image:
    """(H, W, 3) uint8 RGB."""
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise UsageError(f"The image {path} cannot be read; fetch it again.")
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), np.uint8)


def _class_ids(path: Path) -> Image:
    """(H, W) uint8 in the order of the 19 classes, all others without a label."""
    raw = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if raw is None or raw.ndim != 2 or raw.dtype != np.uint8:
        raise UsageError(f"The label image {path} cannot be read as 8-bit ids; fetch it again.")
    table = np.full(256, NO_LABEL, np.uint8)
    table[list(LABEL_IDS)] = np.arange(len(LABEL_IDS))
    return np.asarray(table[raw], np.uint8)


def _finish(folder: Path, source: Path) -> None:
    """Mark the folder as complete, if there is something in it."""
    missing = [which for which in ("train", "test") if not any((folder / which).glob("*.npz"))]
    if missing:
        raise UsageError(f"{source} has no labelled pair of frames for {' and '.join(missing)}; "
                         "give the log, or the folder with leftImg8bit_sequence and gtFine.")  # fmt: skip
    (folder / DONE).write_text("every pair is here\n", encoding="utf-8")


SOURCES: dict[str, Callable[[Path, Path, Callable[[str], None]], None]] = {
    "camvid": from_log, "cityscapes": from_cityscapes,
}  # fmt: skip
