"""Where mIoU is lost, from a perfect answer to the streaming score."""

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stsem.document.schema import Run
from stsem.report.inputs import ReportInputs
from stsem.report.plots.style import INK, mode_colour, new_figure, title
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
    levels = {run.mode: _levels(run) for _, run in runs}
    for i, run in runs:
        others = [level for mode, level in levels.items() if mode != run.mode]
        _line(axes, run, mode_colour(run.mode, i), others, alone=run is runs[0][1])
    axes.set_xticks(range(len(_STEPS)), [f"{name}\n({left})" for name, left in zip(_STEPS, _LEFT, strict=True)])
    axes.set_xlim(-0.25, len(_STEPS) - 1 + 1.0)
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


def _line(axes: Axes, run: Run, colour: str, others: list[list[float]], *, alone: bool) -> None:
    levels = _levels(run)
    axes.plot(range(len(levels)), levels, color=colour, linewidth=2, marker="o", markersize=5)
    for k in range(1, len(levels)):
        drop = levels[k] - levels[k - 1]
        if abs(drop) >= 0.05 and (k > 1 or alone):  # the network's part is the same in every mode
            higher = all(levels[k] >= other[k] for other in others if k < len(other))
            beside = (16 if k == 1 else 0, 8 if higher else -16)
            axes.annotate(signed(drop), (k, levels[k]), beside, textcoords="offset points", ha="center", fontsize=8.5,
                          color=INK if k == 1 else colour)  # fmt: skip
    axes.annotate(f"{run.mode} {levels[-1]:.1f} %", (len(levels) - 1, levels[-1]), (10, 0), textcoords="offset points",
                  va="center", color=colour, fontweight="bold")  # fmt: skip
