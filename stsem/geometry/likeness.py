"""Labels for what no keyframe saw: those of the most similar points that keyframes did see.

Floors, walls and ceilings go on where the image of a keyframe ended, a chair looks like the chair beside it, and a
person keeps the colour of the clothes. So each cell is described by place, height, direction of the surface, colour and
texture, and takes the label that its nearest neighbours among the labelled cells vote for, a neighbour at the distance
d with the weight 1 / (d + SOFT) (after Dudani 1976), and that those beside it on the same surface vote for. It is a
guess, never evidence: what it labels stays uncovered.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from stsem.classes import NO_LABEL, Labels
from stsem.geometry.carried import Bools, Draft
from stsem.geometry.cells import Cells, Direction
from stsem.geometry.diffusion import Votes, diffused
from stsem.geometry.joint import Guess, spread
from stsem.geometry.reproject import View, looked_past

Features = npt.NDArray[np.float32]
"""(..., 10) float32: place in the world, normal of the surface, colour, texture, each in units of its scale below."""
Cubes = npt.NDArray[np.int64]

SPACING_M = 0.2
"""Of the examples in one cube of this side, only those of the newest keyframe that has some there are kept."""
MOST = 40_000
"""Examples of keyframes before the newest one: the time for the search tree grows with them."""
PLACE_M, HEIGHT_M, NORMAL = 4.0, 0.15, 1.2
"""What counts as a distance of 1: metres, length of the difference of unit normals."""
LIGHTNESS, COLOUR = 12.5, 3.2
"""The same for colour, in levels of 8-bit L*a*b*, L* as `Cells` weigh it: much the most telling of all."""
TEXTURE = 0.6
"""The same for the logarithm of one plus the standard deviation of grey within a cell."""
CLEARANCE_M = 0.3
"""How much farther a keyframe must have seen, for what is now there to have come since."""
NOBODY = 1e-3
"""Votes that each moving class has anyway, if no example of one resembles what came."""
VOTERS = 3
SOFT = 0.1
SLACK = 0.5
"""A voter may be up to this share farther away than the true one: 0.2 % of the votes change, in a third of the time."""


@dataclass(frozen=True, eq=False)
class Examples:
    """Points of a keyframe with their labels.

    Args:
        features: (n, 10).
        labels: (n,) uint8, none of them NO_LABEL.
        cubes: (n,) in which cube of space each of them is.
        up: (3,) in the world, where the top of the image was.
    """

    features: Features
    labels: Labels
    cubes: Cubes
    up: Direction

    @classmethod
    def of(cls, cells: Cells, labels: Labels) -> "Examples":
        """Of a keyframe that looks like `cells`, with `labels` (H, W); persons too, who are told by their colour."""
        at = np.asarray(cells.middles(labels), np.uint8)
        usable = cells.known & (at != NO_LABEL)
        return cls(features_of(cells, usable), at[usable], _cubes(cells.place[usable]), cells.up)

    def every(self, nth: int) -> "Examples":
        """Every `nth` of them."""
        return Examples(self.features[::nth], self.labels[::nth], self.cubes[::nth], self.up)

    def without(self, newer: "Examples") -> "Examples":
        """Those in cubes where `newer` has none."""
        stay = np.isin(self.cubes, newer.cubes, invert=True)
        return Examples(self.features[stay], self.labels[stay], self.cubes[stay], self.up)


@dataclass(frozen=True, eq=False)
class Likeness:
    """Examples of any number of keyframes, to be asked for the nearest. The first question builds the search tree.

    Up is the mean over the keyframes, since no log says where it is and cameras are seldom upside down.

    Args:
        examples: of the keyframes.
        slack: how much farther away than the true voters those found may be, as a share; 0 for an exact search.
    """

    examples: tuple[Examples, ...]
    slack: float = SLACK

    def votes(self, features: Features, classes: int) -> Votes:
        """(n, classes) shares of the votes for `features` (n, 10); there must be at least one example.

        Args:
            features: of the points asked for.
            classes: more than any label of an example.
        """
        labels = self._labels
        voters = np.arange(1, 1 + min(VOTERS, len(labels)))
        found = self._tree.query(self._with_height(features), k=voters, eps=self.slack)
        distances, nearest = np.asarray(found[0], np.float64), np.asarray(found[1], np.intp)
        weights, voted = 1 / (distances + SOFT), labels[nearest]
        votes, each = np.zeros((len(features), classes)), np.arange(len(features))
        for weight, label in zip(weights.T, voted.T, strict=True):
            votes[each, label] += weight
        return np.asarray(votes / weights.sum(axis=1, keepdims=True), np.float32)

    @property
    def classes(self) -> int:
        """One more than the highest label of the examples."""
        return int(self._labels.max(initial=0)) + 1

    @cached_property
    def _labels(self) -> Labels:
        return np.concatenate([np.empty(0, np.uint8), *(some.labels for some in self.examples)])

    @cached_property
    def _tree(self) -> cKDTree:
        features = np.concatenate([some.features for some in self.examples])
        return cKDTree(self._with_height(features), balanced_tree=False)

    def _with_height(self, features: Features) -> Features:
        """(n, 11)."""
        x, y, z = np.sum([some.up for some in self.examples], axis=0)
        scale = PLACE_M / HEIGHT_M / max(float(np.sqrt(x * x + y * y + z * z)), 1e-6)
        height = features[:, 0] * (scale * x) + features[:, 1] * (scale * y) + features[:, 2] * (scale * z)
        return np.column_stack([features, height.astype(np.float32)])

    def __len__(self) -> int:
        return len(self._labels)


@dataclass(frozen=True, eq=False)
class Movers:
    """What stands where a keyframe saw past must have come since: it is of a class that moves by itself.

    Args:
        moving: (256,) bool: the ids of these classes.
        keyframe: a recent one; None if there is none.
    """

    moving: Bools
    keyframe: View | None

    @property
    def classes(self) -> int:
        """One more than the highest id."""
        return int(np.flatnonzero(self.moving).max(initial=-1)) + 1

    def only(self, votes: Votes, cells: Cells, asked: Bools) -> Votes:
        """`votes` (n, classes) of the cells `asked` for, of what has come those for moving classes alone."""
        if self.keyframe is None or not self.moving.any():
            return votes
        came = looked_past(cells.view, self.keyframe, cells.pixels(asked), clearance_m=CLEARANCE_M)
        moving = self.moving[: votes.shape[1]]
        theirs, found = (votes[came] + NOBODY) * moving, votes.copy()
        found[came] = theirs / theirs.sum(axis=1, keepdims=True)
        return found


def features_of(cells: Cells, some: Bools) -> Features:
    """(n, 10) of the n true of `some` (h, w)."""
    scale = np.array([1 / LIGHTNESS, 1 / COLOUR, 1 / COLOUR], np.float32)
    return np.column_stack([
        cells.place[some] / np.float32(PLACE_M), cells.normal[some] / np.float32(NORMAL), cells.colour[some] * scale,
        np.log1p(cells.texture[some]) / np.float32(TEXTURE),
    ])  # fmt: skip


def guess(draft: Draft, cells: Cells, likeness: Likeness, movers: Movers) -> None:
    """Fill in what is open with a guess; pixels without depth stay open.

    The confidence of a guess is its share of the votes, or that of the labelled cell that it is taken from.

    Args:
        draft: of the size of the frame.
        cells: of the frame.
        likeness: of the keyframes; without examples, nothing is guessed.
        movers: what cannot have stood there before.
    """
    labels = np.asarray(cells.middles(draft.labels), np.uint8)
    asked = cells.known & (labels == NO_LABEL)
    if not len(likeness):
        return
    labels, sure = labels.copy(), np.zeros(asked.shape, np.float32)
    if draft.confidence is not None:
        sure[:] = cells.middles(draft.confidence)
    if asked.any():
        votes = _votes(labels, cells, likeness, movers, asked)
        labels[asked], sure[asked] = votes.argmax(axis=1), votes.max(axis=1)
    spread(Guess(labels, sure, cells), draft)


def _votes(labels: Labels, cells: Cells, likeness: Likeness, movers: Movers, asked: Bools) -> Votes:
    """(n, classes) for the cells `asked` for: the votes of their likes, and of what lies beside them."""
    seen = cells.known & (labels != NO_LABEL)
    classes = max(likeness.classes, movers.classes, int(labels[seen].max(initial=0)) + 1)
    votes = np.zeros((*asked.shape, classes), np.float32)
    votes[seen, labels[seen]] = 1
    votes[asked] = movers.only(likeness.votes(features_of(cells, asked), classes), cells, asked)
    return diffused(votes, asked, cells.place, cells.normal, cells.colour)


def remembered(examples: Sequence[Examples]) -> Likeness:
    """`examples` of keyframes, the newest first, as one memory; of the older ones every nth, as many as MOST allows."""
    older = sum(len(some.labels) for some in examples[1:])
    every = max(1, -(-older // MOST))
    return Likeness((*examples[:1], *(some.every(every) for some in examples[1:])))


def _cubes(places: Features) -> Cubes:
    """(n,) a number for the cube of SPACING_M that each of `places` (n, 3), metres, is in: 21 bits an axis."""
    x, y, z = np.floor(places.T.astype(np.float64) / SPACING_M).astype(np.int64) & 0x1FFFFF
    return np.asarray(x << 42 | y << 21 | z)
