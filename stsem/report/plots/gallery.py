"""The table of pictures: file name -> what draws it, and what it shows."""

from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure

from stsem.report.inputs import ReportInputs
from stsem.report.plots import (
    calibration,
    classes,
    distance,
    latency,
    loss,
    overview,
    strip,
    timeline,
    trajectory,
    uncertainty,
)
from stsem.report.plots.style import look, png, svg


@dataclass(frozen=True)
class Picture:
    """A drawn picture.

    Args:
        name: stem of its file.
        png: for the folder and for Markdown.
        svg: for HTML; None for photographs.
    """

    name: str
    png: bytes
    svg: str | None


DRAWERS: dict[str, Callable[[ReportInputs], Figure | None]] = {
    "loss": loss.draw,
    "overview": overview.draw,
    "distance": distance.draw,
    "classes": classes.draw,
    "latency": latency.draw,
    "timeline": timeline.draw,
    "calibration": calibration.draw,
    "trajectory": trajectory.draw,
    "uncertainty": uncertainty.draw,
    "strip": strip.draw,
}
_PHOTOGRAPHS = ("strip", "uncertainty")


def draw_all(inputs: ReportInputs) -> dict[str, Picture]:
    """Every picture that this run has something for."""
    if not inputs.plots:
        return {}
    with look():
        return {
            name: Picture(name, png(figure), None if name in _PHOTOGRAPHS else svg(figure, name))
            for name, draw in DRAWERS.items()
            if (figure := draw(inputs)) is not None
        }
