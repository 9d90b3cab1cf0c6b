"""The whole log at a glance: how right the robot's current answer was at each frame, and which frames were dropped."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stsem.report.inputs import FrameRow, ReportInputs
from stsem.report.plots.style import MUTED, legend_beside_title, mode_colour, new_figure, title

POINTS = 400
"""More frames than this are drawn in groups of equal size."""


@dataclass(frozen=True)
class _Group:
    """Frames that are drawn as one point.

    Args:
        middle_ns: of their capture stamps, twice.
        scores: lowest, mean and highest of them, %; None without any.
        scored: how many have a score.
        unanswered: share without an answer of their own.
    """

    middle_ns: int
    scores: tuple[float, float, float] | None
    scored: int
    unanswered: float

    @classmethod
    def of(cls, rows: Sequence[FrameRow], name: str) -> "_Group":
        """The group of some neighbours; `name` is that of the score."""
        found = [100 * value for row in rows if (value := getattr(row, name)) is not None]
        scores = (min(found), sum(found) / len(found), max(found)) if found else None
        unanswered = sum(not row.result.outcome.is_answer for row in rows) / len(rows)
        return cls(rows[0].log_stamp_ns + rows[-1].log_stamp_ns, scores, len(found), unanswered)

    def seconds(self, begin_ns: int) -> float:
        """Time from `begin_ns` to the middle of the group."""
        return (self.middle_ns - 2 * begin_ns) / 2e9


def draw(inputs: ReportInputs) -> Figure | None:
    """A line per mode over log time, below it a tick for every frame without an answer; None without accuracy."""
    runs = inputs.document.runs
    chosen = next((name for name in ("streaming", "offline") if _any_has(inputs, name)), None)
    if chosen is None:
        return None
    figure = new_figure(3.3)
    axes = figure.add_subplot()
    begin = min(rows[0].log_stamp_ns for rows in inputs.frames.values() if len(rows))
    size = -(-max(len(inputs.rows(run.mode)) for run in runs) // POINTS)
    lines = [_groups(inputs.rows(run.mode), chosen, size) for run in runs]
    floor = max(0.0, min(group.scores[0] for groups in lines for group in groups if group.scores) - 3)
    step = (100 - floor) * 0.06
    for i, (run, groups) in enumerate(zip(runs, lines, strict=True)):
        _line(axes, groups, begin, mode_colour(run.mode, i), run.mode)
        _ticks(axes, groups, begin, floor - step * (i + 0.9), mode_colour(run.mode, i), 0.8 * step)
    axes.set_ylim(floor - step * (len(runs) + 0.4), 101)
    axes.set_yticks([tick for tick in axes.get_yticks() if 0 <= tick <= 100])  # below 0 there are ticks of frames only
    axes.set_xlabel("Log time, s")
    axes.set_ylabel("Pixel accuracy, %")
    title(axes, f"Pixel accuracy over the log ({chosen})", _below(size))
    legend_beside_title(axes, len(runs))
    return figure


def _below(size: int) -> str:
    if size == 1:
        return "One point per frame. Ticks below: frames without an answer of their own, in the colour of the mode."
    return f"Means of {size} frames, and their range. Below: the share of frames without an answer of their own."


def _any_has(inputs: ReportInputs, name: str) -> bool:
    return any(getattr(row, name) is not None for row in chain.from_iterable(inputs.frames.values()))


def _groups(rows: Sequence[FrameRow], name: str, size: int) -> list[_Group]:
    return [_Group.of(rows[i : i + size], name) for i in range(0, len(rows), size)]


def _line(axes: Axes, groups: Sequence[_Group], begin: int, colour: str, mode: str) -> None:
    seconds = [group.seconds(begin) for group in groups if group.scores]
    lowest, mean, highest = (
        zip(*(group.scores for group in groups if group.scores), strict=True) if seconds else [()] * 3
    )
    if any(group.scored > 1 for group in groups):
        axes.fill_between(seconds, lowest, highest, color=colour, alpha=0.18, lw=0)
    axes.plot(seconds, mean, color=colour, linewidth=1.4, label=mode)


def _ticks(axes: Axes, groups: Sequence[_Group], begin: int, bottom: float, colour: str, height: float) -> None:
    shown = [(group.seconds(begin), group.unanswered) for group in groups if group.unanswered]
    axes.vlines([x for x, _ in shown], bottom, [bottom + height * share for _, share in shown], color=colour, lw=1.0)
    if not shown:
        axes.annotate("all answered", (0, bottom), fontsize=7.5, color=MUTED)
