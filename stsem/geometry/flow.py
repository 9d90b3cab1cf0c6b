"""Dense optical flow from each frame to the one before it, and chains of flows back to a keyframe.

Flow over the large distance to a keyframe collapses; between neighbouring frames it holds, so flows are chained:
M_t(x) = M_{t-1}(x + f_t(x)), where f_t points from frame t to frame t - 1 and M_0 is the identity at the keyframe.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import TypeVar

import cv2
import numpy as np
import numpy.typing as npt

from stsem.classes import Labels
from stsem.frame import Depth, Image
from stsem.geometry.carried import Bools, Carried
from stsem.geometry.packed import Rows, packed
from stsem.uncertainty import Confidence

Value = TypeVar("Value", np.uint8, np.float32)
Grey = npt.NDArray[np.uint8]
Field = npt.NDArray[np.float32]
"""(h, w, 2) float32: x and y at each pixel of the working image."""

WORKING_SIDE = 480
"""Longer side, in pixels, of the images between which flow is sought (docs/propagation.md has what others cost)."""


@dataclass(frozen=True)
class Search:
    """Settings of OpenCV's dense inverse search.

    Args:
        preset: one of cv2.DISOPTICAL_FLOW_PRESET_*.
        finest: the level of the pyramid that it ends at, 0 being the image itself; None as the preset has it. It
            decides more than the preset does (docs/propagation.md).
    """

    preset: int = cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST
    finest: int | None = 1


SEARCH = Search()
MIN_SIDE = 16
"""A smaller image has no room for a pyramid of patches; nothing is said to move there."""


def working_grey(image: Image, *, side: int = WORKING_SIDE) -> Grey:
    """(h, w) uint8: `image` (H, W, 3) in grey, its longer side at most `side` pixels."""
    height, width = image.shape[:2]
    scale = side / max(width, height)
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    if scale < 1:
        size = max(1, round(width * scale)), max(1, round(height * scale))
        grey = cv2.resize(grey, size, interpolation=cv2.INTER_AREA)
    return np.asarray(grey, np.uint8)


def backward_flow(current: Grey, previous: Grey, *, search: Search = SEARCH) -> Field:
    """Where each pixel of `current` was in `previous`, as an offset, by dense inverse search (Kroeger et al. 2016).

    Args:
        current, previous: (h, w) of one size; below MIN_SIDE the flow is zero.
        search: how it is sought.
    """
    if min(current.shape) < MIN_SIDE:
        return np.zeros((*current.shape, 2), np.float32)
    return np.asarray(_dense_inverse_search(search).calc(current, previous, None), np.float32)  # type: ignore[call-overload]


@dataclass(frozen=True, eq=False)
class Traced:
    """What flow says of some pixels.

    Args:
        rows: (n,) the pixels, counted row by row.
        labels: (n,) uint8.
        confidence: (n,) float32, or None.
        covered: (n,) bool: it rests on evidence.
    """

    rows: Rows
    labels: Labels
    confidence: Confidence | None
    covered: Bools


@dataclass(frozen=True, eq=False)
class Chain:
    """Where the pixels of the current frame were in a keyframe.

    Args:
        places: (h, w, 2) pixel of the keyframe's working image; at its nearest border for what came from outside.
        inside: (h, w) bool: no link of the chain left the image.
    """

    places: Field
    inside: Bools

    @classmethod
    def start(cls, grey: Grey) -> "Chain":
        """At the keyframe itself: the identity."""
        height, width = grey.shape
        return cls(_grid(width, height), np.ones(grey.shape, np.bool_))

    def extended(self, flow: Field) -> "Chain":
        """The chain one frame later: M_t(x) = M_{t-1}(x + flow(x)); bilinear between pixels.

        Args:
            flow: (h, w, 2) from the new frame to the one this chain ends at.
        """
        height, width = self.inside.shape
        step = _grid(width, height) + flow
        places = cv2.remap(self.places, step, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)  # type: ignore[call-overload]
        inside = cv2.remap(self.inside.view(np.uint8), step, None, cv2.INTER_NEAREST, borderValue=0)  # type: ignore[call-overload]
        return Chain(np.asarray(places, np.float32), np.asarray(inside, np.uint8).view(np.bool_))

    def carry(self, labels: Labels, confidence: Confidence | None, size: tuple[int, int]) -> Carried:
        """Labels and confidence of the keyframe as the current frame sees them, by nearest neighbour.

        What came into the image since gets the label of the border where it came in, and is not covered.

        Args:
            labels, confidence: (H, W) of the keyframe.
            size: (width, height) of the answer.
        """
        places = _full_size(self.places, labels.shape, size)
        sure = None if confidence is None else _fetched(confidence, places)
        inside = cv2.resize(self.inside.view(np.uint8), size, interpolation=cv2.INTER_NEAREST_EXACT)
        return Carried(_fetched(labels, places), sure, np.asarray(inside, np.uint8).view(np.bool_))

    def leads_to(self, classes: Bools, labels: Labels, size: tuple[int, int]) -> Bools:
        """(H, W) bool of `size` (W, H): where the chain leads to one of `classes`, or beside a pixel that does.

        By the pixels of the working image: what is thinner than one of them may be missed.

        Args:
            classes: (256,) bool by id.
            labels: (H, W) of the keyframe.
        """
        height, width = self.inside.shape
        scale = np.array([labels.shape[1] / width, labels.shape[0] / height], np.float32)
        there = classes.view(np.uint8)[_fetched(labels, _scaled(self.places, scale))]
        near = cv2.resize(cv2.dilate(there, np.ones((3, 3), np.uint8)), size, interpolation=cv2.INTER_NEAREST_EXACT)
        return np.asarray(near, np.uint8).view(np.bool_)

    def trace(
        self, rows: Rows, labels: Labels, confidence: Confidence | None, depths: tuple[Depth, Depth], *, within_m: float
    ) -> Traced:
        """What `carry` says of some pixels, but for rounding; covered where the chain ends about as far as it began.

        Flow that stuck to the edge of what moves ends on it, while the frame shows what it uncovered, farther away.
        Where either depth is unknown, it is not covered.

        Args:
            rows: (n,) of the answer, counted row by row.
            labels, confidence: (H, W) of the keyframe.
            depths: metres, (H, W) each: of the current frame and of the keyframe; the answer has the size of the first.
            within_m: how far a body may have come nearer or gone away.
        """
        if not len(rows):
            return Traced(rows, labels[:0, 0], None if confidence is None else confidence[:0, 0], np.zeros(0, np.bool_))
        (current, keyframe), (height, width) = depths, self.inside.shape
        some = packed(rows)
        y, x = np.divmod(some.astype(np.int32), np.int32(current.shape[1]))
        here = np.stack([_scaled(x, width / current.shape[1]), _scaled(y, height / current.shape[0])], axis=-1)
        at = cv2.remap(self.places, here, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)  # type: ignore[call-overload]
        places = _scaled(at, np.array([keyframe.shape[1] / width, keyframe.shape[0] / height], np.float32))
        inside = _fetched(self.inside.view(np.uint8), here).view(np.bool_)
        apart = np.abs(_fetched(keyframe, places) - current.reshape(-1)[some])
        count = np.s_[: len(rows)]
        sure = None if confidence is None else _fetched(confidence, places).reshape(-1)[count]
        covered = np.asarray(inside & (apart <= within_m)).reshape(-1)[count]
        return Traced(rows, _fetched(labels, places).reshape(-1)[count], sure, covered)


def _scaled(pixels: npt.NDArray[np.float32] | npt.NDArray[np.int32], scale: npt.NDArray[np.float32] | float) -> Field:
    """`pixels` of one image in those of another that is `scale` times as large; middles of pixels are whole numbers."""
    return np.asarray((pixels + np.float32(0.5)) * scale - np.float32(0.5), np.float32)


def _full_size(places: Field, shape: tuple[int, ...], size: tuple[int, int]) -> Field:
    """(H, W, 2) `places` for an answer of `size` (W, H), in pixels of a keyframe of `shape` (H, W)."""
    height, width = places.shape[:2]
    if (width, height) == size and (height, width) == shape[:2]:
        return places
    scale = np.array([shape[1] / width, shape[0] / height], np.float32)
    return np.asarray(cv2.resize(_scaled(places, scale), size, interpolation=cv2.INTER_LINEAR), np.float32)


def _fetched(values: npt.NDArray[Value], places: Field) -> npt.NDArray[Value]:
    fetched = cv2.remap(values, places, None, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)  # type: ignore[call-overload]
    return np.asarray(fetched, values.dtype)


@lru_cache(maxsize=3)
def _dense_inverse_search(search: Search) -> cv2.DISOpticalFlow:
    found = cv2.DISOpticalFlow.create(search.preset)
    if search.finest is not None:
        found.setFinestScale(search.finest)
    return found


@lru_cache(maxsize=4)
def _grid(width: int, height: int) -> Field:
    x, y = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    grid = np.ascontiguousarray(np.stack([x, y], axis=-1))
    grid.setflags(write=False)
    return grid
