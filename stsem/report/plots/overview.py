"""The whole log at a glance: how right the robot's current answer was at each frame, and which frames were dropped."""

from collections.abc import Iterator

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stsem.report.inputs import FrameRow, ReportInputs
from stsem.report.plots.style import MUTED, legend_beside_title, mode_colour, new_figure, title

POINTS = 400
"""More frames than this are drawn in groups of equal size."""


def draw(inputs: ReportInputs) -> Figure | None:
    """A line per mode over log time, below it a tick for every frame without an answer; None without accuracy."""
    runs = inputs.document.runs
    chosen = next((name for name in ("streaming", "offline") if any(_has(row, name) for row in inputs.frames)), None)
    if chosen is None:
        return None
    figure = new_figure(3.3)
    axes = figure.add_subplot()
    begin = min(row.log_stamp_ns for row in inputs.frames)
    size = -(-max(len(inputs.rows(run.mode)) for run in runs) // POINTS)
    lowest = min(100 * getattr(row, chosen) for row in inputs.frames if _has(row, chosen))
    floor = max(0.0, lowest - 3)
    step = (100 - floor) * 0.06
    for i, run in enumerate(runs):
        groups = list(_groups(inputs.rows(run.mode), size))
        _line(axes, groups, chosen, begin, mode_colour(run.mode, i), run.mode)
        _ticks(axes, groups, begin, floor - step * (i + 0.9), mode_colour(run.mode, i), 0.8 * step)
    axes.set_ylim(floor - step * (len(runs) + 0.4), 101)
    axes.set_xlabel("Log time, s")
    axes.set_ylabel("Pixel accuracy, %")
    title(axes, f"Pixel accuracy over the log ({chosen})", _below(size))
    legend_beside_title(axes, len(runs))
    return figure


def _below(size: int) -> str:
    if size == 1:
        return "One point per frame. Ticks below: frames without an answer of their own, in the colour of the mode."
    return f"Means of {size} frames, and their range. Below: the share of frames without an answer of their own."


def _has(row: FrameRow, name: str) -> bool:
    return getattr(row, name) is not None


def _groups(rows: list[FrameRow], size: int) -> Iterator[list[FrameRow]]:
    return (rows[i : i + size] for i in range(0, len(rows), size))


def _seconds(group: list[FrameRow], begin: int) -> float:
    return (group[0].log_stamp_ns + group[-1].log_stamp_ns - 2 * begin) / 2e9


def _line(axes: Axes, groups: list[list[FrameRow]], name: str, begin: int, colour: str, mode: str) -> None:
    scored = [found for group in groups if (found := [row for row in group if _has(row, name)])]
    values = [[100 * getattr(row, name) for row in group] for group in scored]
    seconds = [_seconds(group, begin) for group in scored]
    if any(len(group) > 1 for group in values):
        axes.fill_between(seconds, [min(v) for v in values], [max(v) for v in values], color=colour, alpha=0.18, lw=0)
    axes.plot(seconds, [sum(v) / len(v) for v in values], color=colour, linewidth=1.4, label=mode)


def _ticks(axes: Axes, groups: list[list[FrameRow]], begin: int, bottom: float, colour: str, height: float) -> None:
    shares = [sum(not row.result.outcome.is_answer for row in group) / len(group) for group in groups]
    shown = [(_seconds(group, begin), share) for group, share in zip(groups, shares, strict=True) if share]
    axes.vlines([x for x, _ in shown], bottom, [bottom + height * share for _, share in shown], color=colour, lw=1.0)
    if not shown:
        axes.annotate("all answered", (0, bottom), fontsize=7.5, color=MUTED)
