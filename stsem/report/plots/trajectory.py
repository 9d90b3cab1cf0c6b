"""Where the camera went, seen from above: SLAM's path beside the log's."""

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stsem.pose import Trajectory
from stsem.report.inputs import ReportInputs
from stsem.report.plots.style import INK, MUTED, legend_beside_title, new_figure, title

POINTS = 2_000
"""Longer trajectories are drawn with every second, third, ... pose."""

F64 = npt.NDArray[np.float64]
_LINES = {"log": (MUTED, 3.2, 0.55), "slam": (INK, 1.3, 1.0)}
"""Colour, width and opacity: the log's path lies below, wide and pale."""


def draw(inputs: ReportInputs) -> Figure | None:
    """Both paths in the plane that is level for the camera on average; None where there is only the log's."""
    paths = {name: path for name, path in inputs.paths.items() if len(path) > 1}
    if "slam" not in paths:
        return None
    first = paths.get("log", paths["slam"])
    origin, directions = first.poses[0, :3, 3], _level(first)
    figure = new_figure(4.2)
    axes = figure.add_subplot()
    for name, path in paths.items():
        _line(axes, name, (path.poses[:: 1 + (len(path) - 1) // POINTS, :3, 3] - origin) @ directions)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel("Ahead of the first view, m")
    axes.set_ylabel("Left of it, m")
    below = "Seen from above; SLAM's brought onto the log's by a rigid motion. Circle: the first pose."
    title(axes, "Path of the camera", below if "log" in paths else "Seen from above. Circle: the first pose.")
    legend_beside_title(axes, len(paths))
    return figure


def _line(axes: Axes, name: str, points: F64) -> None:
    """`points`: (n, 2) metres ahead and to the left."""
    colour, width, opacity = _LINES[name]
    axes.plot(points[:, 0], points[:, 1], color=colour, linewidth=width, alpha=opacity, label=f"{name} poses",
              solid_capstyle="round")  # fmt: skip
    axes.plot(points[:1, 0], points[:1, 1], color=colour, marker="o", markersize=5, alpha=opacity, linestyle="none")


def _level(path: Trajectory) -> F64:
    """(3, 2) directions ahead and left, in the plane that is level if the camera's y axis points down on average."""
    down = path.poses[:, :3, 1].sum(axis=0)
    down = down / max(float(np.linalg.norm(down)), 1e-9)
    ahead = path.poses[0, :3, 2] - down * float(path.poses[0, :3, 2] @ down)
    if np.linalg.norm(ahead) < 1e-6:
        ahead = path.poses[0, :3, 0] - down * float(path.poses[0, :3, 0] @ down)
    ahead = ahead / max(float(np.linalg.norm(ahead)), 1e-9)
    return np.stack([ahead, np.cross(ahead, down)], axis=1)
