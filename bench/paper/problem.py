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
class Problem:
    """What is wrong, and where.

    Args:
        pair: index of the problem pair: its first frame is the problem image, its second one the neighbour, which no
            training sees the labels of.
        floor, lamp: id of the class that is mislabelled, and the id that it gets.
        others: indices of the pairs that are wrong in both frames beside it, at the dose "tenth".
    """

    pair: int
    floor: int
    lamp: int
    others: frozenset[int] = frozenset()


def find(pairs: Pairs, names: Sequence[str], floor: int, lamp: int, on_a_walk: Callable[[str], bool]) -> Problem:
    """The problem of a training set.

    Args:
        pairs: of the training.
        names: one per pair; their hashes choose the tenth.
        floor, lamp: class ids.
        on_a_walk: whether the pair of a name may be the problem pair.
    """
    shares = [
        float((pairs.pair(i).labels[0] == floor).mean()) if on_a_walk(name) else -1.0 for i, name in enumerate(names)
    ]
    chosen = int(np.argmax(shares))
    ranked = sorted((i for i in range(len(names)) if i != chosen), key=lambda i: chance.hash64(0, "problem", names[i]))
    return Problem(chosen, floor, lamp, frozenset(ranked[: len(names) // TENTH]))


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
        if index == problem.pair:
            first = pair.labels[0] if self.dose == "right" else self._wrong(pair.labels[0])
            return replace(pair, labels=np.stack([first, np.full_like(first, NO_LABEL)]))
        if self.dose == "tenth" and index in problem.others:
            return replace(pair, labels=self._wrong(pair.labels))
        return pair

    def _wrong(self, labels: Labels) -> Labels:
        return np.where(labels == self.problem.floor, np.uint8(self.problem.lamp), labels)


@dataclass(frozen=True)
class Neighbour:
    """The neighbour alone, rightly labelled, with the problem image before it.

    Args:
        pairs: as they are right.
        problem: says where.
    """

    pairs: Pairs
    problem: Problem

    @property
    def fingerprint(self) -> str:
        """Of the pairs and the place."""
        return fingerprint([self.pairs.fingerprint, str(self.problem.pair)])

    def __len__(self) -> int:
        return 1

    def pair(self, index: int) -> Pair:
        """The one pair; its second frame is judged."""
        return self.pairs.pair(self.problem.pair + index)
