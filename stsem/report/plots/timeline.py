"""What the two simulated cores did, job by job, and what became of each arrival."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from stsem.report.frames_csv import stages_of
from stsem.report.inputs import FrameRow, ReportInputs
from stsem.report.plots.style import BAD, BLACK, INK, STAGE_COLOURS, SURFACE, UNKNOWN_STAGE, WHITE, new_figure
from stsem.result import Outcome, Span

FRAMES_SHOWN = 25
_CORE_HEIGHT = 0.82
_MARKS = {
    Outcome.SEGMENTED: ("s", STAGE_COLOURS["segment"]), Outcome.PROPAGATED: ("o", STAGE_COLOURS["propagate"]),
    Outcome.DROPPED_BUSY: ("x", BAD), Outcome.NO_SOURCE: ("v", BAD), Outcome.PENDING: (">", BAD),
}  # fmt: skip
_DARK = ("decode", "segment", "fuse")
_WORDS = {Outcome.DROPPED_BUSY: "dropped", Outcome.NO_SOURCE: "no source"}


def draw(inputs: ReportInputs) -> Figure | None:
    """Panels, one per mode, of the first frames; None without a clock."""
    runs = [run for run in inputs.document.runs if any(row.result.spans for row in inputs.rows(run.mode))]
    if not runs:
        return None
    shown = {run.mode: _first(inputs.rows(run.mode)) for run in runs}
    end_ms = max(span.end_ns for rows in shown.values() for row in rows for span in row.result.spans) / 1e6
    cores = 1 + max(core for rows in shown.values() for row in rows for span in row.result.spans for core in span.cores)
    figure = new_figure(1.25 + len(runs) * (0.75 + 0.34 * (cores + 1)))
    first: Axes | None = None
    for i, run in enumerate(runs):
        axes = figure.add_subplot(len(runs), 1, i + 1, sharex=first)
        first = first or axes
        _panel(axes, shown[run.mode], cores, end_ms)
        axes.set_title(run.mode, loc="left", fontsize=9.5, fontweight="bold", color=INK)
        axes.tick_params(labelbottom=i == len(runs) - 1)
    axes.set_xlabel("Simulated time since the first frame's stamp, ms")
    figure.suptitle(f"The first {len(shown[runs[0].mode])} frames on the simulated cores (numbers: log index)",
                    x=0.01, ha="left", fontsize=10.5, fontweight="bold", color=INK)  # fmt: skip
    rows = tuple(row for part in shown.values() for row in part)
    figure.legend(handles=_legend(rows), loc="outside lower center", ncols=4)
    return figure


def _first(rows: Sequence[FrameRow]) -> Sequence[FrameRow]:
    return rows[:FRAMES_SHOWN]


def _panel(axes: Axes, rows: Sequence[FrameRow], cores: int, end_ms: float) -> None:
    for row in rows:
        for span in row.result.spans:
            _job(axes, span, end_ms)
        if row.result.arrival_ns is not None and row.result.outcome in _MARKS:
            marker, colour = _MARKS[row.result.outcome]
            axes.plot(row.result.arrival_ns / 1e6, cores, marker=marker, color=colour, markersize=5, linestyle="none")
    axes.set_yticks(range(cores + 1), [*(f"core {core}" for core in range(cores)), "arrivals"], color=INK)
    axes.set_ylim(-0.6, cores + 0.5)
    axes.set_xlim(0, end_ms * 1.005)
    axes.grid(visible=False, axis="y")


def _job(axes: Axes, span: Span, end_ms: float) -> None:
    start, length = span.start_ns / 1e6, (span.end_ns - span.start_ns) / 1e6
    low, high = min(span.cores), max(span.cores)
    bottom, height = low - _CORE_HEIGHT / 2, high - low + _CORE_HEIGHT
    colour = STAGE_COLOURS.get(span.stage, UNKNOWN_STAGE)
    axes.broken_barh(
        [(start, length)],
        (bottom, height),
        facecolors=colour,
        edgecolors=SURFACE,
        linewidth=0.6 if length > 0.008 * end_ms else 0.0,
    )
    if length > 0.018 * end_ms:
        middle = (start + length / 2, bottom + height / 2)
        colour = WHITE if span.stage in _DARK else BLACK
        axes.text(*middle, str(span.frame), ha="center", va="center", fontsize=7.5, color=colour, clip_on=True)


def _legend(rows: tuple[FrameRow, ...]) -> list[Patch | Line2D]:
    stages = [Patch(color=STAGE_COLOURS.get(stage, UNKNOWN_STAGE), label=stage) for stage in stages_of(rows)]
    outcomes = [outcome for outcome in _MARKS if any(row.result.outcome is outcome for row in rows)]
    marks = [
        Line2D([], [], marker=_MARKS[o][0], color=_MARKS[o][1], linestyle="none", markersize=5,
               label=f"arrived: {_WORDS.get(o, str(o))}")
        for o in outcomes
    ]  # fmt: skip
    return [*stages, *marks]
