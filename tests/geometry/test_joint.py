"""Labels of cells, spread over pixels: edges are found, and what is known is left alone."""

import numpy as np
import numpy.typing as npt
import pytest

from stsem.camera import Camera
from stsem.chance import generator
from stsem.classes import NO_LABEL, Labels
from stsem.frame import Depth, Image
from stsem.geometry.carried import Draft
from stsem.geometry.cells import Cells, described, lightened
from stsem.geometry.joint import COLOUR, DEPTH, FARTHEST, Guess, spread
from stsem.geometry.reproject import View

LEFT, RIGHT, BEFORE = 1, 2, 7
WIDTH, HEIGHT, SIDE = 480, 16, 4
GREY, RED, BLUE = (128, 128, 128), (200, 20, 20), (20, 20, 200)
EDGES = range(240, 240 + SIDE)
"""Columns at which the right half starts: every place of an edge within a cell."""


def cells_of(image: Image, depth: Depth) -> Cells:
    height, width = depth.shape
    return described(View(depth, np.eye(4), Camera(width, height, 300.0, 300.0, width / 2, height / 2)), image)


def flat(*, width: int = WIDTH, height: int = HEIGHT) -> tuple[Image, Depth]:
    """A grey wall, 2 m off."""
    return np.full((height, width, 3), GREY, np.uint8), np.full((height, width), 2, np.float32)


def halves(edge: int) -> Labels:
    return np.where(np.arange(WIDTH) < edge, LEFT, RIGHT).astype(np.uint8)[None].repeat(HEIGHT, axis=0)


def coloured(edge: int) -> tuple[Image, Depth]:
    """Red to the left of `edge`, blue to the right, on one plane."""
    image, depth = flat()
    image[:, :edge], image[:, edge:] = RED, BLUE
    return image, depth


def by_middles(cells: Cells, labels: Labels, confidence: float = 1) -> Guess:
    """A guess that is right in the middle of each cell."""
    found = np.asarray(cells.middles(labels), np.uint8)
    return Guess(found, np.full(found.shape, confidence, np.float32), cells)


def blank(depth: Depth, *, sure: bool = False) -> Draft:
    return Draft.blank(depth.shape, sure=sure)


def code(labels: Labels) -> npt.NDArray[np.float32]:
    return (labels / 256).astype(np.float32)


@pytest.mark.parametrize("edge", EDGES)
def test_an_edge_of_colour_is_found_to_the_pixel(edge: int) -> None:
    """Upright and lying; in the middle of a cell, too, whose own colour is a mixture."""
    image, depth = coloured(edge)
    for turned in (False, True):
        labels = halves(edge).T if turned else halves(edge)
        shown, far = (image.swapaxes(0, 1).copy(), depth.T.copy()) if turned else (image, depth)
        draft = blank(far)
        spread(by_middles(cells_of(shown, far), labels), draft)
        np.testing.assert_array_equal(draft.labels, labels)


@pytest.mark.parametrize("edge", EDGES)
@pytest.mark.parametrize("behind", [2.15, 3.0, 9.0])
def test_an_edge_of_depth_is_found_to_the_pixel_where_the_colour_is_the_same(edge: int, behind: float) -> None:
    image, depth = flat()
    depth[:, edge:] = behind
    for far in (depth, depth[:, ::-1].copy()):
        labels = np.where(far == 2, LEFT, RIGHT).astype(np.uint8)
        draft = blank(far)
        spread(by_middles(cells_of(image, far), labels), draft)
        np.testing.assert_array_equal(draft.labels, labels)


def test_pixels_without_depth_stay_open() -> None:
    """Unknown by NaN or 0; those beside them are filled in."""
    image, depth = coloured(241)
    holes = generator(0, "holes").random(depth.shape)
    depth[holes < 0.2], depth[holes > 0.8] = np.nan, 0
    labels, draft = halves(241), blank(depth, sure=True)
    assert draft.confidence is not None
    spread(by_middles(cells_of(image, depth), labels), draft)
    np.testing.assert_array_equal(draft.labels, np.where(depth > 0, labels, NO_LABEL))
    np.testing.assert_array_equal(draft.confidence, (depth > 0).astype(np.float32))


def test_what_is_said_already_is_not_touched() -> None:
    """Neither its label nor its confidence; nothing that is filled in becomes evidence."""
    image, depth = coloured(241)
    before, draft = generator(0, "before").random(depth.shape) < 0.4, blank(depth, sure=True)
    assert draft.confidence is not None
    draft.labels[before], draft.confidence[before], draft.covered[before] = BEFORE, 0.25, True
    spread(by_middles(cells_of(image, depth), halves(241), confidence=0.75), draft)
    np.testing.assert_array_equal(draft.labels, np.where(before, BEFORE, halves(241)))
    np.testing.assert_array_equal(draft.confidence, np.where(before, np.float32(0.25), np.float32(0.75)))
    np.testing.assert_array_equal(draft.covered, before)


def test_a_cell_without_a_label_is_never_chosen_if_another_has_one() -> None:
    """However alike it looks; among cells without any, the pixel stays open."""
    image, depth = coloured(240)
    cells, draft = cells_of(image, depth), blank(depth)
    labels = np.asarray(cells.middles(halves(240)), np.uint8)
    labels[labels == RIGHT] = NO_LABEL
    spread(Guess(labels, np.ones(labels.shape, np.float32), cells), draft)
    last = 240 + SIDE // 2  # where the quad of the last labelled cell ends
    assert (draft.labels[:, :last] == LEFT).all()
    assert (draft.labels[:, last:] == NO_LABEL).all()


def test_the_confidence_is_that_of_the_cell_whose_label_is_taken() -> None:
    """Coded so that it tells the label."""
    rng = generator(0, "confidence")
    (image, depth), draft = flat(), Draft.blank((HEIGHT, WIDTH), sure=True)
    image[:] = rng.integers(0, 256, image.shape, np.uint8)
    labels = rng.integers(0, 5, (HEIGHT // SIDE, WIDTH // SIDE)).astype(np.uint8)
    spread(Guess(labels, code(labels), cells_of(image, depth)), draft)
    assert draft.confidence is not None
    assert set(np.unique(draft.labels)) == set(range(5))
    np.testing.assert_array_equal(draft.confidence, code(draft.labels))


def test_it_is_what_a_loop_over_pixels_gives() -> None:
    """Random cells of 3 pixels, the last row and column cut off, holes in the depth and in the labels."""
    rng, (width, height, side) = generator(0, "joint"), (364, 23, 3)
    image = rng.integers(0, 256, (height, width, 3), np.uint8)
    depth = (1 + rng.random((height, width))).astype(np.float32)
    depth[rng.random(depth.shape) < 0.1] = np.nan
    cells = cells_of(image, depth)
    shape = cells.known.shape
    assert (cells.side, *shape) == (side, 7, 121)
    labels = rng.integers(0, 4, shape).astype(np.uint8)
    labels[rng.random(shape) < 0.2] = NO_LABEL
    guess, draft = Guess(labels, rng.random(shape, np.float32), cells), Draft.blank(depth.shape, sure=True)
    expected, colours = draft.labels.copy(), lightened(image).astype(np.float64)
    sure = np.zeros(depth.shape, np.float32)
    for v, u in np.argwhere(depth > 0):
        top, left = (v - side // 2) // side, (u - side // 2) // side
        around = [
            (min(max(y, 0), shape[0] - 1), min(max(x, 0), shape[1] - 1))
            for y in (top, top + 1)
            for x in (left, left + 1)
        ]
        named = [cell for cell in around if labels[cell] != NO_LABEL]
        if not named:
            continue
        best = named[0]
        if len({int(labels[cell]) for cell in around}) > 1:
            costs = [
                (((cells.colour[cell] - colours[v, u]) / COLOUR) ** 2).sum() + unlike(cells.depth[cell], depth[v, u])
                for cell in named
            ]
            best = named[int(np.argmin(costs))]
        expected[v, u], sure[v, u] = labels[best], guess.confidence[best]
    spread(guess, draft)
    assert draft.confidence is not None
    np.testing.assert_array_equal(draft.labels, expected)
    told = expected != NO_LABEL
    np.testing.assert_array_equal(draft.confidence[told], sure[told])


def unlike(cell: float, pixel: float) -> float:
    """What a difference in depth costs; that of an unknown one is 1."""
    return 1.0 if np.isnan(cell) else min(abs(float(cell) / float(pixel) - 1) / DEPTH, FARTHEST) ** 2


@pytest.mark.parametrize("size", [(1, 1), (2, 3), (121, 3), (3, 300), (250, 187), (963, 21)])
def test_an_image_of_any_size_is_filled_in(size: tuple[int, int]) -> None:
    """The last pixels, where the side of a cell does not divide the image, by the last cells."""
    image, depth = flat(width=size[0], height=size[1])
    cells = cells_of(image, depth)
    rows, columns = cells.known.shape
    corner = np.zeros((rows, columns), np.uint8)
    corner[-1, -1] = 3
    last = np.s_[(rows - 1) * cells.side + cells.side // 2 :, (columns - 1) * cells.side + cells.side // 2 :]
    for labels, at in ((np.full_like(corner, 3), np.s_[:, :]), (corner, last)):
        draft = blank(depth)
        spread(Guess(labels, np.ones(labels.shape, np.float32), cells), draft)
        assert not draft.open.any()
        assert draft.labels[at].size
        assert (draft.labels[at] == 3).all()
