"""Who answers for a pixel: the newest keyframe that saw its point, earlier ones, flow; moving classes only by flow."""

import numpy as np
import pytest

from stsem.camera import Camera
from stsem.classes import NO_LABEL, ClassSet
from stsem.geometry.carried import Bools, Carried
from stsem.geometry.carry import Source, carry, moving_classes
from stsem.geometry.reproject import View

CAMERA = Camera(96, 64, 60.0, 60.0, 47.5, 31.5)
WALL = np.full((64, 96), 3, np.float32)
WALL_CLASS, PERSON, BY_FLOW = 0, 1, 2
CLASSES = ClassSet(("wall", "Person", "painting"))
MOVING = moving_classes(CLASSES)


def view(x: float = 0.0, depth: np.ndarray = WALL) -> View:
    """Before the wall, `x` metres to the side; 5 cm are a pixel."""
    pose = np.eye(4)
    pose[0, 3] = x
    return View(depth, pose, CAMERA)


def source(x: float, label: int, confidence: float | None = None) -> Source:
    sure = None if confidence is None else np.full(WALL.shape, confidence, np.float32)
    return Source(view(x), np.full(WALL.shape, label, np.uint8), sure).without(MOVING)


def by_flow(label: int = BY_FLOW, confidence: float | None = None, covered: Bools | None = None) -> Carried:
    sure = None if confidence is None else np.full(WALL.shape, confidence, np.float32)
    seen = np.ones(WALL.shape, np.bool_) if covered is None else covered
    return Carried(np.full(WALL.shape, label, np.uint8), sure, seen)


def test_the_newest_keyframe_answers_then_earlier_ones_then_flow() -> None:
    answer = carry(view(), [source(1.0, 5), source(0.5, 6)], by_flow(), moving=MOVING)
    assert (answer.labels[:, 20:] == 5).all()
    assert (answer.labels[:, 10:20] == 6).all()
    assert (answer.labels[:, :10] == BY_FLOW).all()
    np.testing.assert_array_equal(answer.covered, answer.labels != BY_FLOW)
    assert answer.coverage == pytest.approx(86 / 96)


def test_confidence_moves_with_the_labels() -> None:
    answer = carry(view(), [source(1.0, 5, 0.9), source(0.5, 6, 0.8)], by_flow(confidence=0.3), moving=MOVING)
    assert answer.confidence is not None
    expected = np.where(answer.labels == 5, 0.9, np.where(answer.labels == 6, 0.8, 0.3)).astype(np.float32)
    np.testing.assert_array_equal(answer.confidence, expected)


def test_without_keyframes_everything_is_by_flow_and_nothing_covered() -> None:
    answer = carry(view(), [], by_flow(), moving=MOVING)
    assert (answer.labels == BY_FLOW).all()
    assert answer.coverage == 0


def test_a_person_is_never_carried_by_depth_but_by_flow_and_counts_as_covered_there() -> None:
    seen = np.zeros(WALL.shape, np.bool_)
    seen[:30] = True
    standing = carry(view(), [source(0.0, PERSON)], by_flow(PERSON, covered=seen), moving=MOVING)
    assert (standing.labels == PERSON).all()
    np.testing.assert_array_equal(standing.covered, seen)
    gone = carry(view(), [source(0.0, PERSON)], by_flow(WALL_CLASS), moving=MOVING)
    assert (gone.labels == WALL_CLASS).all()
    assert gone.coverage == 0


def test_what_a_keyframe_has_no_label_for_is_asked_of_the_earlier_one() -> None:
    newest = source(0.0, WALL_CLASS)
    newest.labels[10:20] = NO_LABEL
    answer = carry(view(), [newest, source(0.0, 6)], by_flow(), moving=MOVING)
    assert (answer.labels[10:20] == 6).all()
    assert (np.delete(answer.labels, np.s_[10:20], axis=0) == WALL_CLASS).all()


def test_pixels_without_depth_are_left_to_flow() -> None:
    depth = WALL.copy()
    depth[:, 40:50] = np.nan
    answer = carry(view(depth=depth), [source(0.0, 5), source(0.0, 6)], by_flow(), moving=MOVING)
    np.testing.assert_array_equal(answer.labels == BY_FLOW, np.isnan(depth))


def test_keyframes_that_add_nothing_are_passed_over_and_do_not_count() -> None:
    far = [source(50.0, 9) for _ in range(12)]
    answer = carry(view(), [source(1.0, 5), *far, source(0.5, 6)], by_flow(), moving=MOVING, max_earlier=1)
    assert (answer.labels[:, 10:20] == 6).all()


def test_at_most_so_many_earlier_keyframes_are_asked() -> None:
    steps = [source(x, label) for x, label in ((1.0, 5), (0.75, 6), (0.5, 7), (0.25, 8))]
    answer = carry(view(), steps, by_flow(), moving=MOVING, max_earlier=2)
    assert set(np.unique(answer.labels)) == {5, 6, 7, BY_FLOW}


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


def test_nothing_that_came_in_is_changed() -> None:
    newest, rest = source(0.5, 5, 0.9), by_flow(confidence=0.3)
    before = newest.labels.copy(), rest.labels.copy()
    carry(view(), [newest], rest, moving=MOVING)
    np.testing.assert_array_equal(newest.labels, before[0])
    np.testing.assert_array_equal(rest.labels, before[1])
