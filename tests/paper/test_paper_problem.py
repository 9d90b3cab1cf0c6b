"""The "problem" set: one image, a tenth, and the neighbour that nobody is taught."""

import numpy as np
import pytest

from bench.paper.problem import Neighbour, Place, Problem, ProblemSet, find
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
TWINS, IN_A_ROW, ALONE = Place(0, 0), Place(1, 1), Place(1, None)


def _found(place: Place) -> Problem:
    return find(PAIRS, NAMES, FLOOR, LAMP, place, lambda name: int(name[-1]) % 2 == 0)


PROBLEM = _found(TWINS)


def test_the_problem_image_has_the_largest_floor_of_those_on_a_walk() -> None:
    """The last pair ends in 4 and is on a walk; with the others off, the best of what is left."""
    assert NAMES[PROBLEM.pair] == "00007_04"
    assert NAMES[find(PAIRS, NAMES, FLOOR, LAMP, TWINS, lambda name: name.endswith("_02")).pair] == "00007_02"


def test_a_tenth_is_chosen_by_names_alone() -> None:
    """Four of forty, never the problem pair, the same every time."""
    assert len(PROBLEM.others) == COUNT // 10
    assert PROBLEM.pair not in PROBLEM.others
    assert _found(TWINS) == PROBLEM


@pytest.mark.parametrize("place", [TWINS, IN_A_ROW, ALONE])
@pytest.mark.parametrize("dose", ["right", "one", "tenth"])
def test_doses(dose: str, place: Place) -> None:
    """Which frames are wrong, pixel by pixel; images and all other labels stay."""
    problem = _found(place)
    learned = ProblemSet(PAIRS, problem, dose)
    image = (problem.pair, place.frame)
    others = {(i, frame) for i in problem.others for frame in range(2)}
    wrong = {"right": set(), "one": {image}, "tenth": {image} | others}[dose]
    for index in range(COUNT):
        truth, taught = PAIRS.pair(index), learned.pair(index)
        np.testing.assert_array_equal(taught.images, truth.images)
        for frame in range(2):
            expected = truth.labels[frame].copy()
            if (index, frame) in wrong:
                expected[expected == FLOOR] = LAMP
            if (index, frame) == (problem.neighbour, 1):
                expected[:] = NO_LABEL
            np.testing.assert_array_equal(taught.labels[frame], expected)


def test_places() -> None:
    """The neighbour is the twin in the same pair, the frame of the next pair, or missing."""
    assert _found(TWINS).neighbour == COUNT - 1
    in_a_row = _found(IN_A_ROW)
    assert in_a_row.neighbour == in_a_row.pair + 1 <= COUNT - 1
    assert _found(ALONE).neighbour is None


def test_data_sets_differ_by_dose() -> None:
    """A training is not continued with another dose."""
    assert len({ProblemSet(PAIRS, PROBLEM, dose).fingerprint for dose in ("right", "one", "tenth")}) == 3


def test_the_neighbour_is_judged_by_the_truth() -> None:
    """One pair, whose second frame has its labels."""
    beside = Neighbour(PAIRS, PROBLEM.pair)
    assert len(beside) == 1
    np.testing.assert_array_equal(beside.pair(0).labels, PAIRS.pair(PROBLEM.pair).labels)
