"""Pairs of a recorded log: what is needed of it is decoded once into a folder."""

import json
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from stsem.aside import aside
from stsem.classes import NO_LABEL, ClassSet
from stsem.errors import OutputError, TrainingError
from stsem.inference.preprocess import labels_at
from stsem.log.log import Loaded, Log
from stsem.train.consecutive import consecutive
from stsem.train.dataset import Pair, fingerprint, in_metres, in_millimetres, save_arrays

INDEX = "frames.json"
Report = Callable[[int, int], None]


class LogPairs:
    """The pairs in a folder that `decode_log` filled.

    Attributes:
        classes: the log's; labels have its ids.
        unreadable: labelled frames that could not be decoded.
    """

    def __init__(self, folder: Path) -> None:
        try:
            index = json.loads((folder / INDEX).read_text(encoding="utf-8"))
            self._pairs = [(int(a), int(b)) for a, b in index["pairs"]]
            self.classes = ClassSet(tuple(index["classes"]), tuple((r, g, b) for r, g, b in index["colours"]))
            self.fingerprint, self.unreadable = str(index["fingerprint"]), int(index["unreadable"])
        except (OSError, ValueError, KeyError, TypeError) as err:
            raise TrainingError(f"The decoded frames in {folder} cannot be used ({err}); remove the folder, "
                                "and they are decoded anew.") from err  # fmt: skip
        self._folder = folder

    def __len__(self) -> int:
        return len(self._pairs)

    def pair(self, index: int) -> Pair:
        """The pair at `index`; where the log's images change their size between the two, the labelled one twice.

        Raises:
            TrainingError: a file is damaged.
        """
        frames = [self._frame(number) for number in self._pairs[index]]
        if frames[0]["image"].shape != frames[1]["image"].shape:
            frames = [frames[1] if "labels" in frames[1] else frames[0]] * 2
        images = np.stack([frame["image"] for frame in frames])
        labels = np.stack([frame.get("labels", _unlabelled(frame["image"])) for frame in frames])
        if "depth_mm" not in frames[0]:
            return Pair(images, labels)
        return Pair(images, labels, np.stack([in_metres(frame["depth_mm"]) for frame in frames]))

    def _frame(self, number: int) -> dict[str, npt.NDArray[Any]]:
        return _arrays(_file(self._folder, number))


def decode_log(log: Log, folder: Path, *, depth: bool = False, report: Report = lambda done, total: None) -> LogPairs:
    """The pairs of a log; decoded into `folder` unless they are there. One that was stopped there is gone on with.

    Args:
        log: opened, with the window that is wanted.
        folder: of this log alone.
        depth: keep depth, too; frames without are unknown all over.
        report: called with (frames done, frames in all).

    Raises:
        TrainingError: the log has no labels, or none of its labelled frames can be decoded.
        OutputError: the folder cannot be written.
    """
    identity = _identity(log, depth)
    if (folder / INDEX).is_file() and (there := LogPairs(folder)).fingerprint == identity:
        return there
    if log.classes is None or not any(plan.has_truth for plan in log.plans):
        raise TrainingError(f"The log {log.info.name} has no frame with labels and their class table; "
                            "give logs with truth, or a table with --classes.")  # fmt: skip
    _make(folder, identity)
    wanted = consecutive([plan.has_truth for plan in log.plans])
    kept = _decode(log, folder, sorted({number for pair in wanted for number in pair}), depth, report)
    pairs = [(a if a in kept else b, b if b in kept else a) for a, b in wanted if kept.get(a) or kept.get(b)]
    missing = len({b for _, b in wanted}) - len({b for _, b in pairs})
    if not pairs:
        raise TrainingError(f"None of the {missing} labelled frames of the log {log.info.name} can be decoded; "
                            "stsem inspect says why.")  # fmt: skip
    _write_index(folder, log.classes, {"fingerprint": identity, "pairs": pairs, "unreadable": missing})
    return LogPairs(folder)


def _identity(log: Log, depth: bool) -> str:
    """Of all that decides the decoded frames: the log, its window, which channels were chosen, the class table."""
    choice = log.info.choice
    topics = f"{choice.color} {choice.depth if depth else None} {choice.labels} {choice.calibration}"
    window = f"{log.plans[0].stamp_ns} {len(log.plans)} {depth}"
    return fingerprint([log.info.sha256, window, topics, *(log.class_table.meaning if log.class_table else ())])


def _decode(log: Log, folder: Path, numbers: Sequence[int], depth: bool, report: Report) -> dict[int, bool]:
    """Number -> whether it has labels, of the frames that can be decoded; those that are there are left alone."""
    kept = {number: _has_labels(folder, number) for number in numbers if _file(folder, number).is_file()}
    missing = [number for number in numbers if number not in kept]
    before = len(kept)
    for done, loaded in enumerate(log.frames(missing, depth=depth, previous=False, truth=True), 1):
        if loaded.frame is not None:
            kept[loaded.index] = _keep(folder, loaded, depth=depth)
        report(before + done, len(numbers))
    return kept


def _keep(folder: Path, loaded: Loaded, *, depth: bool) -> bool:
    """Write a frame; whether it has labels."""
    assert loaded.frame is not None
    frame, arrays = loaded.frame, {"image": loaded.frame.image}
    if loaded.truth is not None and (loaded.truth != NO_LABEL).any():
        arrays["labels"] = labels_at(loaded.truth, frame.size)
    kept: dict[str, npt.NDArray[Any]] = dict(arrays)
    if depth:
        unknown = np.full(frame.image.shape[:2], np.nan, np.float32)
        kept["depth_mm"] = in_millimetres(unknown if frame.depth is None else frame.depth)
    save_arrays(_file(folder, loaded.index), kept)
    return "labels" in arrays


def _has_labels(folder: Path, number: int) -> bool:
    return "labels" in _arrays(_file(folder, number))


def _arrays(path: Path) -> dict[str, npt.NDArray[Any]]:
    try:
        with path.open("rb") as file, np.load(file) as arrays:
            return dict(arrays)
    except (OSError, EOFError, ValueError, zipfile.BadZipFile) as err:
        raise TrainingError(f"The decoded frame {path} cannot be read ({err}); remove its folder, "
                            "and the log is decoded anew.") from err  # fmt: skip


def _unlabelled(image: npt.NDArray[Any]) -> npt.NDArray[np.uint8]:
    return np.full(image.shape[:2], NO_LABEL, np.uint8)


def _file(folder: Path, number: int) -> Path:
    return folder / f"{number:07}.npz"


def _make(folder: Path, identity: str) -> None:
    """An empty folder, or one with frames of the same log."""
    began = folder / "log"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if began.is_file() and began.read_text() == identity:
            return
        for path in folder.iterdir():
            path.unlink()
        began.write_text(identity)
    except OSError as err:
        raise OutputError(f"The folder {folder} cannot be written: {err.strerror or err}.") from err


def _write_index(folder: Path, classes: ClassSet, index: dict[str, Any]) -> None:
    unfinished = aside(folder / INDEX)
    try:
        unfinished.write_text(json.dumps(index | {"classes": classes.names, "colours": classes.colours}))
        unfinished.replace(folder / INDEX)
    except OSError as err:
        raise OutputError(f"{folder / INDEX} cannot be written: {err.strerror or err}.") from err
