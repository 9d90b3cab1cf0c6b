"""Errors are coloured by the mode that made them."""

from dataclasses import replace

import numpy as np
from made_up_comparison import with_third_mode
from made_up_run import example
from matplotlib.backends.backend_agg import FigureCanvasAgg

from stsem.report.inputs import ReportInputs
from stsem.report.plots import overview
from stsem.report.plots.strip import BOTH, RIGHT, draw, errors

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


def three_modes() -> ReportInputs:
    """The made-up run with a third mode that answers as the second does."""
    inputs = example()
    strip = tuple(
        replace(frame, answers={**frame.answers, "keyframe-async": frame.answers["keyframe"]})
        for frame in inputs.strip if "keyframe" in frame.answers
    )  # fmt: skip
    frames = {**inputs.frames, "keyframe-async": inputs.frames["keyframe"]}
    return replace(inputs, document=with_third_mode(inputs.document), strip=strip, frames=frames)


def test_the_errors_of_three_modes_have_room_below_the_pictures() -> None:
    figure = draw(three_modes())
    assert figure is not None
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    lowest = min(axes.get_tightbbox(canvas.get_renderer()).y0 for axes in figure.axes)
    legends = figure.legends
    assert len(legends) == 2
    assert all(legend.get_window_extent().y1 <= lowest for legend in legends)


def test_no_accuracy_below_zero_is_marked() -> None:
    """The room below the lines is for ticks of frames without an answer."""
    inputs = three_modes()
    wrong = {mode: [replace(row, streaming=0.0) for row in inputs.rows(mode)] for mode in inputs.frames}
    figure = overview.draw(replace(inputs, frames=wrong))
    assert figure is not None
    (axes,) = figure.axes
    assert len(axes.get_yticks()) > 1
    assert min(axes.get_yticks()) >= 0
