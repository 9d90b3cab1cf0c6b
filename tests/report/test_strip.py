"""Errors are coloured by the mode that made them."""

import numpy as np

from stsem.report.plots.strip import BOTH, RIGHT, errors

BLUE, ORANGE = (0x00, 0x72, 0xB2), (0xD5, 0x5E, 0x00)


def test_each_kind_of_error_has_its_colour() -> None:
    truth = np.array([[0, 0, 0, 0, 255]], np.uint8)
    answers = {"per-frame": np.array([[0, 1, 0, 1, 1]], np.uint8), "keyframe": np.array([[0, 0, 255, 2, 1]], np.uint8)}
    picture = errors(truth, answers, ["per-frame", "keyframe"])
    assert [tuple(int(c) for c in pixel) for pixel in picture[0]] == [RIGHT, BLUE, ORANGE, BOTH, (255, 255, 255)]


def test_a_mode_without_an_answer_is_wrong_everywhere() -> None:
    truth = np.zeros((2, 2), np.uint8)
    picture = errors(truth, {"per-frame": truth}, ["per-frame", "keyframe"])
    assert (picture == ORANGE).all()


def test_answers_of_another_size_are_taken_by_nearest_neighbour() -> None:
    truth = np.array([[0, 0, 1, 1], [0, 0, 1, 1]], np.uint8)
    picture = errors(truth, {"per-frame": np.array([[0, 1]], np.uint8)}, ["per-frame"])
    assert (picture == RIGHT).all()
