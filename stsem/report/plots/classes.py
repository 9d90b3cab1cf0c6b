"""IoU of every class, for every mode."""

from matplotlib.figure import Figure

from stsem.document.accuracy import Score
from stsem.document.schema import Run
from stsem.report.inputs import ReportInputs
from stsem.report.plots.style import INK, MUTED, WHITE, legend_beside_title, mode_colour, new_figure, title

PASSES = ("offline", "delivered", "streaming")


def best_pass(runs: tuple[Run, ...]) -> str | None:
    """The first pass that every run has: offline if it ran."""
    return next((name for name in PASSES if runs and all(getattr(run, name) for run in runs)), None)


def present_classes(score: Score, order: tuple[str, ...]) -> list[str]:
    """Classes with truth pixels, the most frequent first; in the log's order where frequencies are unknown or equal."""
    present = [name for name in order if score.iou.get(name) is not None]
    return sorted(present, key=lambda name: -score.class_pixels.get(name, 0))


def draw(inputs: ReportInputs) -> Figure | None:
    """Bars of the offline IoU, a diamond where the streaming IoU stands; None without accuracy."""
    runs = inputs.document.runs
    chosen = best_pass(runs)
    if chosen is None:
        return None
    first: Score = getattr(runs[0], chosen)
    classes = present_classes(first, inputs.document.input.classes)
    if not classes:
        return None
    thick = 0.8 / len(runs)
    figure = new_figure(1.1 + len(classes) * (0.16 + 0.15 * len(runs)))
    axes = figure.add_subplot()
    for i, run in enumerate(runs):
        offset = [j + (i - (len(runs) - 1) / 2) * thick for j in range(len(classes))]
        _bars(axes, run, chosen, classes, offset, thick, mode_colour(run.mode, i))
    axes.set_yticks(range(len(classes)), [_label(name, first) for name in classes], color=INK)
    axes.set_ylim(len(classes) - 0.4, -0.6)
    axes.set_xlim(0, 108)
    axes.set_xticks(range(0, 101, 20))
    axes.set_xlabel("IoU, %")
    axes.grid(visible=False, axis="y")
    streaming = chosen != "streaming" and any(run.streaming for run in runs)
    title(axes, "IoU of each class", f"Bars and figures: {chosen}{'; diamonds: streaming' if streaming else ''}. "
          "Most frequent class first; in brackets its share of the truth.")  # fmt: skip
    legend_beside_title(axes, len(runs))
    return figure


def _bars(axes, run, chosen, classes, offset, thick, colour) -> None:  # type: ignore[no-untyped-def]
    score: Score = getattr(run, chosen)
    values = [100 * (score.iou.get(name) or 0.0) for name in classes]
    axes.barh(offset, values, height=thick * 0.92, color=colour, label=run.mode)
    for y, value in zip(offset, values, strict=True):
        axes.text(value + 0.8, y, f"{value:.0f}", va="center", fontsize=7.5, color=MUTED)
    if run.streaming and chosen != "streaming":
        late = [100 * (run.streaming.iou.get(name) or 0.0) for name in classes]
        axes.scatter(late, offset, marker="D", s=14, color=WHITE, edgecolors=INK, linewidths=0.8, zorder=3)


def _label(name: str, score: Score) -> str:
    total = sum(score.class_pixels.values())
    if not total:
        return name
    return f"{name}  ({100 * score.class_pixels.get(name, 0) / total:.0f} %)"
