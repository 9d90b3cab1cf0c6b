"""One look for all pictures, and how they become bytes."""

import io
import re
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
from matplotlib import transforms as mtransforms
from matplotlib.axes import Axes
from matplotlib.figure import Figure

INK, MUTED, GRID, SURFACE = "#1f2328", "#5b636c", "#d8dee4", "#ffffff"
BAD = "#b42318"
WHITE, BLACK = "#fffffe", "#1f2327"
"""On coloured areas, the same in the light and the dark theme."""

MODE_COLOURS = {"per-frame": "#0072b2", "keyframe": "#d55e00", "keyframe-async": "#009e73"}
"""Okabe and Ito's colours, told apart with every kind of colour blindness; a mode keeps its own in every picture."""
_FURTHER = ("#b5488b", "#7a6a00", "#3d5a80")

STAGE_COLOURS = {
    "decode": "#3b8f86", "register": "#56b4e9", "segment": "#6f4ea0", "propagate": "#e6a817",
    "track": "#c2548c", "fuse": "#a5744f",
}  # fmt: skip
"""One per stage of `stsem.result.STAGES`."""
UNKNOWN_STAGE = "#9aa4ad"

_RC: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "text.color": INK,
    "text.parse_math": False,
    "axes.labelcolor": INK,
    "axes.edgecolor": GRID,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.facecolor": "none",
    "figure.facecolor": SURFACE,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "xtick.major.size": 0.0,
    "ytick.major.size": 0.0,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "svg.fonttype": "none",
    "svg.hashsalt": "stsem",
    "path.simplify": False,
}

WIDTH_IN = 8.4
PNG_DPI = 150
_TITLE_PT = 22


def mode_colour(mode: str, position: int = 0) -> str:
    """The colour of a mode; unknown modes get further ones by their position."""
    return MODE_COLOURS.get(mode, _FURTHER[position % len(_FURTHER)])


@contextmanager
def look() -> Iterator[None]:
    """The common look: figures are made, drawn and saved inside it; whatever was set before comes back behind it."""
    with mpl.rc_context(_RC), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")  # names in scripts that DejaVu lacks
        yield


def new_figure(height_in: float) -> Figure:
    """An empty figure of the common width."""
    return Figure(figsize=(WIDTH_IN, height_in), layout="constrained")


def title(axes: Axes, text: str, below: str = "") -> None:
    """A bold title at the left, and a line in grey below it that says what exactly is shown."""
    axes.set_title(text, loc="left", fontsize=10.5, fontweight="bold", color=INK, pad=_TITLE_PT if below else 8)
    if below:
        axes.annotate(below, (0.0, 1.0), (0, 5), "axes fraction", "offset points", fontsize=8.5, color=MUTED)


def legend_beside_title(axes: Axes, entries: int) -> None:
    """The legend at the right end of the title's line."""
    above = mtransforms.ScaledTranslation(0, _TITLE_PT / 72, axes.figure.dpi_scale_trans)
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), bbox_transform=axes.transAxes + above, ncols=entries,
                borderpad=0.0, borderaxespad=0.0, handlelength=1.4, columnspacing=1.4)  # fmt: skip


def apart(heights: Sequence[float], gap: float) -> list[float]:
    """`heights` moved down where needed, so that no two are closer than `gap`; the highest stays."""
    moved = list(heights)
    ceiling = float("inf")
    for i in sorted(range(len(moved)), key=lambda i: -moved[i]):
        moved[i] = min(moved[i], ceiling)
        ceiling = moved[i] - gap
    return moved


def png(figure: Figure) -> bytes:
    """The picture as PNG, without dates; the layout found for it stays."""
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=PNG_DPI, metadata={"Software": None})
    figure.set_layout_engine("none")
    return out.getvalue()


_THEMED = {INK: "ink", MUTED: "muted", GRID: "grid", SURFACE: "surface", BAD: "bad"} | {
    colour: f"mode-{mode}" for mode, colour in MODE_COLOURS.items()
}


def svg(figure: Figure, name: str) -> str:
    """The picture as an `<svg>` element for HTML: real text, colours that follow the page's light or dark theme.

    `name` keeps the ids of several pictures on one page apart.
    """
    out = io.StringIO()
    with mpl.rc_context({"svg.hashsalt": f"stsem-{name}"}):
        figure.savefig(
            out, format="svg", transparent=True, metadata=dict.fromkeys(("Date", "Creator", "Format", "Type"))
        )
    text = out.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>\s*", "", text, flags=re.DOTALL)
    used = set(re.findall(r'#([^")]+)[")]', text))
    text = re.sub(r' id="([^"]+)"', lambda found: found[0] if found[1] in used else "", text)
    text = re.sub(r'<svg ([^>]*?)width="[^"]+" height="[^"]+"|<svg height="[^"]+" width="[^"]+"', r"<svg \1", text)
    text = re.sub(r"font: ([^;\"]*?)'DejaVu Sans'[^;\"]*", r"font: \1system-ui, sans-serif", text)
    for colour, variable in _THEMED.items():
        text = text.replace(f": {colour}", f": var(--{variable}, {colour})")
    return text
