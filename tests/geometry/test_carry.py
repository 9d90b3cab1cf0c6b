"""Who answers for a pixel: the newest keyframe that saw its point, earlier ones, flow; moving classes only by flow."""

from collections.abc import Sequence

import numpy as np
import pytest

from stsem.camera import Camera
from stsem.classes import NO_LABEL, ClassSet
from stsem.geometry.carried import Bools, Draft
from stsem.geometry.carry import Source, carry, carry_more, follow, moving_classes, settle
from stsem.geometry.flow import Traced
from stsem.geometry.packed import Rows
from stsem.geometry.reproject import View

CAMERA = Camera(96, 64, 60.0, 60.0, 47.5, 31.5)
SHAPE = (64, 96)
WALL = np.full(SHAPE, 3, np.float32)
WALL_CLASS, PERSON, BY_FLOW = 0, 1, 2
CLASSES = ClassSet(("wall", "Person", "painting"))
MOVING = moving_classes(CLASSES)
EVERYWHERE = np.arange(WALL.size)


def view(x: float = 0.0, depth: np.ndarray = WALL) -> View:
    """Before the wall, `x` metres to the side; 5 cm are a pixel."""
    pose = np.eye(4)
    pose[0, 3] = x
    return View(depth, pose, CAMERA)


def source(x: float, label: int, confidence: float | None = None, depth: np.ndarray = WALL) -> Source:
    sure = None if confidence is None else np.full(SHAPE, confidence, np.float32)
    return Source(view(x, depth), np.full(SHAPE, label, np.uint8), sure).without(MOVING)


def by_flow(rows: Rows, label: int = BY_FLOW, confidence: float | None = None, covered: Bools | None = None) -> Traced:
    """The pixels `rows` of an image where flow says `label`; `covered` (H, W) everywhere unless told."""
    seen = np.ones(SHAPE, np.bool_) if covered is None else covered
    sure = None if confidence is None else np.full(len(rows), confidence, np.float32)
    return Traced(rows, np.full(len(rows), label, np.uint8), sure, seen.reshape(-1)[rows])


def blank(*, sure: bool = False) -> Draft:
    return Draft.blank(SHAPE, sure=sure)


def answered(
    sources: Sequence[Source], current: View | None = None, label: int = BY_FLOW, *,
    confidence: float | None = None, covered: Bools | None = None,
) -> Draft:  # fmt: skip
    """By depth, then flow says `label` of what is open: first of what moves, then of the rest."""
    draft = blank(sure=confidence is not None)
    carry(draft, current or view(), sources)
    traced = by_flow(np.flatnonzero(draft.open), label, confidence, covered)
    follow(draft, traced, moving=MOVING)
    settle(draft, traced)
    return draft


def test_a_blank_draft_is_open_everywhere_and_has_room_for_confidence_if_asked() -> None:
    draft = blank(sure=True)
    assert draft.labels.shape == draft.covered.shape == SHAPE
    assert draft.open.all()
    assert not draft.covered.any()
    assert draft.confidence is not None
    assert draft.confidence.dtype == np.float32
    np.testing.assert_array_equal(draft.confidence, np.zeros(SHAPE))
    assert blank().confidence is None
    draft.labels[3, 4] = WALL_CLASS
    assert np.flatnonzero(~draft.open).tolist() == [3 * 96 + 4]


def test_the_newest_keyframe_answers_then_earlier_ones_then_flow() -> None:
    answer = answered([source(1.0, 5), source(0.5, 6)])
    assert (answer.labels[:, 20:] == 5).all()
    assert (answer.labels[:, 10:20] == 6).all()
    assert (answer.labels[:, :10] == BY_FLOW).all()
    np.testing.assert_array_equal(answer.covered, answer.labels != BY_FLOW)


def test_what_no_keyframe_saw_stays_open_and_uncovered() -> None:
    draft = blank()
    carry(draft, view(), [source(1.0, 5), source(0.5, 6)])
    np.testing.assert_array_equal(draft.open, np.broadcast_to(np.arange(96) < 10, SHAPE))
    np.testing.assert_array_equal(draft.covered, ~draft.open)


def test_confidence_moves_with_the_labels() -> None:
    answer = answered([source(1.0, 5, 0.9), source(0.5, 6, 0.8)], confidence=0.3)
    assert answer.confidence is not None
    expected = np.where(answer.labels == 5, 0.9, np.where(answer.labels == 6, 0.8, 0.3)).astype(np.float32)
    np.testing.assert_array_equal(answer.confidence, expected)
    assert set(np.unique(answer.labels)) == {5, 6, BY_FLOW}


def test_confidence_is_taken_only_where_both_sides_have_one() -> None:
    without_room = blank()
    carry(without_room, view(), [source(1.0, 5, 0.9), source(0.5, 6, 0.8)])
    settle(without_room, by_flow(EVERYWHERE, confidence=0.3))
    assert without_room.confidence is None
    draft = blank(sure=True)
    carry(draft, view(), [source(1.0, 5, 0.9), source(0.5, 6)])
    settle(draft, by_flow(EVERYWHERE))
    assert draft.confidence is not None
    np.testing.assert_array_equal(draft.confidence, np.where(draft.labels == 5, np.float32(0.9), np.float32(0)))


def test_without_keyframes_everything_is_by_flow_and_nothing_covered() -> None:
    answer = answered([])
    assert (answer.labels == BY_FLOW).all()
    assert not answer.covered.any()


def test_a_person_is_never_carried_by_depth_but_by_flow_and_counts_as_covered_there() -> None:
    seen = np.zeros(SHAPE, np.bool_)
    seen[:30] = True
    standing = answered([source(0.0, PERSON)], label=PERSON, covered=seen)
    assert (standing.labels == PERSON).all()
    np.testing.assert_array_equal(standing.covered, seen)
    gone = answered([source(0.0, PERSON)], label=WALL_CLASS)
    assert (gone.labels == WALL_CLASS).all()
    assert not gone.covered.any()


def test_what_a_keyframe_has_no_label_for_is_asked_of_the_earlier_one() -> None:
    newest = source(0.0, WALL_CLASS)
    newest.labels[10:20] = NO_LABEL
    answer = answered([newest, source(0.0, 6)])
    assert (answer.labels[10:20] == 6).all()
    assert (np.delete(answer.labels, np.s_[10:20], axis=0) == WALL_CLASS).all()
    assert answer.covered.all()


def test_pixels_without_depth_are_left_to_flow() -> None:
    depth = WALL.copy()
    depth[:, 40:50] = np.nan
    answer = answered([source(0.0, 5), source(0.0, 6)], view(depth=depth))
    np.testing.assert_array_equal(answer.labels == BY_FLOW, np.isnan(depth))
    np.testing.assert_array_equal(answer.covered, ~np.isnan(depth))


def test_keyframes_that_add_nothing_are_passed_over_and_do_not_count() -> None:
    far, draft = [source(50.0, 9) for _ in range(12)], blank()
    carry(draft, view(), [source(1.0, 5), *far, source(0.5, 6)], max_earlier=1)
    assert (draft.labels[:, 10:20] == 6).all()


@pytest.mark.parametrize(("rows", "asked"), [(3, False), (4, True)])
def test_a_keyframe_is_asked_if_it_adds_more_than_a_two_hundredth_of_the_image(rows: int, asked: bool) -> None:
    """Half a percent are 31 pixels; it has depth in 10 columns that the newest one did not see."""
    depth, draft = WALL.copy(), blank()
    depth[rows:] = np.nan
    carry(draft, view(), [source(1.0, 5), source(0.5, 6, depth=depth)])
    assert np.count_nonzero(draft.labels == 6) == (10 * rows if asked else 0)


def test_at_most_so_many_earlier_keyframes_are_asked() -> None:
    steps = [source(x, label) for x, label in ((1.0, 5), (0.75, 6), (0.5, 7), (0.25, 8))]
    draft = blank()
    carry(draft, view(), steps, max_earlier=2)
    assert set(np.unique(draft.labels)) == {5, 6, 7, NO_LABEL}
    draft = blank()
    carry_more(draft, view(), steps, at_most=2)
    assert set(np.unique(draft.labels)) == {5, 6, NO_LABEL}


def test_what_more_keyframes_say_fills_only_what_is_open_and_is_not_covered() -> None:
    draft = blank(sure=True)
    carry(draft, view(), [source(1.0, 5, 0.9)])
    covered = draft.covered.copy()
    carry_more(draft, view(), [source(0.5, 6, 0.8), source(0.25, 7, 0.7)])
    columns = np.broadcast_to(np.arange(96), SHAPE)
    expected = np.select([columns >= 20, columns >= 10, columns >= 5], [5, 6, 7], NO_LABEL)
    np.testing.assert_array_equal(draft.labels, expected)
    np.testing.assert_array_equal(draft.covered, covered)
    np.testing.assert_array_equal(covered, columns >= 20)
    assert draft.confidence is not None
    sure = np.select([columns >= 20, columns >= 10, columns >= 5], [0.9, 0.8, 0.7]).astype(np.float32)
    np.testing.assert_array_equal(draft.confidence, sure)


def test_with_no_more_keyframes_or_nothing_open_the_draft_stays() -> None:
    draft = blank()
    carry_more(draft, view(), [])
    assert draft.open.all()
    carry(draft, view(), [source(0.0, 5)])
    carry_more(draft, view(), [source(0.0, 6)])
    assert (draft.labels == 5).all()


def test_shadows_are_filled_from_the_frames_with_light_in_them() -> None:
    """A strip of 6 pixels without depth in the frame, another one in the keyframe: both are the wall by guess."""
    here, there = WALL.copy(), WALL.copy()
    here[:, 30:36] = there[:, 60:66] = np.nan
    current, keyframe = view(depth=here), source(0.0, 5, 0.9, depth=there)
    draft = blank(sure=True)
    carry(draft, current, [keyframe])
    dark = np.isnan(here)
    dark[:, 61:65] = True  # beside a pixel that has no depth, there is one that has
    np.testing.assert_array_equal(draft.open, dark)
    carry_more(draft, current.lit(), [keyframe.lit()])
    assert (draft.labels == 5).all()
    assert draft.confidence is not None
    assert (draft.confidence == np.float32(0.9)).all()
    np.testing.assert_array_equal(draft.covered, ~dark)
    assert np.isnan(there[:, 60:66]).all()


def test_flow_is_followed_only_where_it_covers_a_class_that_moves() -> None:
    draft, labels = blank(sure=True), np.full(SHAPE, WALL_CLASS, np.uint8)
    labels[:, 48:] = PERSON
    covered = np.zeros(SHAPE, np.bool_)
    covered[:32] = True
    rows = EVERYWHERE[EVERYWHERE % 96 < 90]
    sure = np.full(len(rows), 0.6, np.float32)
    traced = Traced(rows, labels.reshape(-1)[rows], sure, covered.reshape(-1)[rows])
    follow(draft, traced, moving=MOVING)
    expected = np.zeros(SHAPE, np.bool_)
    expected[:32, 48:90] = True
    np.testing.assert_array_equal(draft.labels, np.where(expected, PERSON, NO_LABEL))
    np.testing.assert_array_equal(draft.covered, expected)
    assert draft.confidence is not None
    np.testing.assert_array_equal(draft.confidence, np.where(expected, np.float32(0.6), np.float32(0)))


def test_what_was_covered_before_flow_was_followed_stays_covered() -> None:
    draft = blank()
    carry(draft, view(), [source(1.0, 5)])
    follow(draft, by_flow(np.flatnonzero(draft.open), PERSON), moving=MOVING)
    assert draft.covered.all()
    assert (draft.labels[:, :20] == PERSON).all()
    assert (draft.labels[:, 20:] == 5).all()


def test_what_is_settled_touches_only_what_is_open_at_the_pixels_traced() -> None:
    draft = blank(sure=True)
    carry(draft, view(), [source(1.0, 5, 0.9)])
    rows = np.flatnonzero(draft.open)
    traced = by_flow(rows[rows % 96 >= 3], BY_FLOW, 0.3)
    carry_more(draft, view(), [source(0.5, 6, 0.8)])
    covered = draft.covered.copy()
    settle(draft, traced)
    columns = np.broadcast_to(np.arange(96), SHAPE)
    parts = [columns >= 20, columns >= 10, columns >= 3]
    np.testing.assert_array_equal(draft.labels, np.select(parts, [5, 6, BY_FLOW], NO_LABEL))
    assert draft.confidence is not None
    np.testing.assert_array_equal(draft.confidence, np.select(parts, [0.9, 0.8, 0.3]).astype(np.float32))
    np.testing.assert_array_equal(draft.covered, covered)


def test_where_nothing_was_traced_nothing_is_filled() -> None:
    draft, traced = blank(), by_flow(np.empty(0, np.intp), PERSON)
    follow(draft, traced, moving=MOVING)
    settle(draft, traced)
    assert draft.open.all()
    assert not draft.covered.any()


def test_moving_classes_are_found_by_name_however_they_are_written() -> None:
    names = ("wall", "PERSON", "Car", "motor_cycle", "police-man", "Bicyclist", "chair")
    found = moving_classes(ClassSet(names))
    assert [name for name, moves in zip(names, found, strict=False) if moves] == [
        "PERSON",
        "Car",
        "motor_cycle",
        "Bicyclist",
    ]
    assert not found[len(names) :].any()
    assert found.shape == (256,)


def test_nothing_that_came_in_but_the_draft_is_changed() -> None:
    depth = WALL.copy()
    depth[:, 30:36] = np.nan
    current, newest, earlier = view(depth=depth), source(1.0, 5, 0.9), source(0.5, 6, 0.8)
    traced, draft = by_flow(np.flatnonzero(np.arange(WALL.size) % 96 < 20), PERSON, 0.3), blank(sure=True)
    came = [depth, traced.rows, traced.labels, traced.confidence, traced.covered, MOVING]
    came += [part for one in (newest, earlier) for part in (one.view.depth, one.labels, one.confidence)]
    before = [np.array(part) for part in came]
    carry(draft, current, [newest])
    carry_more(draft, current.lit(), [newest.lit(), earlier.lit()])
    follow(draft, traced, moving=MOVING)
    settle(draft, traced)
    for part, as_it_was in zip(came, before, strict=True):
        np.testing.assert_array_equal(part, as_it_was)
    assert newest.without(MOVING) is not newest
