"""What no keyframe saw: guessed from points that look alike, never called evidence."""

import numpy as np
import numpy.typing as npt
import pytest

from stsem.camera import Camera
from stsem.classes import NO_LABEL
from stsem.geometry.carried import Carried
from stsem.geometry.likeness import (
    EVERY,
    HEIGHT_M,
    PLACE_M,
    SOFT,
    VOTERS,
    Examples,
    Likeness,
    completed,
    described,
    remembered,
)
from stsem.geometry.reproject import View

CAMERA = Camera(123, 64, 60.0, 60.0, 61.0, 31.5)
SHAPE = (64, 123)
FLOOR, WALL, POSTER, BEFORE = 0, 1, 2, 7
GREY, RED = (128, 128, 128), (200, 20, 20)


def corner() -> View:
    """A wall 3 m ahead, and the floor 1 m below the camera."""
    rows = np.arange(64, dtype=np.float32)[:, None].repeat(123, axis=1)
    down = (rows - 31.5) / 60
    floor = np.where(down > 0, 1 / np.maximum(down, 1e-3), 9)
    return View(np.minimum(floor, 3).astype(np.float32), np.eye(4), CAMERA)


def room() -> tuple[View, npt.NDArray[np.uint8], npt.NDArray[np.uint8]]:
    """View, image and labels: floor and wall of one grey, a red poster at the left."""
    view = corner()
    labels = np.where(view.depth < 2.99, FLOOR, WALL).astype(np.uint8)
    image = np.full((*SHAPE, 3), GREY, np.uint8)
    labels[10:30, 20:40], image[10:30, 20:40] = POSTER, RED
    return view, image, labels


def unseen(covered: slice = slice(0)) -> Carried:
    """Nothing but `covered` columns is covered, and right; everything else is labelled BEFORE."""
    seen = np.zeros(SHAPE, np.bool_)
    seen[:, covered] = True
    return Carried(np.where(seen, room()[2], np.uint8(BEFORE)), None, seen)


def memory() -> Likeness:
    view, image, labels = room()
    return remembered([Examples.of(described(view, image), labels)])


def test_floor_and_wall_go_on_by_their_direction_and_the_poster_by_its_colour() -> None:
    """Two metres further right, hardly anything of which the keyframe saw; a second poster hangs there."""
    view, image, labels = room()
    beside = np.eye(4)
    beside[0, 3] = 2
    moved = View(view.depth, beside, CAMERA)
    answer = completed(unseen(), described(moved, image), memory())
    assert (answer.labels == labels).mean() > 0.97
    assert (answer.labels[12:28, 22:38] == POSTER).all()


def test_a_guess_is_not_covered_and_what_is_covered_stays() -> None:
    view, image, _ = room()
    before = unseen(slice(0, 50))
    answer = completed(before, described(view, image), memory())
    np.testing.assert_array_equal(answer.covered, before.covered)
    np.testing.assert_array_equal(answer.labels[:, :50], before.labels[:, :50])
    assert (answer.labels[:, 50:] != BEFORE).all()


def test_without_depth_or_examples_the_answer_stays() -> None:
    view, image, _ = room()
    depth = view.depth.copy()
    depth[:, 60:] = np.nan
    answer = completed(unseen(), described(View(depth, view.T_WC, CAMERA), image), memory())
    assert (answer.labels[:, 60:] == BEFORE).all()
    assert (answer.labels[:, :58] != BEFORE).all()
    nothing = completed(unseen(), described(view, image), remembered([]))
    assert (nothing.labels == BEFORE).all()


def test_the_vote_is_that_of_the_nearest_weighted_by_distance() -> None:
    """Against all distances, sorted."""
    rng = np.random.default_rng(5)
    features, labels = rng.normal(size=(300, 9)).astype(np.float32), rng.integers(0, 4, 300).astype(np.uint8)
    asked = rng.normal(size=(40, 9)).astype(np.float32)
    up = np.array([0.0, -0.8, 0.6])
    halves = [Examples(features[:90], labels[:90], up), Examples(features[90:], labels[90:], up)]
    found = Likeness(tuple(halves), slack=0).votes(asked, 4)
    apart = asked[:, None].astype(np.float64) - features
    height = apart[..., :3] @ up * PLACE_M / HEIGHT_M
    distances = np.sqrt((apart**2).sum(axis=2) + height**2)
    for i, row in enumerate(distances):
        nearest = np.argsort(row)[:VOTERS]
        votes = np.bincount(labels[nearest], 1 / (row[nearest] + SOFT), 4)
        assert found[i] == pytest.approx(votes / votes.sum())


def test_the_confidence_of_a_guess_is_its_share_of_the_votes() -> None:
    view, image, _ = room()
    before = unseen(slice(0, 50))
    sure = Carried(before.labels, np.full(SHAPE, 0.25, np.float32), before.covered)
    answer = completed(sure, described(view, image), memory())
    assert answer.confidence is not None
    assert (answer.confidence[:, :50] == 0.25).all()
    assert (answer.confidence[58:, 60:] == 1).all()
    assert (answer.confidence[50:54, 60:] < 1).all()  # where floor and wall meet


def test_examples_are_labelled_points_with_depth_and_fewer_voters_than_asked_for_will_do() -> None:
    view, image, labels = room()
    cells = described(view, image)
    assert len(Examples.of(cells, labels).labels) == (64 // EVERY) * (123 // EVERY)
    assert len(Examples.of(cells, np.full_like(labels, NO_LABEL)).labels) == 0
    one = np.full_like(labels, NO_LABEL)
    one[1, 1] = POSTER
    answer = completed(unseen(), cells, remembered([Examples.of(cells, one)]))
    assert (answer.labels == POSTER).all()


def test_an_image_of_another_size_is_refused() -> None:
    view, image, _ = room()
    with pytest.raises(ValueError, match="size of its depth"):
        described(view, image[:-1])


@pytest.mark.parametrize("size", [(1, 1), (2, 3), (121, 3), (250, 187), (960, 540)])
def test_cells_of_any_size_cover_the_image(size: tuple[int, int]) -> None:
    """The last pixels, where the side of a cell does not divide the image, take the label of the nearest cell."""
    width, height = size
    camera = Camera(width, height, 60.0, 60.0, width / 2, height / 2)
    view, image = View(np.ones((height, width), np.float32), np.eye(4), camera), np.zeros((height, width, 3), np.uint8)
    cells = described(view, image)
    spread = cells.spread(np.full(cells.known.shape, 3, np.uint8), (height, width))
    assert spread.shape == (height, width)
    assert (spread == 3).all()
    assert max(cells.known.shape) <= 2 * 120
