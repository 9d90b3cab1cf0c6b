"""Labels for what no keyframe saw: those of the most similar points that keyframes did see.

Floors, walls and ceilings go on where the image of a keyframe ended, a chair looks like the chair beside it, and a
person keeps the colour of the clothes. So each point is described by place, height, direction of the surface and
colour, and takes the label that its nearest neighbours among the labelled points vote for, a neighbour at the distance
d with the weight 1 / (d + SOFT) (after Dudani 1976), and that those beside it on the same surface vote for. It is a
guess, never evidence: what it labels stays uncovered.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from stsem.classes import NO_LABEL, Labels
from stsem.frame import Image
from stsem.geometry.carried import Bools, Carried
from stsem.geometry.diffusion import Votes, diffused
from stsem.geometry.reproject import View

Features = npt.NDArray[np.float32]
"""(..., 9): place in the world, normal of the surface, colour in L*a*b*, each in units of its scale below."""

Direction = npt.NDArray[np.float64]

CELLS = 120
"""Points along the longer side of an image; a frame is described and guessed in cells, not pixels."""
EVERY = 2
"""Every so many cells of a keyframe become examples, along both sides."""
PLACE_M, HEIGHT_M, NORMAL, COLOUR = 1.0, 0.3, 0.5, 20.0
"""What counts as a distance of 1: metres, length of the difference of unit normals, levels of 8-bit L*a*b*."""
LIGHTNESS = 0.5
"""Weight of L* against a* and b*: shade tells less than colour."""
VOTERS = 5
SOFT = 0.1
SLACK = 0.5
"""A voter may be up to this share farther away than the true one: 0.2 % of the votes change, in a third of the time."""


@dataclass(frozen=True, eq=False)
class Cells:
    """What a frame looks like, cell by cell.

    Args:
        features: (h, w, 9) of the middle of each cell, the colour a mean over the cell.
        up: (3,) in the world, where the top of the image is.
        known: (h, w) bool: the middle has depth.
        side: pixels along a cell; the image may be up to side - 1 pixels wider and higher than all cells.
    """

    features: Features
    up: Direction
    known: Bools
    side: int

    def middles(self, values: npt.NDArray[np.generic]) -> npt.NDArray[np.generic]:
        """(h, w) of `values` (H, W) in the middle of each cell."""
        height, width = self.known.shape
        return values[self.side // 2 :: self.side, self.side // 2 :: self.side][:height, :width]

    def spread(self, values: Labels, shape: tuple[int, ...]) -> Labels:
        """(H, W) `shape` of `values` (h, w): each pixel takes that of its cell, the last ones that of the nearest."""
        height, width = self.known.shape[0] * self.side, self.known.shape[1] * self.side
        spread = cv2.resize(values, (width, height), interpolation=cv2.INTER_NEAREST_EXACT)
        below, right = shape[0] - height, shape[1] - width
        return np.asarray(cv2.copyMakeBorder(spread, 0, below, 0, right, cv2.BORDER_REPLICATE), np.uint8)


@dataclass(frozen=True, eq=False)
class Examples:
    """Points of a keyframe with their labels.

    Args:
        features: (n, 9).
        labels: (n,) uint8, none of them NO_LABEL.
        up: (3,) in the world, where the top of the image was.
    """

    features: Features
    labels: Labels
    up: Direction

    @classmethod
    def of(cls, cells: Cells, labels: Labels) -> "Examples":
        """Of a keyframe that looks like `cells`, with `labels` (H, W); persons too, who are told by their colour."""
        some = np.s_[EVERY // 2 :: EVERY, EVERY // 2 :: EVERY]
        at = np.asarray(cells.middles(labels), np.uint8)[some]
        usable = cells.known[some] & (at != NO_LABEL)
        return cls(cells.features[some][usable], at[usable], cells.up)


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
        """(n, classes) shares of the votes for `features` (n, 9); there must be at least one example.

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
        """(n, 10)."""
        x, y, z = np.sum([some.up for some in self.examples], axis=0)
        scale = PLACE_M / HEIGHT_M / max(float(np.sqrt(x * x + y * y + z * z)), 1e-6)
        height = features[:, 0] * (scale * x) + features[:, 1] * (scale * y) + features[:, 2] * (scale * z)
        return np.column_stack([features, height.astype(np.float32)])

    def __len__(self) -> int:
        return len(self._labels)


def described(view: View, image: Image) -> Cells:
    """The cells of a frame.

    Args:
        view: its depth, pose and camera.
        image: (H, W, 3) of the size of its depth.

    Raises:
        ValueError: they differ in size.
    """
    height, width = view.depth.shape
    if image.shape[:2] != (height, width):
        raise ValueError(f"the image {image.shape[:2]} must have the size of its depth {view.depth.shape}")
    side = max(1, min(round(max(height, width) / CELLS), height, width))
    rows, columns = height // side, width // side
    middle = np.s_[side // 2 :: side, side // 2 :: side]
    x, y = np.arange(columns) * side + side // 2, np.arange(rows) * side + side // 2
    depth = view.depth[middle][:rows, :columns]
    place = _placed(view, x.astype(np.float32)[None, :], y.astype(np.float32)[:, None], depth)
    colour = cv2.resize(image[: rows * side, : columns * side], (columns, rows), interpolation=cv2.INTER_AREA)
    lab = cv2.cvtColor(colour, cv2.COLOR_RGB2LAB).astype(np.float32) / np.float32(COLOUR)
    lab[..., 0] *= np.float32(LIGHTNESS)
    features = np.concatenate([place / np.float32(PLACE_M), _normals(place) / np.float32(NORMAL), lab], axis=2)
    return Cells(features, -view.T_WC[:3, 1], np.asarray(depth > 0, np.bool_), side)


def completed(answer: Carried, cells: Cells, likeness: Likeness) -> Carried:
    """`answer` with a guess for what it does not cover; where a cell has no depth, it stays as it is.

    The confidence of a guess is its share of the votes.

    Args:
        answer: of the size of the frame that `cells` describe.
        likeness: of the keyframes; without examples, nothing is guessed.
    """
    asked = cells.known & ~np.asarray(cells.middles(answer.covered), np.bool_)
    if not len(likeness) or not asked.any():
        return answer
    votes = _votes(answer, cells, likeness, asked)
    guessed, share = np.full(asked.shape, NO_LABEL, np.uint8), np.zeros(asked.shape, np.float32)
    guessed[asked], share[asked] = votes.argmax(axis=1), votes.max(axis=1)
    spread = cells.spread(guessed, answer.labels.shape)
    here = ((spread != NO_LABEL) & ~answer.covered).view(np.uint8)
    labels, confidence = answer.labels.copy(), answer.confidence
    cv2.copyTo(spread, here, labels)
    if confidence is not None:
        steps, confidence = cells.spread(np.rint(share * 255).astype(np.uint8), labels.shape), confidence.copy()
        cv2.copyTo(steps.astype(np.float32) / np.float32(255), here, confidence)
    return Carried(labels, confidence, answer.covered)


def _votes(answer: Carried, cells: Cells, likeness: Likeness, asked: Bools) -> Votes:
    """(n, classes) for the cells `asked` for: the votes of their likes, and of what lies beside them."""
    labels = np.asarray(cells.middles(answer.labels), np.uint8)
    seen = cells.known & ~asked & (labels != NO_LABEL)
    classes = max(likeness.classes, int(labels[seen].max(initial=0)) + 1)
    votes = np.zeros((*asked.shape, classes), np.float32)
    votes[seen, labels[seen]] = 1
    votes[asked] = likeness.votes(cells.features[asked], classes)
    place, normal, colour = (
        cells.features[..., first : first + 3] * np.float32(scale)
        for first, scale in ((0, PLACE_M), (3, NORMAL), (6, COLOUR))
    )
    return diffused(votes, asked, place, normal, colour)


def remembered(examples: Sequence[Examples]) -> Likeness:
    """All `examples` of keyframes as one memory."""
    return Likeness(tuple(examples))


def _placed(view: View, x: Features, y: Features, depth: npt.NDArray[np.float32]) -> Features:
    """(h, w, 3) metres in the world: X = R z K^-1 (u, v, 1) + t; not finite where depth is unknown."""
    ray = (view.T_WC[:3, :3] @ np.linalg.inv(view.camera.K)).astype(np.float32)
    known = np.where(depth > 0, depth, np.float32(np.nan))
    # Written out instead of a matrix product: BLAS may round differently with other thread counts.
    return np.stack(
        [(a * x + b * y + c) * known + np.float32(t) for (a, b, c), t in zip(ray, view.T_WC[:3, 3], strict=True)], -1
    )


def _normals(place: Features) -> Features:
    """(h, w, 3) unit normals, towards the camera; zero where a neighbour is unknown."""
    if min(place.shape[:2]) < 2:
        return np.zeros_like(place)
    down, right = np.gradient(place, axis=0), np.gradient(place, axis=1)
    (a, b, c), (d, e, f) = np.moveaxis(down, 2, 0), np.moveaxis(right, 2, 0)
    x, y, z = b * f - c * e, c * d - a * f, a * e - b * d
    length = np.sqrt(x * x + y * y + z * z)
    known = length > 0
    length[~known] = 1
    return np.asarray(
        np.stack([np.where(known, axis / length, np.float32(0)) for axis in (x, y, z)], axis=2), np.float32
    )
