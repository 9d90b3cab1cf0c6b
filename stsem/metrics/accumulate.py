"""What is kept of every judged frame: enough for any score, stratum, pairing or resampling later, and no pixels."""

from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import numpy.typing as npt

from stsem.metrics.confusion import Matrix
from stsem.metrics.scores import ClassMask, Scores, mean_iou_over, pixel_accuracies, scores, tally


@dataclass(frozen=True, eq=False)
class Samples:
    """Tallies of the judged frames of one run, by ascending log index.

    Args:
        index: (n,) int64 log indices.
        stamp_ns: (n,) int64 capture stamps.
        tallies: (n, 3, C) int32: pixels right, of truth, predicted, per class (see `scores.Tally`).
    """

    index: npt.NDArray[np.int64]
    stamp_ns: npt.NDArray[np.int64]
    tallies: npt.NDArray[np.int32]

    def __len__(self) -> int:
        return len(self.index)

    @property
    def pixel_accuracy(self) -> npt.NDArray[np.float64]:
        """(n,) per frame; NaN for a frame whose truth is all "ignore"."""
        return pixel_accuracies(self.tallies)

    @property
    def class_set(self) -> ClassMask:
        """(C,) the classes with truth pixels in the full sample."""
        return np.asarray(self.tallies[:, 1].sum(axis=0) > 0)


class FrameValues(Mapping[int, float]):
    """A number for some frames, by log index.

    Args:
        index: (n,) int64, ascending.
        values: (n,) float64.
    """

    def __init__(self, index: npt.NDArray[np.int64], values: npt.NDArray[np.float64]) -> None:
        self._index, self._values = index, values

    def __getitem__(self, index: int) -> float:
        row = int(np.searchsorted(self._index, index))
        if row == len(self._index) or self._index[row] != index:
            raise KeyError(index)
        return float(self._values[row])

    def __iter__(self) -> Iterator[int]:
        return map(int, self._index)

    def __len__(self) -> int:
        return len(self._index)


@dataclass(frozen=True, eq=False)
class Judged:
    """The score of one judgement: offline, delivered, streaming, or a stratum of one.

    Args:
        scores: over the summed matrix.
        matrix: (C, C + 1) int64, the sum itself.
        frames: frames with truth that were scored.
        misses: those of them without any answer; every pixel of them is wrong.
        miou_common: mIoU over the classes that the network knows and the truth shows; NaN without such a class, None
            if the network's classes were not stated.
        classes_common: how many classes went into `miou_common`.
    """

    scores: Scores
    matrix: Matrix
    frames: int
    misses: int
    miou_common: float | None = None
    classes_common: int | None = None

    @property
    def class_pixels(self) -> npt.NDArray[np.int64]:
        """(C,) truth pixels of each class: the basis of its IoU."""
        return np.asarray(self.matrix.sum(axis=1))

    @property
    def unlabelled_share(self) -> float:
        """Share of the judged pixels that got no label; NaN without pixels."""
        pixels = int(self.matrix.sum())
        return int(self.matrix[:, -1].sum()) / pixels if pixels else float("nan")


class Total:
    """Accumulates one judgement into one matrix.

    Args:
        classes: C.
        known: (C,) classes that the network knows; None if not stated.
    """

    unit: ClassVar[str] = "fraction"
    higher_is_better: ClassVar[bool] = True

    def __init__(self, classes: int, known: ClassMask | None = None) -> None:
        self._matrix = np.zeros((classes, classes + 1), np.int64)
        self._known = known
        self._frames = self._misses = 0

    def update(self, matrix: Matrix, *, missed: bool) -> None:
        """Add the matrix (C, C + 1) of one frame; `missed`: it had no answer."""
        self._matrix += matrix
        self._frames += 1
        self._misses += missed

    def compute(self) -> Judged | None:
        """The scores so far; None before the first frame."""
        if not self._frames:
            return None
        common = None if self._known is None else self._known & (self._matrix.sum(axis=1) > 0)
        return Judged(
            scores=scores(self._matrix),
            matrix=self._matrix.copy(),
            frames=self._frames,
            misses=self._misses,
            miou_common=None if common is None else mean_iou_over(tally(self._matrix), common),
            classes_common=None if common is None else int(common.sum()),
        )


class IndexSet:
    """Which log indices have been met: a byte each."""

    def __init__(self) -> None:
        self._met = bytearray()

    def __contains__(self, index: int) -> bool:
        return index < len(self._met) and self._met[index] == 1

    def add(self, index: int) -> None:
        """Add `index`, which is not negative."""
        if index >= len(self._met):
            self._met.extend(bytes(index + 1 - len(self._met)))
        self._met[index] = 1


class FrameTallies:
    """Keeps the tally of every frame of one judgement, of the classes that the frame shows: 13 bytes each.

    Args:
        classes: C.
    """

    unit: ClassVar[str] = "fraction"
    higher_is_better: ClassVar[bool] = True

    def __init__(self, classes: int) -> None:
        self._classes = classes
        self._frames, self._seen = array("q"), IndexSet()
        self._shown, self._ids, self._counts = bytearray(), bytearray(), array("i")

    def update(self, index: int, stamp_ns: int, matrix: Matrix) -> None:
        """Add the matrix (C, C + 1) of frame `index`.

        Raises:
            ValueError: the frame was judged before.
        """
        if index in self._seen:
            raise ValueError(f"frame {index} was judged twice; every frame is judged once")
        self._seen.add(index)
        self._frames.extend((index, stamp_ns))
        counts = tally(matrix).astype(np.int32)
        ids = np.flatnonzero(counts.any(axis=0))
        self._shown.append(len(ids))
        self._ids += ids.astype(np.uint8).tobytes()
        self._counts.frombytes(counts[:, ids].T.tobytes())

    def compute(self) -> Samples:
        """What bootstrap and pairing need."""
        frames = np.asarray(self._frames, np.int64).reshape(-1, 2)
        order = np.argsort(frames[:, 0])
        place = np.argsort(order)
        tallies = np.zeros((len(frames), 3, self._classes), np.int32)
        rows = np.repeat(place, np.frombuffer(self._shown, np.uint8))
        tallies[rows, :, np.frombuffer(self._ids, np.uint8)] = np.asarray(self._counts, np.int32).reshape(-1, 3)
        return Samples(frames[order, 0], frames[order, 1], tallies)
