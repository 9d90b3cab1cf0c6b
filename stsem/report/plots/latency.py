"""How late the answers are: the share of all frames that is answered within a time."""

from array import array
from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from stsem.report.inputs import FrameRow, ReportInputs
from stsem.report.plots.style import INK, MUTED, SURFACE, apart, mode_colour, new_figure, title
from stsem.report.wording import number

POINTS = 2000
"""More answers than this are drawn at evenly spread ranks."""

_GROUND = {"facecolor": SURFACE, "edgecolor": "none", "pad": 1.0}


def draw(inputs: ReportInputs) -> Figure | None:
    """One rising step line per mode; it ends at the share of frames that got an answer; None without a clock."""
    samples = {run.mode: _ascending(inputs.rows(run.mode)) for run in inputs.document.runs}
    if not any(samples.values()):
        return None
    figure = new_figure(3.4)
    axes = figure.add_subplot()
    longest = max(times[-1] for times in samples.values() if times) / 1e6
    answered = [(i, run, samples[run.mode]) for i, run in enumerate(inputs.document.runs) if samples[run.mode]]
    shares = [100 * len(times) / run.frames for _, run, times in answered]
    for (i, run, times), share, height in zip(answered, shares, apart(shares, 7), strict=True):
        colour = mode_colour(run.mode, i)
        _steps(axes, times, run.frames, longest, colour)
        _median(axes, times, run.frames, colour, i)
        axes.annotate(f"{run.mode}: {share:.1f} %", (longest * 1.02, height), (5, 0), textcoords="offset points",
                      va="center", color=colour, fontweight="bold")  # fmt: skip
    _deadline(axes, inputs, longest)
    axes.set_xlim(0, longest * 1.32)
    axes.set_ylim(0, 104)
    axes.set_xlabel("Latency from arrival, ms of simulated time")
    axes.set_ylabel("Frames answered, %")
    below = "Share of all frames of the log; what is missing to 100 % was never answered. Dots: medians of the answers."
    title(axes, "Frames answered within a given latency", below)
    return figure


def _ascending(rows: Sequence[FrameRow]) -> Sequence[int]:
    return array("q", sorted(t for row in rows if (t := row.latency_ns) is not None))


def _steps(axes: Axes, times_ns: Sequence[int], frames: int, longest_ms: float, colour: str) -> None:
    ranks = sorted({i * (len(times_ns) - 1) // (POINTS - 1) for i in range(POINTS)})
    ms = [times_ns[k] / 1e6 for k in ranks]
    share = [100 * (k + 1) / frames for k in ranks]
    axes.step([0.0, *ms, longest_ms * 1.02], [0.0, *share, share[-1]], where="post", color=colour, linewidth=1.8)


def _median(axes: Axes, times_ns: Sequence[int], frames: int, colour: str, line: int) -> None:
    """Dot and words; each mode's words stand a line lower than those of the one before, as medians may be close."""
    middle = (len(times_ns) + 1) // 2 - 1
    median = times_ns[middle] / 1e6, 100 * (middle + 1) / frames
    axes.plot(*median, marker="o", color=colour, markersize=6)
    axes.annotate(f"median {median[0]:.0f} ms", median, (7, -4 - 12 * line), textcoords="offset points",
                  va="top", fontsize=8, color=colour, bbox=_GROUND)  # fmt: skip


def _deadline(axes: Axes, inputs: ReportInputs, longest_ms: float) -> None:
    deadlines = {run.throughput.deadline_ms for run in inputs.document.runs if run.throughput}
    for deadline in sorted(d for d in deadlines if d is not None and d <= 1.3 * longest_ms):
        axes.axvline(deadline, color=INK, linewidth=1.0, linestyle=(0, (4, 3)))
        axes.annotate(f"deadline {number(deadline)} ms", (deadline, 2), (4, 2), textcoords="offset points", fontsize=8,
                      color=MUTED)  # fmt: skip
