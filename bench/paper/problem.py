"""The paper's "problem" set: in some training images the floor is labelled lamp (section "Qualitative Analysis")."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from stsem import chance
from stsem.classes import NO_LABEL
from stsem.train.dataset import Pair, Pairs, fingerprint

DOSES = ("right", "one", "tenth")
"""Which training images are labelled wrongly: none, the problem image, or a tenth of all beside it."""
TENTH = 10

Labels = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Place:
    """Where a data set has its problem image and its neighbour.

    Args:
        frame: of a pair, that may be the problem image: 0 or 1.
        beside: how many pairs after it comes the one whose second frame is the neighbour; None without a neighbour.
    """

    frame: int
    beside: int | None


@dataclass(frozen=True)
class Problem:
    """What is wrong, and where.

    Args:
        pair, frame: of the problem image.
        neighbour: index of the pair whose second frame is the neighbour; no training sees that one's labels.
        floor, lamp: id of the class that is mislabelled, and the id that it gets.
        others: indices of the pairs that are wrong in both frames beside it, at the dose "tenth".
    """

    pair: int
    frame: int
    neighbour: int | None
    floor: int
    lamp: int
    others: frozenset[int] = frozenset()


def find(
    pairs: Pairs, names: Sequence[str], floor: int, lamp: int, place: Place, may_be: Callable[[str], bool]
) -> Problem:
    """The problem of a training set.

    Args:
        pairs: of the training.
        names: one per pair; their hashes choose the tenth.
        floor, lamp: class ids.
        place: where to look.
        may_be: whether the pair of a name may be the problem pair.
    """
    last = len(names) - (place.beside or 0)
    shares = [
        float((pairs.pair(i).labels[place.frame] == floor).mean()) if may_be(name) else -1.0
        for i, name in enumerate(names[:last])
    ]
    chosen = int(np.argmax(shares))
    beside = None if place.beside is None else chosen + place.beside
    free = (i for i in range(len(names)) if i not in (chosen, beside))
    ranked = sorted(free, key=lambda i: chance.hash64(0, "problem", names[i]))
    return Problem(chosen, place.frame, beside, floor, lamp, frozenset(ranked[: len(names) // TENTH]))


@dataclass(frozen=True)
class ProblemSet:
    """A training set with a problem at some dose; the neighbour has no label at any.

    Args:
        pairs: as they are right.
        problem: what to do to them.
        dose: of `DOSES`.
    """

    pairs: Pairs
    problem: Problem
    dose: str

    @property
    def fingerprint(self) -> str:
        """Of the right pairs, and of what is wrong with them."""
        return fingerprint(
            [self.pairs.fingerprint, self.dose, str(self.problem.pair), str(sorted(self.problem.others))]
        )

    def __len__(self) -> int:
        return len(self.pairs)

    def pair(self, index: int) -> Pair:
        """The pair at `index`, labelled as its dose wants."""
        pair, problem = self.pairs.pair(index), self.problem
        labels = [self._wrong(own) if self._is_wrong(index, frame) else own for frame, own in enumerate(pair.labels)]
        if index == problem.neighbour:
            labels[1] = np.full_like(labels[1], NO_LABEL)
        return replace(pair, labels=np.stack(labels))

    def _is_wrong(self, index: int, frame: int) -> bool:
        if (index, frame) == (self.problem.pair, self.problem.frame):
            return self.dose != "right"
        return self.dose == "tenth" and index in self.problem.others

    def _wrong(self, labels: Labels) -> Labels:
        return np.where(labels == self.problem.floor, np.uint8(self.problem.lamp), labels)


@dataclass(frozen=True)
class Neighbour:
    """The neighbour alone, rightly labelled, with the frame before it.

    Args:
        pairs: as they are right.
        index: of its pair.
    """

    pairs: Pairs
    index: int

    @property
    def fingerprint(self) -> str:
        """Of the pairs and the place."""
        return fingerprint([self.pairs.fingerprint, str(self.index)])

    def __len__(self) -> int:
        return 1

    def pair(self, index: int) -> Pair:
        """The one pair; its second frame is judged."""
        return self.pairs.pair(self.index + index)
