"""A strip of frames: image, truth, the answer of each mode, and where they are wrong."""

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from stsem.classes import NO_LABEL, Labels
from stsem.frame import Image
from stsem.report.inputs import ReportInputs, StripFrame
from stsem.report.plots.style import INK, MUTED, mode_colour, new_figure
from stsem.report.wording import plural

RIGHT, BOTH = (222, 226, 230), (45, 45, 52)
_COLUMN_IN = 2.1


def draw(inputs: ReportInputs) -> Figure | None:
    """A row per frame; None without frames or classes."""
    classes = inputs.class_set
    if not inputs.strip or classes is None:
        return None
    modes = [run.mode for run in inputs.document.runs if any(run.mode in frame.answers for frame in inputs.strip)]
    with_truth = any(frame.truth is not None for frame in inputs.strip)
    titles = ["image", *["truth"] * with_truth, *modes, *["errors"] * (with_truth and bool(modes))]
    aspect = inputs.strip[0].image.shape[0] / inputs.strip[0].image.shape[1]
    predicting = {run.mode for run in inputs.document.runs if run.outcomes.propagated or len(run.by_distance) > 1}
    figure = new_figure(1.0)
    palette = classes.palette()
    seen: set[int] = set()
    for i, frame in enumerate(inputs.strip):
        pictures = _pictures(frame, modes, palette, seen, with_truth)
        for j, (name, picture) in enumerate(zip(titles, pictures, strict=True)):
            axes = figure.add_subplot(len(inputs.strip), len(titles), i * len(titles) + j + 1)
            _cell(axes, frame.image.shape[:2], picture, name if i == 0 else "", _caption(frame, name, j, predicting))
    handles = [Patch(color=_hex(palette[k]), label=classes.names[k]) for k in sorted(seen) if k < len(classes)]
    handles += [Patch(color="#000000", label="ignored, or no label")] * (NO_LABEL in seen)
    columns = len(titles) if with_truth else len(titles) + 2
    figure.legend(handles=handles, loc="outside lower left", ncols=columns, title="Classes", alignment="left")
    if with_truth:
        wrong = _error_legend(modes)
        beside = max(2, -(-len(wrong) // 2))  # two rows, as the classes have or more
        figure.legend(handles=wrong, loc="lower right", ncols=beside, title="Errors", alignment="left")
    legend_in = 0.36 + 0.165 * max(2, -(-len(handles) // columns))
    figure.set_size_inches(_COLUMN_IN * len(titles), len(inputs.strip) * (_COLUMN_IN * aspect + 0.2) + 0.25 + legend_in)
    return figure


def _pictures(
    frame: StripFrame, modes: list[str], palette: npt.NDArray[np.uint8], seen: set[int], with_truth: bool
) -> list[Image | None]:
    truth = frame.truth
    pictures: list[Image | None] = [frame.image]
    if with_truth:
        pictures.append(None if truth is None else palette[truth])
    pictures += [palette[frame.answers[mode]] if mode in frame.answers else None for mode in modes]
    if with_truth and modes:
        pictures.append(None if truth is None else errors(truth, frame.answers, modes))
    for labels in (truth, *frame.answers.values()):
        if labels is not None:
            seen.update(int(k) for k in np.unique(labels))
    return pictures


def errors(truth: Labels, answers: Mapping[str, Labels], modes: list[str]) -> Image:
    """(h, w, 3): grey where all are right, a mode's colour where only that mode is wrong, dark where several are.

    Args:
        truth: (h, w) labels; 255 is left white.
        answers: mode -> labels; a mode without an answer is wrong everywhere.
        modes: the modes compared, in the order of the report.
    """
    wrong = np.stack([wrong_pixels(truth, answers.get(mode)) for mode in modes])
    picture = np.empty((*truth.shape, 3), np.uint8)
    picture[:] = RIGHT
    for i, mode in enumerate(modes):
        picture[wrong[i]] = _rgb(mode_colour(mode, i))
    if len(modes) > 1:
        picture[wrong.sum(axis=0) > 1] = BOTH
    picture[truth == NO_LABEL] = 255
    return picture


def wrong_pixels(truth: Labels, answer: Labels | None) -> npt.NDArray[np.bool_]:
    """(h, w) where a judged pixel of `truth` (h, w) has another label, or none; `answer` may have another size."""
    if answer is None:
        return np.asarray(truth != NO_LABEL)
    rows = np.arange(truth.shape[0]) * answer.shape[0] // truth.shape[0]
    columns = np.arange(truth.shape[1]) * answer.shape[1] // truth.shape[1]
    return np.asarray((answer[rows[:, None], columns[None, :]] != truth) & (truth != NO_LABEL))


def _rgb(colour: str) -> tuple[int, int, int]:
    return int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:7], 16)


def _hex(rgb: Sequence[int] | npt.NDArray[np.uint8]) -> str:
    return "#" + "".join(f"{int(c):02x}" for c in rgb)


def _cell(axes: Axes, size: tuple[int, int], picture: Image | None, heading: str, caption: str) -> None:
    axes.set_xticks([])
    axes.set_yticks([])
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    blank = np.full((*size, 3), 246, np.uint8)
    axes.imshow(blank if picture is None else picture, interpolation="nearest")
    if picture is None:
        axes.text(0.5, 0.5, "none", ha="center", va="center", fontsize=9, color=MUTED, transform=axes.transAxes)
    if heading:
        axes.set_title(heading, fontsize=10, fontweight="bold", color=INK, loc="left")
    axes.set_xlabel(caption, fontsize=8, color=MUTED, loc="left", labelpad=2)


def _caption(frame: StripFrame, name: str, column: int, predicting: set[str]) -> str:
    if column == 0:
        return f"frame {frame.index}"
    distance = frame.distance.get(name) if name in predicting else None
    if distance is None:
        return ""
    return "is a keyframe" if distance == 0 else f"{plural(distance, 'frame')} after its keyframe"


def _error_legend(modes: list[str]) -> list[Patch]:
    only = "only {} wrong" if len(modes) > 1 else "{} wrong"
    handles = [Patch(color=mode_colour(mode, i), label=only.format(mode)) for i, mode in enumerate(modes)]
    several = [Patch(color=_hex(BOTH), label="both wrong" if len(modes) == 2 else "several wrong")]
    return [*handles, *(several if len(modes) > 1 else []), Patch(color=_hex(RIGHT), label="right")]
