"""The curves of a training: loss, learning rate, and mIoU on the validation data."""

from collections.abc import Sequence

from matplotlib.axes import Axes

from stsem.report.plots.style import MUTED, look, new_figure, png, title
from stsem.train.curves import Point

LOSS, SCORE = "#0072b2", "#d55e00"


def training_curves(rows: Sequence[Point]) -> bytes:
    """A picture (PNG) of one or more points, iterations to the right; validation only where there was any."""
    judged = [(row.iteration, 100 * row.validation[0]) for row in rows if row.validation is not None]
    iterations = [row.iteration for row in rows]
    with look():
        figure = new_figure(5.6 if judged else 3.9)
        heights = (3, 1.2, 3) if judged else (3, 1.2)
        loss, rate, *score = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights)
        _line(loss, iterations, [row.loss for row in rows], LOSS)
        title(loss, "Loss", f"Mean since the point before; at the end {rows[-1].loss:.3f}.")
        loss.set_ylim(bottom=0)
        loss.set_xlim(0, 1.02 * iterations[-1])
        loss.xaxis.get_major_locator().set_params(integer=True)
        _line(rate, iterations, [row.rate for row in rows], MUTED)
        title(rate, "Learning rate")
        rate.set_ylim(bottom=0)
        for axes in score:
            places, scores = zip(*judged, strict=True)
            _line(axes, places, scores, SCORE, marker="o")
            title(axes, "Validation mIoU, %", f"Of the averaged weights; at the end {scores[-1]:.1f} %.")
        (score or [rate])[-1].set_xlabel("iteration")
        return png(figure)


def _line(axes: Axes, x: Sequence[float], y: Sequence[float], colour: str, *, marker: str = "") -> None:
    alone = "o" if len(x) == 1 else marker
    axes.plot(x, y, color=colour, linewidth=1.6, marker=alone, markersize=4)
