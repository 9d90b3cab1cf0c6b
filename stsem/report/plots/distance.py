"""mIoU over the distance to the keyframe."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from stsem.document.schema import Run
from stsem.report.inputs import ReportInputs
from stsem.report.plots.style import MUTED, SURFACE, mode_colour, new_figure, title

ENOUGH = 10
"""Frames that a distance needs to be a filled point (DESIGN 4)."""

_TOP = 106
"""Room for the figures above 100 %."""


def draw(inputs: ReportInputs) -> Figure | None:
    """A line per mode that predicts; per-frame as the level it starts from; None where nothing was predicted."""
    runs = inputs.document.runs
    curves = [(i, run) for i, run in enumerate(runs) if len(run.by_distance) > 1]
    if not curves:
        return None
    figure = new_figure(3.4)
    axes = figure.add_subplot()
    for i, run in enumerate(runs):
        if len(run.by_distance) <= 1 and run.offline and run.offline.miou is not None:
            axes.axhline(100 * run.offline.miou, color=mode_colour(run.mode, i), linestyle="--", linewidth=1.4,
                         label=f"{run.mode}, all frames: {100 * run.offline.miou:.1f} %")  # fmt: skip
    for i, run in curves:
        _curve(axes, run, mode_colour(run.mode, i))
    step = _frame_ms(curves[0][1])
    axes.set_xlabel(f"Distance to the keyframe, frames{f' (one frame is about {step:.0f} ms)' if step else ''}")
    axes.set_ylabel("mIoU, %")
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.margins(y=0.22)
    axes.set_ylim(top=min(axes.get_ylim()[1], _TOP))
    below = f"Offline. Small figures: number of frames; hollow: fewer than {ENOUGH}, not in the mean or minimum."
    title(axes, "mIoU over the distance to the keyframe", below)
    axes.legend(loc="best")
    return figure


def _curve(axes: Axes, run: Run, colour: str) -> None:
    rows = [row for row in run.by_distance if row.miou is not None]
    x, y = [row.frames for row in rows], [100 * (row.miou or 0.0) for row in rows]
    axes.plot(x, y, color=colour, linewidth=1.8, label=run.mode)
    for row, height in zip(rows, y, strict=True):
        axes.plot(row.frames, height, marker="o", markersize=6, color=colour, markeredgewidth=1.4,
                  markerfacecolor=colour if row.n >= ENOUGH else SURFACE)  # fmt: skip
        if len(rows) <= 16 or row.frames % 5 == 0:
            axes.annotate(str(row.n), (row.frames, height), (0, 7), textcoords="offset points", ha="center",
                          fontsize=7.5, color=MUTED)  # fmt: skip


def _frame_ms(run: Run) -> float | None:
    steps = [row.ms / row.frames for row in run.by_distance if row.frames and row.ms]
    return sum(steps) / len(steps) if steps else None
