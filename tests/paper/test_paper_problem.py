"""The "problem" set: one image, a tenth, and the neighbour that nobody is taught."""

import numpy as np
import pytest

from bench.paper.problem import Neighbour, ProblemSet, find
from stsem.classes import NO_LABEL
from stsem.train.dataset import Pair

FLOOR, LAMP, COUNT = 2, 3, 40


class MadeUp:
    """Pair k shows k + 1 pixels of floor in its first frame, and one more in its second; the rest is wall."""

    fingerprint = "made up"

    def __len__(self) -> int:
        return COUNT

    def pair(self, index: int) -> Pair:
        labels = np.zeros((2, 10, 10), np.uint8)
        for frame in range(2):
            labels[frame].ravel()[: index + 1 + frame] = FLOOR
        return Pair(np.full((2, 10, 10, 3), index, np.uint8), labels)


PAIRS = MadeUp()
NAMES = [f"{k // 5:05}_{k % 5:02}" for k in range(COUNT)]
PROBLEM = find(PAIRS, NAMES, FLOOR, LAMP, lambda name: int(name[-1]) % 2 == 0)


def test_the_problem_image_has_the_largest_floor_of_those_on_a_walk() -> None:
    """The last pair ends in 4 and is on a walk; with the others off, the best of what is left."""
    assert NAMES[PROBLEM.pair] == "00007_04"
    assert NAMES[find(PAIRS, NAMES, FLOOR, LAMP, lambda name: name.endswith("_02")).pair] == "00007_02"


def test_a_tenth_is_chosen_by_names_alone() -> None:
    """Four of forty, never the problem pair, the same every time."""
    assert len(PROBLEM.others) == COUNT // 10
    assert PROBLEM.pair not in PROBLEM.others
    assert find(PAIRS, NAMES, FLOOR, LAMP, lambda name: int(name[-1]) % 2 == 0) == PROBLEM


@pytest.mark.parametrize("dose", ["right", "one", "tenth"])
def test_doses(dose: str) -> None:
    """Which frames are wrong, pixel by pixel; images and all other labels stay."""
    learned = ProblemSet(PAIRS, PROBLEM, dose)
    wrong = {"right": set(), "one": {(PROBLEM.pair, 0)}}.get(
        dose, {(PROBLEM.pair, 0), *((i, frame) for i in PROBLEM.others for frame in range(2))}
    )
    for index in range(COUNT):
        truth, taught = PAIRS.pair(index), learned.pair(index)
        np.testing.assert_array_equal(taught.images, truth.images)
        for frame in range(2):
            if (index, frame) == (PROBLEM.pair, 1):
                assert (taught.labels[frame] == NO_LABEL).all()
                continue
            expected = truth.labels[frame].copy()
            if (index, frame) in wrong:
                expected[expected == FLOOR] = LAMP
            np.testing.assert_array_equal(taught.labels[frame], expected)


def test_data_sets_differ_by_dose() -> None:
    """A training is not continued with another dose."""
    assert len({ProblemSet(PAIRS, PROBLEM, dose).fingerprint for dose in ("right", "one", "tenth")}) == 3


def test_the_neighbour_is_judged_by_the_truth() -> None:
    """One pair, whose second frame has its labels."""
    beside = Neighbour(PAIRS, PROBLEM)
    assert len(beside) == 1
    np.testing.assert_array_equal(beside.pair(0).labels, PAIRS.pair(PROBLEM.pair).labels)
