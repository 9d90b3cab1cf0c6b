"""Guesses take the votes of their surface: against a loop, and at edges."""

import math

import numpy as np
import numpy.typing as npt

from stsem.chance import generator
from stsem.geometry.diffusion import COLOUR, PLANE_M, STEPS, WEIGHT, diffused

Array = npt.NDArray[np.float32]


def wall(height: int, width: int) -> tuple[Array, Array, Array]:
    """Place, normal and colour of a grey wall, 0.1 m a cell."""
    y, x = np.mgrid[:height, :width].astype(np.float32) * 0.1
    normal = np.zeros((height, width, 3), np.float32)
    normal[..., 2] = -1
    return np.stack([x, y, np.full_like(x, 2)], axis=2), normal, np.full((height, width, 3), 60, np.float32)


def test_it_is_what_a_loop_over_cells_gives() -> None:
    rng = generator(0, "diffusion")
    votes = rng.random((20, 23, 4), np.float32)
    asked = rng.random((20, 23)) < 0.4
    votes[~asked & (rng.random((20, 23)) < 0.3)] = 0
    place, normal, colour = wall(20, 23)
    place[..., 2] += rng.random((20, 23), np.float32) * 0.3
    normal[..., :2] += rng.random((20, 23, 2), np.float32) - 0.5
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    colour += rng.random((20, 23, 3), np.float32) * 20
    expected = votes.astype(np.float64)
    for step in STEPS:
        before = expected.copy()
        for y, x in np.argwhere(asked):
            total, weights = votes[y, x].astype(np.float64), 1.0
            for v, u in ((y + step, x), (y - step, x), (y, x + step), (y, x - step)):
                if 0 <= v < 20 and 0 <= u < 23 and before[v, u].any():
                    way = place[v, u].astype(np.float64) - place[y, x]
                    off = max(abs(float(way @ normal[y, x])), abs(float(way @ normal[v, u]))) / PLANE_M
                    apart = float(((colour[v, u] - colour[y, x]) ** 2).sum()) / COLOUR**2
                    weight = WEIGHT * math.exp(-apart - off * off)
                    total, weights = total + weight * before[v, u], weights + weight
            expected[y, x] = total / weights
    np.testing.assert_allclose(diffused(votes, asked, place, normal, colour), expected[asked], atol=1e-5)


def test_evidence_reaches_as_far_as_the_steps_sum_up_to() -> None:
    """From as many cells as the widest step, at one end of a row, to all that are so far away, and to none farther."""
    place, normal, colour = wall(1, 60)
    votes, asked = np.full((1, 60, 2), 0.5, np.float32), np.ones((1, 60), np.bool_)
    votes[0, :16], asked[0, :16] = (1, 0), False
    reached = diffused(votes, asked, place, normal, colour)[:, 0] > 0.5 + 1e-5
    np.testing.assert_array_equal(reached, np.arange(16, 60) <= 15 + sum(STEPS))
    assert sum(STEPS) == 21


def test_what_is_given_is_left_alone() -> None:
    given = (np.full((6, 9, 2), 0.5, np.float32), np.ones((6, 9), np.bool_), *wall(6, 9))
    given[0][0, 0], given[1][0, 0], given[2][2, 3] = (1, 0), False, np.nan
    before = [part.copy() for part in given]
    diffused(*given)
    for part, was in zip(given, before, strict=True):
        np.testing.assert_array_equal(part, was)


def test_evidence_goes_along_a_surface_and_stops_at_its_edge() -> None:
    """Left a wall of class 0, right a board of class 1; what lies between, undecided, is decided by colour."""
    place, normal, colour = wall(16, 62)
    colour[:, 31:] = 160
    votes, asked = np.full((16, 62, 2), 0.5, np.float32), np.zeros((16, 62), np.bool_)
    asked[:, 24:38] = True
    votes[:, :24], votes[:, 38:] = (1, 0), (0, 1)
    found = np.zeros((16, 62), np.intp)
    found[asked] = diffused(votes, asked, place, normal, colour).argmax(axis=1)
    assert (found[:, 24:31] == 0).all()
    assert (found[:, 31:38] == 1).all()


def test_a_neighbour_without_place_has_no_say() -> None:
    place, normal, colour = wall(16, 30)
    place[:, :10] = np.nan
    votes, asked = np.zeros((16, 30, 2), np.float32), np.ones((16, 30), np.bool_)
    asked[:, :10] = False
    votes[:, 10:] = (0.75, 0.25)
    found = diffused(votes, asked, place, normal, colour)
    np.testing.assert_allclose(found, np.broadcast_to(np.float32((0.75, 0.25)), found.shape), rtol=1e-6)
