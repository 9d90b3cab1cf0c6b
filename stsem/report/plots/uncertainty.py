"""The frame that the network is least sure of: what it saw, what it said, where that is wrong, and where it doubts."""

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from stsem.classes import NO_LABEL
from stsem.document.schema import Run
from stsem.frame import Image
from stsem.report.inputs import ReportInputs, UnsureFrame
from stsem.report.plots.strip import RIGHT, wrong_pixels
from stsem.report.plots.style import BAD, INK, MUTED, new_figure
from stsem.report.wording import MEASURES, percent
from stsem.uncertainty import DOUBT, UNITS

_COLUMN_IN = 2.1
_COLUMNS = 4
_MAP_COLOURS = "magma"


def draw(inputs: ReportInputs) -> Figure | None:
    """Two rows: pictures, and a map per measure; None for a network without maps."""
    frame, classes = inputs.unsure, inputs.class_set
    if frame is None or classes is None:
        return None
    palette = classes.palette()
    pictures, maps = list(_pictures(frame, palette)), list(_maps(frame, inputs.document.run(frame.mode)))
    aspect = frame.image.shape[0] / frame.image.shape[1]
    figure = new_figure(1.0)
    for place, (heading, caption, picture) in enumerate(pictures, start=1):
        axes = figure.add_subplot(2, _COLUMNS, place)
        axes.imshow(picture, interpolation="nearest")
        _frame_of(axes, heading, caption)
    for place, (heading, caption, values) in enumerate(maps, start=_COLUMNS + 1):
        axes = figure.add_subplot(2, _COLUMNS, place)
        low, high = _range(values)
        axes.imshow(values, cmap=_MAP_COLOURS, vmin=low, vmax=high if high > low else low + 1, interpolation="nearest")
        _frame_of(axes, heading, caption)
    seen = sorted({int(k) for labels in (frame.truth, frame.labels) if labels is not None for k in np.unique(labels)})
    handles = [Patch(color=palette[k] / 255, label=classes.names[k]) for k in seen if k < len(classes)]
    handles += [Patch(color="#000000", label="ignored, or no label")] * (NO_LABEL in seen)
    figure.legend(handles=handles, loc="outside lower left", ncols=6, title="Classes", alignment="left")
    _scale(figure)
    legend_in = 0.4 + 0.165 * max(2, -(-len(handles) // 6))
    figure.set_size_inches(_COLUMN_IN * _COLUMNS, 2 * (_COLUMN_IN * aspect + 0.45) + legend_in)
    return figure


def _pictures(frame: UnsureFrame, palette: npt.NDArray[np.uint8]) -> Iterator[tuple[str, str, Image]]:
    """(heading, caption, picture) of the first row."""
    yield "image", f"frame {frame.index}", frame.image
    if frame.truth is not None:
        yield "truth", "", palette[frame.truth]
    yield "answer", f"{frame.mode}, segmented", palette[frame.labels]
    if frame.truth is not None:
        wrong, judged = wrong_pixels(frame.truth, frame.labels), frame.truth != NO_LABEL
        share = f"{percent(wrong.sum() / judged.sum())} % of its pixels" if judged.any() else ""
        yield "wrong pixels", share, _red(wrong, judged)


def _red(wrong: npt.NDArray[np.bool_], judged: npt.NDArray[np.bool_]) -> Image:
    picture = np.full((*wrong.shape, 3), RIGHT, np.uint8)
    picture[wrong] = tuple(bytes.fromhex(BAD[1:]))
    picture[~judged] = 255
    return picture


def _maps(frame: UnsureFrame, run: Run | None) -> Iterator[tuple[str, str, npt.NDArray[np.float64]]]:
    """(heading, caption, values) of the second row: the network's measures, and 1 - confidence."""
    found = {measure: frame.uncertainty.values(measure) for measure in frame.uncertainty.measures}
    if frame.confidence is not None:
        found[DOUBT] = 1 - frame.confidence.astype(np.float64)
    auc = run.error_detection.auc if run is not None and run.error_detection is not None else {}
    for measure, values in found.items():
        area = auc.get(measure)
        said = "" if area is None else f"; AUC {area:.2f}"
        low, high = _range(values)
        yield MEASURES[measure], f"{low:.2g} to {high:.2g} {UNITS.get(measure, '')}".rstrip() + said, values


def _range(values: npt.NDArray[np.float64]) -> tuple[float, float]:
    """All but the lowest and the highest hundredth."""
    low, high = np.quantile(values, (0.01, 0.99)).tolist()
    return low, high


def _scale(figure: Figure) -> None:
    """One scale for all maps, each over its own range."""
    axes = figure.add_axes((0.79, 0.075, 0.2, 0.02))
    bar = figure.colorbar(ScalarMappable(Normalize(0, 1), _MAP_COLOURS), cax=axes, orientation="horizontal")
    bar.outline.set_visible(False)
    bar.set_ticks([0, 1], labels=["low", "high"])
    for label, side in zip(axes.get_xticklabels(), ("left", "right"), strict=True):
        label.set(ha=side)
    axes.set_title("Uncertainty", fontsize=8.5, color=INK, loc="left", pad=4)


def _frame_of(axes: Axes, heading: str, caption: str) -> None:
    axes.set_xticks([])
    axes.set_yticks([])
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    axes.set_title(heading, fontsize=10, fontweight="bold", color=INK, loc="left")
    axes.set_xlabel(caption, fontsize=8, color=MUTED, loc="left", labelpad=2)
