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
    colour += rng.random((20, 23, 3), np.float32) * 20
    expected = votes.astype(np.float64)
    for step in STEPS:
        before = expected.copy()
        for y, x in np.argwhere(asked):
            total, weights = votes[y, x].astype(np.float64), 1.0
            for v, u in ((y + step, x), (y - step, x), (y, x + step), (y, x - step)):
                if 0 <= v < 20 and 0 <= u < 23 and before[v, u].any():
                    off = abs(float(place[v, u, 2]) - float(place[y, x, 2])) / PLANE_M
                    apart = float(((colour[v, u] - colour[y, x]) ** 2).sum()) / COLOUR**2
                    weight = WEIGHT * math.exp(-apart - off * off)
                    total, weights = total + weight * before[v, u], weights + weight
            expected[y, x] = total / weights
    np.testing.assert_allclose(diffused(votes, asked, place, normal, colour), expected[asked], atol=1e-5)


def test_evidence_goes_along_a_surface_and_stops_at_its_edge() -> None:
    """Left a wall of class 0, right a board of class 1; what lies between, undecided, is decided by colour."""
    place, normal, colour = wall(16, 30)
    colour[:, 15:] = 160
    votes, asked = np.full((16, 30, 2), 0.5, np.float32), np.zeros((16, 30), np.bool_)
    asked[:, 8:22] = True
    votes[:, :8], votes[:, 22:] = (1, 0), (0, 1)
    found = np.zeros((16, 30), np.intp)
    found[asked] = diffused(votes, asked, place, normal, colour).argmax(axis=1)
    assert (found[:, 8:15] == 0).all()
    assert (found[:, 15:22] == 1).all()


def test_a_neighbour_without_place_has_no_say() -> None:
    place, normal, colour = wall(16, 30)
    place[:, :10] = np.nan
    votes, asked = np.zeros((16, 30, 2), np.float32), np.ones((16, 30), np.bool_)
    asked[:, :10] = False
    votes[:, 10:] = (0.75, 0.25)
    found = diffused(votes, asked, place, normal, colour)
    np.testing.assert_allclose(found, np.broadcast_to(np.float32((0.75, 0.25)), found.shape), rtol=1e-6)
