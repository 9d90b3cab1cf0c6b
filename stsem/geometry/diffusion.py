"""Guesses that agree with what lies beside them on the same surface.

Each guessed cell takes, beside its own votes, those of the cells some steps away, as far as they have its colour and
lie in its plane; what is covered votes for its label. Far steps come first, near ones last, so a few of them reach as
far as many small ones would (as in the edge-avoiding a-trous wavelets of Dammertz et al. 2010).
"""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from stsem.geometry.carried import Bools

Votes = npt.NDArray[np.float32]
"""(..., classes) float32: shares of a vote, which sum to 1, or all 0 where nothing is known."""
Planes = npt.NDArray[np.float32]

STEPS = (16, 4, 1)
"""Cells between neighbours."""
WEIGHT = 10.0
"""Of a neighbour that looks the same, against the cell's own votes."""
PLANE_M = 0.15
"""How far two cells may lie off each other's plane."""
COLOUR = 15.0
"""How far apart colours of one surface may be, in levels of 8-bit L*a*b*."""


def diffused(votes: Votes, asked: Bools, place: Planes, normal: Planes, colour: Planes) -> Votes:
    """(n, classes): the votes of the cells asked for, in the order of `np.nonzero(asked)`, with their neighbours'.

    Args:
        votes: (h, w, classes) of all cells.
        asked: (h, w) the cells that are guessed, n of them; the others keep their votes.
        place: (h, w, 3) metres; where it is not finite, `votes` must be 0.
        normal: (h, w, 3) of unit length, or 0 where unknown, which is in every plane.
        colour: (h, w, 3) in L*a*b*, lightness as it shall count.
    """
    classes = votes.shape[-1]
    shares, at = votes.reshape(-1, classes).copy(), np.flatnonzero(asked)
    flat = [np.ascontiguousarray(part.reshape(-1, 3).T) for part in (place, normal, colour)]
    own = shares[at]
    for step in STEPS:
        total, weights = own.copy(), np.ones(len(at), np.float32)
        for here, beside in _neighbours(asked.shape, at, step):
            weight = _likeness(*((part[:, at[here]], part[:, beside]) for part in flat))
            weight *= shares[beside].any(axis=1)
            total[here] += weight[:, None] * shares[beside]
            weights[here] += weight
        shares[at] = total / weights[:, None]
    return shares[at]


def _neighbours(
    shape: tuple[int, ...], at: npt.NDArray[np.intp], step: int
) -> Iterator[tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]]:
    """For each of four directions: which of the cells `at` have a neighbour there, and that neighbour."""
    height, width = shape
    y, x = np.divmod(at, width)
    for down, right in ((0, step), (0, -step), (step, 0), (-step, 0)):
        inside = (y + down >= 0) & (y + down < height) & (x + right >= 0) & (x + right < width)
        here = np.flatnonzero(inside)
        yield here, at[here] + (down * width + right)


def _likeness(place: tuple[Planes, Planes], normal: tuple[Planes, Planes], colour: tuple[Planes, Planes]) -> Planes:
    """(n,) for pairs of (3, n): WEIGHT for one colour and plane, less for others; 0 where a place is unknown."""
    apart, other = place[1] - place[0], colour[1] - colour[0]
    off = np.maximum(*(np.abs(_dot(apart, one)) for one in normal)) / np.float32(PLANE_M)
    colours = _dot(other, other) / np.float32(COLOUR * COLOUR)
    return np.asarray(np.nan_to_num(np.float32(WEIGHT) * np.exp(-colours - off * off), copy=False), np.float32)


def _dot(one: Planes, other: Planes) -> Planes:
    """(n,) of two (3, n)."""
    return np.asarray(one[0] * other[0] + one[1] * other[1] + one[2] * other[2])
