"""Labels of cells, spread over the pixels between them along the edges of the image.

A pixel lies between the middles of four cells. Where they agree, it takes their label; where they differ, that of the
cell that it resembles most in colour and depth (after the joint bilateral upsampling of Kopf et al. 2007, with the best
of the four instead of their mean, since labels have none).
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from stsem.classes import NO_LABEL, Labels
from stsem.geometry.carried import Draft
from stsem.geometry.cells import Cells, lightened
from stsem.geometry.packed import Rows
from stsem.uncertainty import Confidence

COLOUR = 15.0
"""How far apart in colour, in levels of 8-bit L*a*b*, counts as much as DEPTH."""
DEPTH = 0.1
"""How far apart in depth, as a share of the distance, counts as much as COLOUR."""
FARTHEST = 4.0
"""Depths farther apart than this many times DEPTH count as much as that."""
CORNERS = ((0, 0), (0, 1), (1, 0), (1, 1))
"""(down, right) of the four cells around a pixel."""


@dataclass(frozen=True, eq=False)
class Guess:
    """What is said of each cell.

    Args:
        labels: (h, w) uint8 of the middle, NO_LABEL where nothing is.
        confidence: (h, w).
        cells: they look like this.
    """

    labels: Labels
    confidence: Confidence
    cells: Cells


def spread(guess: Guess, draft: Draft) -> None:
    """Fill in the pixels with depth that are open by the cells around them.

    Args:
        guess: for the cells of the frame.
        draft: of the size of the frame.
    """
    left = draft.left()
    at = left[guess.cells.view.depth.reshape(-1).take(left) > 0]
    quads = _quads(guess.labels.shape)
    quad = _quad_of_pixels(guess.labels.shape, guess.cells.side, draft.labels.shape)[at]
    corners, alike = guess.labels.reshape(-1)[quads], np.zeros(len(at), np.intp)
    differ = np.flatnonzero((corners != corners[:1]).any(axis=0)[quad])
    alike[differ] = _most_alike(at[differ], quads[:, quad[differ]], guess)
    draft.labels.reshape(-1)[at] = corners[alike, quad]
    if draft.confidence is not None:
        draft.confidence.reshape(-1)[at] = guess.confidence.reshape(-1)[quads[alike, quad]]


@lru_cache(maxsize=4)
def _quads(shape: tuple[int, int]) -> Rows:
    """(4, (h + 1) (w + 1)) the cells of a grid of `shape` (h, w) around each of its corners, counted row by row."""
    height, width = shape
    row, column = np.arange(height + 1)[:, None], np.arange(width + 1)
    return np.stack([
        (np.clip(row - 1 + down, 0, height - 1) * width + np.clip(column - 1 + right, 0, width - 1)).reshape(-1)
        for down, right in CORNERS
    ])  # fmt: skip


@lru_cache(maxsize=4)
def _quad_of_pixels(shape: tuple[int, int], side: int, pixels: tuple[int, int]) -> Rows:
    """(H W,) between which four middles of a grid of `shape`, `side` pixels a cell, each pixel lies."""
    y, x = (
        np.clip((np.arange(along) - side // 2) // side + 1, 0, number)
        for along, number in zip(pixels, shape, strict=True)
    )
    return np.asarray((y[:, None] * (shape[1] + 1) + x).reshape(-1))


def _most_alike(at: Rows, around: Rows, guess: Guess) -> Rows:
    """(n,) which of the cells `around` (4, n) each pixel `at` (n,) resembles most, of those that have a label."""
    cells = guess.cells
    if not len(at):
        return np.zeros(0, np.intp)
    colour, depth = lightened(cells.image.reshape(-1, 3)[at][:, None])[:, 0], cells.view.depth.reshape(-1)[at]
    costs = np.empty(around.shape, np.float32)
    for cost, cell in zip(costs, around, strict=True):
        apart = (cells.colour.reshape(-1, 3)[cell] - colour) / np.float32(COLOUR)
        behind = np.abs(cells.depth.reshape(-1)[cell] / depth - 1) / np.float32(DEPTH)
        np.minimum(np.nan_to_num(behind, copy=False, nan=1.0), FARTHEST, out=behind)
        cost[:] = (apart * apart).sum(axis=1) + behind * behind
    costs[guess.labels.reshape(-1)[around] == NO_LABEL] = np.inf
    return np.asarray(costs.argmin(axis=0))
