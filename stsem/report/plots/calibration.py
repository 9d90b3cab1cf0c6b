"""The reliability figure: accuracy over confidence, and how many pixels have which confidence."""

from collections.abc import Iterator
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stsem.document.calibration import Calibration, ReliabilityBin
from stsem.document.schema import Run
from stsem.report.inputs import ReportInputs
from stsem.report.plots.style import MUTED, SURFACE, mode_colour, new_figure, title

FEW = 0.001
"""Share of the pixels below which a bin is drawn hollow: it hardly counts in the expected error."""


@dataclass(frozen=True)
class _Curve:
    label: str
    colour: str
    dashed: bool
    found: Calibration


def draw(inputs: ReportInputs) -> Figure | None:
    """A curve per kind of answer; None where no answer states a confidence."""
    curves = list(_curves(inputs.document.runs))
    if not curves:
        return None
    figure = new_figure(4.1)
    left, right = figure.subplots(1, 2)
    left.plot([0, 100], [0, 100], color=MUTED, linewidth=1.0, linestyle=":")
    left.annotate("as right as it says", (62, 62), (6, -9), textcoords="offset points", fontsize=8, color=MUTED)
    for curve in curves:
        _reliability(left, curve)
    _shares(right, curves)
    for axes, below in (
        (left, "Below the line: too sure of itself. Hollow: under 0.1 % of the pixels."),
        (right, "By confidence."),
    ):
        axes.set_xlim(0, 100)
        axes.set_xlabel("Confidence, %")
        title(axes, "Accuracy over confidence" if axes is left else "Share of the pixels", below)
    left.set_ylim(0, 103)
    left.set_ylabel("Right pixels, %")
    right.set_ylabel("Pixels, %")
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower left", ncols=len(curves))
    return figure


def _curves(runs: tuple[Run, ...]) -> Iterator[_Curve]:
    """The network's answers once, the predicted ones of each mode; delivered ones where there was no other pass."""
    segmented = False
    for i, run in enumerate(runs):
        parts = [name for name in run.calibration if name != "delivered"] or list(run.calibration)
        for name in sorted(parts, key=("segmented", "propagated", "delivered").index):
            if name == "segmented" and segmented:
                continue
            segmented |= name == "segmented"
            found = run.calibration[name]
            label = f"{run.mode}, {name}: ECE {100 * (found.ece or 0.0):.1f} %"
            yield _Curve(label, mode_colour(run.mode, i), dashed=name == "propagated" and len(parts) > 1, found=found)


def _reliability(axes: Axes, curve: _Curve) -> None:
    full = [part for part in curve.found.bins if part.pixels]
    x, y = [100 * (part.confidence or 0.0) for part in full], [100 * (part.accuracy or 0.0) for part in full]
    axes.plot(x, y, color=curve.colour, linewidth=1.8, linestyle="--" if curve.dashed else "-", label=curve.label)
    for part, across, up in zip(full, x, y, strict=True):
        axes.plot(across, up, marker="o", markersize=5.5, color=curve.colour, markeredgewidth=1.3,
                  markerfacecolor=SURFACE if _share(part, curve.found) < FEW else curve.colour)  # fmt: skip


def _shares(axes: Axes, curves: list[_Curve]) -> None:
    for curve in curves:
        edges = [100 * (part.lower or 0.0) for part in curve.found.bins] + [100.0]
        shares = [100 * _share(part, curve.found) for part in curve.found.bins]
        axes.stairs(shares, edges, color=curve.colour, linewidth=1.8, linestyle="--" if curve.dashed else "-")
    axes.set_ylim(bottom=0)


def _share(part: ReliabilityBin, found: Calibration) -> float:
    return part.pixels / found.pixels if found.pixels else 0.0
