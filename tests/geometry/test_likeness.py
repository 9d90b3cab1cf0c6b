"""What no keyframe saw: guessed from points that look alike, never called evidence."""

import numpy as np
import numpy.typing as npt
import pytest

from stsem.camera import Camera
from stsem.chance import generator
from stsem.classes import NO_LABEL, Labels
from stsem.frame import Image
from stsem.geometry.carried import Bools, Draft
from stsem.geometry.cells import Cells, described
from stsem.geometry.likeness import (
    CLEARANCE_M,
    HEIGHT_M,
    PLACE_M,
    SOFT,
    SPACING_M,
    VOTERS,
    Examples,
    Likeness,
    Movers,
    guess,
    remembered,
)
from stsem.geometry.reproject import View

CAMERA = Camera(246, 128, 120.0, 120.0, 122.0, 63.0)
SHAPE, CELLS = (128, 246), (64, 123)
FLOOR, WALL, POSTER, PERSON, DOG, BEFORE = 0, 1, 2, 5, 6, 7
GREY, RED = (128, 128, 128), (200, 20, 20)
UP = np.array([0.0, -1.0, 0.0])


def corner() -> View:
    """A wall 3 m ahead, and the floor 1 m below the camera."""
    down = (np.arange(128, dtype=np.float32)[:, None].repeat(246, axis=1) - 63) / 120
    floor = np.where(down > 0, 1 / np.maximum(down, 1e-3), 9)
    return View(np.minimum(floor, 3).astype(np.float32), np.eye(4), CAMERA)


def room() -> tuple[View, Image, Labels]:
    """View, image and labels: floor and wall of one grey, a red poster at the left."""
    view = corner()
    labels = np.where(view.depth < 2.99, FLOOR, WALL).astype(np.uint8)
    image = np.full((*SHAPE, 3), GREY, np.uint8)
    labels[20:60, 40:80], image[20:60, 40:80] = POSTER, RED
    return view, image, labels


def said(columns: slice = slice(0)) -> Draft:
    """All is open, but for `columns`, which are covered and labelled BEFORE with a confidence of 0.25."""
    draft = Draft.blank(SHAPE, sure=True)
    assert draft.confidence is not None
    draft.labels[:, columns], draft.confidence[:, columns], draft.covered[:, columns] = BEFORE, 0.25, True
    return draft


def memory() -> Likeness:
    view, image, labels = room()
    return remembered([Examples.of(described(view, image), labels)])


def moving(*classes: int) -> Bools:
    table = np.zeros(256, np.bool_)
    table[list(classes)] = True
    return table


NOBODY_MOVES = Movers(moving(), None)


def examples(features: npt.NDArray[np.float32], labels: Labels, up: npt.NDArray[np.float64] = UP) -> Examples:
    return Examples(features, labels, np.arange(len(labels)), up)


def at(places: npt.NDArray[np.float32], labels: Labels) -> Examples:
    """Examples at `places` (n, 3), metres."""
    row, n = places[None], len(places)
    view = View(np.ones((1, n), np.float32), np.eye(4), Camera(n, 1, 1.0, 1.0, 0.0, 0.0))
    looks, texture = np.zeros_like(row), np.zeros((1, n), np.float32)
    return Examples.of(Cells(row, looks, looks, texture, view, np.zeros((1, n, 3), np.uint8), 1), labels[None])


def test_floor_and_wall_go_on_by_their_direction_and_the_poster_by_its_colour() -> None:
    """Two metres further right, hardly anything of which the keyframe saw; a second poster hangs there."""
    view, image, labels = room()
    beside, draft = np.eye(4), said()
    beside[0, 3] = 2
    guess(draft, described(View(view.depth, beside, CAMERA), image), memory(), NOBODY_MOVES)
    assert (draft.labels == labels).mean() > 0.97
    assert (draft.labels[20:60, 40:80] == POSTER).all()


def test_walls_of_one_colour_and_height_go_on_by_their_direction_alone() -> None:
    """A corner 5 m beside that of the keyframe, whose nearest points are of the wrong wall."""
    ray = (np.arange(246) - 122)[None].repeat(128, axis=0) / 120
    side = np.where(ray > 0, 2 / np.maximum(ray, 1e-3), 9)
    depth, image = np.minimum(side, 3).astype(np.float32), np.full((*SHAPE, 3), GREY, np.uint8)
    labels, beside, draft = np.where(side < 3, POSTER, WALL).astype(np.uint8), np.eye(4), said()
    beside[0, 3] = 5
    keyframe = Examples.of(described(View(depth, np.eye(4), CAMERA), image), labels)
    guess(draft, described(View(depth, beside, CAMERA), image), remembered([keyframe]), NOBODY_MOVES)
    assert (draft.labels == labels).mean() > 0.97


def test_what_is_covered_votes_for_what_lies_beside_it_on_its_surface() -> None:
    """Against examples that are all of one label; neither on the poster, which is of another colour, nor far away."""
    view, image, labels = room()
    draft, cells = said(slice(100, 140)), described(view, image)
    guess(draft, cells, remembered([examples(np.zeros((3, 10), np.float32), np.full(3, WALL, np.uint8))]), NOBODY_MOVES)
    assert (draft.labels[4:96, 99] == BEFORE).all()
    assert (draft.labels[4:96, 140] == BEFORE).all()
    assert (draft.labels[labels == POSTER] == WALL).all()
    assert (draft.labels[:, 240:] == WALL).all()


def test_a_guess_is_not_covered_and_what_is_covered_stays() -> None:
    view, image, _ = room()
    draft, before = said(slice(0, 100)), said(slice(0, 100))
    guess(draft, described(view, image), memory(), NOBODY_MOVES)
    np.testing.assert_array_equal(draft.covered, before.covered)
    np.testing.assert_array_equal(draft.labels[:, :100], before.labels[:, :100])
    assert not draft.open.any()


def test_without_depth_or_examples_it_stays_open() -> None:
    view, image, _ = room()
    depth, draft = view.depth.copy(), said()
    depth[:, 120:] = np.nan
    guess(draft, described(View(depth, view.T_WC, CAMERA), image), memory(), NOBODY_MOVES)
    np.testing.assert_array_equal(draft.open, ~(depth > 0))
    nothing = said()
    guess(nothing, described(view, image), remembered([]), NOBODY_MOVES)
    assert nothing.open.all()


def test_the_vote_is_that_of_the_nearest_weighted_by_distance() -> None:
    """Against all distances, sorted; height is along the mean of the ups."""
    rng = generator(5, "votes")
    features, labels = rng.normal(size=(300, 10)).astype(np.float32), rng.integers(0, 4, 300).astype(np.uint8)
    asked, ups = rng.normal(size=(40, 10)).astype(np.float32), (np.array([0.0, -1.0, 0.0]), np.array([0.0, -0.6, 0.8]))
    halves = [examples(features[:90], labels[:90], ups[0]), examples(features[90:], labels[90:], ups[1])]
    found = Likeness(tuple(halves), slack=0).votes(asked, 6)
    apart, up = asked[:, None].astype(np.float64) - features, sum(ups) / np.linalg.norm(sum(ups))
    distances = np.sqrt((apart**2).sum(axis=2) + (apart[..., :3] @ up * PLACE_M / HEIGHT_M) ** 2)
    for votes, row in zip(found, distances, strict=True):
        nearest = np.argsort(row)[:VOTERS]
        expected = np.bincount(labels[nearest], 1 / (row[nearest] + SOFT), 6)
        assert votes == pytest.approx(expected / expected.sum(), rel=1e-4)


def test_the_confidence_of_a_guess_is_its_share_of_the_votes() -> None:
    """Sure on the floor, less where floor and wall meet; two of three voters that all look the same are two thirds."""
    view, image, _ = room()
    draft, some, cells = said(), said(slice(0, 100)), described(view, image)
    for one in (draft, some):
        guess(one, cells, memory(), NOBODY_MOVES)
    assert draft.confidence is not None
    assert some.confidence is not None
    assert (some.confidence[:, :100] == 0.25).all()
    assert (draft.confidence[120:, 120:] > 0.95).all()
    assert (draft.confidence[100:106, 120:].min(axis=0) < 0.8).all()
    split, three = said(), examples(np.zeros((3, 10), np.float32), np.array([WALL, POSTER, WALL], np.uint8))
    guess(split, cells, remembered([three]), NOBODY_MOVES)
    assert (split.labels == WALL).all()
    assert split.confidence == pytest.approx(2 / 3)
    unsure = Draft.blank(SHAPE, sure=False)
    guess(unsure, cells, remembered([three]), NOBODY_MOVES)
    np.testing.assert_array_equal(unsure.labels, split.labels)
    assert unsure.confidence is None


def test_examples_are_labelled_points_with_depth_and_fewer_voters_than_asked_for_will_do() -> None:
    view, image, labels = room()
    cells, draft = described(view, image), said()
    assert len(Examples.of(cells, labels).labels) == CELLS[0] * CELLS[1]
    assert len(Examples.of(cells, np.full_like(labels, NO_LABEL)).labels) == 0
    depth = view.depth.copy()
    depth[:, 10:] = np.nan
    few = Examples.of(described(View(depth, view.T_WC, CAMERA), image), labels)
    assert len(few.features) == len(few.labels) == len(few.cubes) == CELLS[0] * 5
    one = np.full_like(labels, NO_LABEL)
    one[1, 1] = POSTER
    guess(draft, cells, remembered([Examples.of(cells, one)]), NOBODY_MOVES)
    assert (draft.labels == POSTER).all()


def test_an_older_keyframe_loses_its_examples_in_cubes_where_a_newer_one_has_some() -> None:
    """Exactly those, on both sides of the origin; a cube is told by all three axes."""
    rng = generator(0, "cubes")
    places, newer = ((rng.random((n, 3), np.float32) - 0.5) * 1.2 for n in (400, 90))
    labels = rng.integers(0, 200, 400).astype(np.uint8)
    old = at(places, labels)
    found = old.without(at(newer, np.zeros(90, np.uint8)))
    taken = {tuple(np.floor(place / SPACING_M)) for place in newer.astype(np.float64)}
    stay = [tuple(np.floor(place / SPACING_M)) not in taken for place in places.astype(np.float64)]
    assert 100 < sum(stay) < 350
    for part in ("features", "labels", "cubes"):
        np.testing.assert_array_equal(getattr(found, part), getattr(old, part)[stay])
    assert found.up is old.up


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [
        ((0.05, 0.05, 0.05), (0.15, 0.15, 0.15), True),
        ((-0.05, 0.05, 0.05), (0.05, 0.05, 0.05), False),  # either side of 0
        ((-0.05, -0.05, -0.05), (-0.15, -0.15, -0.15), True),
        ((0.05, 0.25, 0.05), (0.25, 0.05, 0.05), False),  # not the sum of the axes
        ((0.05, 0.05, -0.05), (0.05, -0.05, 0.05), False),
        ((-900.05, 700.05, -0.05), (-900.15, 700.15, -0.15), True),
    ],
)
def test_cubes(old: tuple[float, ...], new: tuple[float, ...], same: bool) -> None:
    some, newer = (at(np.array([place], np.float32), np.zeros(1, np.uint8)) for place in (old, new))
    assert len(some.without(newer).labels) == (not same)
    assert len(some.without(at(np.empty((0, 3), np.float32), np.zeros(0, np.uint8))).labels) == 1


def visited() -> tuple[Cells, Bools]:
    """The room with somebody in wall grey 1.5 m off, and where (H, W) they stand."""
    view, image, _ = room()
    depth, here = view.depth.copy(), np.zeros(SHAPE, np.bool_)
    here[10:90, 140:180] = True
    depth[here] = 1.5
    return described(View(depth, view.T_WC, CAMERA), image), here


def test_what_stands_where_the_keyframe_saw_past_gets_a_class_that_moves() -> None:
    """Though no example is one; and nothing else does."""
    (cells, here), draft = visited(), said()
    guess(draft, cells, memory(), Movers(moving(PERSON), corner()))
    inside = np.zeros_like(here)
    inside[14:86, 144:176] = True
    assert (draft.labels[inside] == PERSON).all()
    assert (draft.labels[~here] != PERSON).all()


@pytest.mark.parametrize("movers", [Movers(moving(), corner()), Movers(moving(PERSON), None), NOBODY_MOVES])
def test_without_moving_classes_or_keyframe_nothing_changes(movers: Movers) -> None:
    (cells, _), draft, plain = visited(), said(), said()
    guess(draft, cells, memory(), movers)
    guess(plain, cells, memory(), NOBODY_MOVES)
    assert (draft.labels != PERSON).all()
    np.testing.assert_array_equal(draft.labels, plain.labels)
    np.testing.assert_array_equal(draft.confidence, plain.confidence)
    votes = generator(0, "votes").random((cells.known.sum(), 6), np.float32)
    np.testing.assert_array_equal(movers.only(votes.copy(), cells, cells.known), votes)


def test_of_the_classes_that_move_the_voted_one_is_taken() -> None:
    """The others keep nothing of what has come, and all of what was there; shares still sum to 1."""
    cells, here = visited()
    came = np.asarray(cells.middles(here), np.bool_)[cells.known]
    votes = np.zeros((len(came), 8), np.float32)
    votes[:, WALL], votes[:, DOG] = 0.9, 0.1
    found = Movers(moving(PERSON, DOG, 200), corner()).only(votes.copy(), cells, cells.known)
    np.testing.assert_array_equal(found[~came], votes[~came])
    np.testing.assert_allclose(found.sum(axis=1), 1, rtol=1e-6)
    assert (found[came].argmax(axis=1) == DOG).all()
    assert not found[came][:, [FLOOR, WALL, POSTER, BEFORE]].any()


@pytest.mark.parametrize(("nearer", "has_come"), [(0.8 * CLEARANCE_M, False), (1.2 * CLEARANCE_M, True)])
def test_it_must_be_nearer_than_what_the_keyframe_saw_by_more_than_noise(nearer: float, has_come: bool) -> None:
    """And before something that the keyframe saw: no depth there, or outside its image, tells nothing."""
    depth, draft = np.full(SHAPE, 3, np.float32), said()
    cells = described(View(depth - np.float32(nearer), np.eye(4), CAMERA), room()[1])
    depth[:, :40], aside = np.nan, np.eye(4)
    aside[0, 3] = -1.0
    keyframe = View(depth, aside, CAMERA)
    guess(draft, cells, remembered([examples(np.zeros((1, 10), np.float32), np.array([WALL], np.uint8))]),
          Movers(moving(PERSON), keyframe))  # fmt: skip
    columns = (np.arange(246) - 122) * (3 - nearer) / 120 + 1.0  # metres beside the keyframe
    column = columns * 120 / (3 - nearer) + 122
    seen = (column > 44) & (column < 241)
    assert (draft.labels[:, seen] == (PERSON if has_come else WALL)).all()
    assert (draft.labels[:, (column < 36) | (column > 250)] == WALL).all()


def test_classes_are_counted_up_to_the_highest_id() -> None:
    assert Movers(moving(), None).classes == 0
    assert Movers(moving(3, PERSON), None).classes == PERSON + 1
    assert remembered([]).classes == 1
    assert memory().classes == POSTER + 1
    assert len(memory()) == CELLS[0] * CELLS[1]
