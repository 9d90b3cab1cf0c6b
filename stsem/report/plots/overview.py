"""The whole log at a glance: how right the robot's current answer was at each frame, and which frames were dropped."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stsem.report.inputs import FrameRow, ReportInputs
from stsem.report.plots.style import MUTED, legend_beside_title, mode_colour, new_figure, title


def draw(inputs: ReportInputs) -> Figure | None:
    """A line per mode over log time, below it a tick for every frame without an answer; None without accuracy."""
    runs = inputs.document.runs
    chosen = next((name for name in ("streaming", "offline") if any(_has(row, name) for row in inputs.frames)), None)
    if chosen is None:
        return None
    figure = new_figure(3.3)
    axes = figure.add_subplot()
    begin = min(row.log_stamp_ns for row in inputs.frames)
    lowest = min(100 * getattr(row, chosen) for row in inputs.frames if _has(row, chosen))
    floor = max(0.0, lowest - 3)
    step = (100 - floor) * 0.06
    for i, run in enumerate(runs):
        rows = inputs.rows(run.mode)
        _line(axes, rows, chosen, begin, mode_colour(run.mode, i), run.mode)
        _ticks(axes, rows, begin, floor - step * (i + 0.5), mode_colour(run.mode, i), step)
    axes.set_ylim(floor - step * (len(runs) + 0.4), 101)
    axes.set_xlabel("Log time, s")
    axes.set_ylabel("Pixel accuracy, %")
    title(axes, f"Pixel accuracy of each frame over the log ({chosen})",
          "Ticks below: frames without an answer of their own, in the colour of the mode.")  # fmt: skip
    legend_beside_title(axes, len(runs))
    return figure


def _has(row: FrameRow, name: str) -> bool:
    return getattr(row, name) is not None


def _line(axes: Axes, rows: list[FrameRow], name: str, begin: int, colour: str, mode: str) -> None:
    scored = [row for row in rows if _has(row, name)]
    seconds = [(row.log_stamp_ns - begin) / 1e9 for row in scored]
    axes.plot(seconds, [100 * getattr(row, name) for row in scored], color=colour, linewidth=1.4, label=mode)


def _ticks(axes: Axes, rows: list[FrameRow], begin: int, height: float, colour: str, step: float) -> None:
    unanswered = [(row.log_stamp_ns - begin) / 1e9 for row in rows if not row.result.outcome.is_answer]
    axes.vlines(unanswered, height - 0.4 * step, height + 0.4 * step, color=colour, linewidth=1.0)
    if not unanswered:
        axes.annotate("all answered", (0, height), fontsize=7.5, color=MUTED, va="center")
