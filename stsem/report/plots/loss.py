"""Where mIoU is lost, from a perfect answer to the streaming score."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stsem.document.schema import Run
from stsem.report.inputs import ReportInputs
from stsem.report.plots.style import INK, apart, mode_colour, new_figure, title
from stsem.report.wording import signed

_STEPS = ("perfect", "network", "prediction", "scheduling", "staleness")
_LEFT = ("100 %", "per-frame offline", "offline", "delivered", "streaming")


def draw(inputs: ReportInputs) -> Figure | None:
    """One falling line per mode, a step per part of the loss; None where the parts were not measured."""
    runs = [(i, run) for i, run in enumerate(inputs.document.runs) if len(_levels(run)) > 2]
    if not runs:
        return None
    figure = new_figure(3.6)
    axes = figure.add_subplot()
    levels = [_levels(run) for _, run in runs]
    reach = max(map(max, levels)) - min(map(min, levels))
    ends = apart([level[-1] for level in levels], 0.07 * reach)
    for (i, run), own, end in zip(runs, levels, ends, strict=True):
        others = [level for level in levels if level is not own]
        _line(axes, own, mode_colour(run.mode, i), others, first=own is levels[0])
        last = f"{signed(own[-1] - own[-2])}   {run.mode} {own[-1]:.1f} %"
        axes.annotate(last, (len(own) - 1, end), (10, 0), textcoords="offset points", va="center",
                      color=mode_colour(run.mode, i), fontweight="bold")  # fmt: skip
    axes.set_xticks(range(len(_STEPS)), [f"{name}\n({left})" for name, left in zip(_STEPS, _LEFT, strict=True)])
    axes.set_xlim(-0.25, len(_STEPS) - 1 + 1.35)
    axes.set_ylabel("mIoU, %")
    axes.margins(y=0.13)
    axes.grid(visible=False, axis="x")
    title(
        axes,
        "mIoU left after each part of the loss",
        "In brackets: the score that is left after the step. Figures: points lost in the step.",
    )
    return figure


def _levels(run: Run) -> list[float]:
    """mIoU in per cent after each part, as far as the parts were measured."""
    levels = [1.0]
    for name in _STEPS[1:]:
        part = getattr(run.loss, name) if run.loss else None
        if part is None:
            break
        levels.append(levels[-1] - part)
    return [100 * level for level in levels]


def _line(axes: Axes, levels: list[float], colour: str, others: list[list[float]], *, first: bool) -> None:
    axes.plot(range(len(levels)), levels, color=colour, linewidth=2, marker="o", markersize=5)
    for k in range(1, len(levels) - 1):
        drop = levels[k] - levels[k - 1]
        if abs(drop) < 0.05 or (k == 1 and not first):  # the network's part is the same in every mode
            continue
        higher = all(levels[k] >= other[k] for other in others if k < len(other))
        beside = (16 if k == 1 else 0, 8 if higher else -16)
        axes.annotate(signed(drop), (k, levels[k]), beside, textcoords="offset points", ha="center", fontsize=8.5,
                      color=INK if k == 1 else colour)  # fmt: skip
