"""The look of the report's figures: one palette, one size of type, SVG that carries its own glyphs."""

from __future__ import annotations

import io
import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from fatigue_runner.results.ranking import MethodSummary

if TYPE_CHECKING:
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

WIDTH = 8.0  # in; drawn at 180 mm on an A4 page, where 8 pt type becomes 7 pt

INK, QUIET, FAINT = "#1a1a1a", "#6b6b6b", "#d5d5d5"

# Okabe & Ito (2008), "Color universal design": told apart by readers with any common colour blindness. Their
# yellow is left out: it does not print. Markers repeat the distinction for print in black and white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
MARKERS = ("o", "s", "^", "D", "v", "P")
LINES: tuple[Any, ...] = (
    "-",
    (0, (5, 1.6)),
    (0, (1.2, 1.2)),
    (0, (6, 1.5, 1.2, 1.5)),
    (0, (3, 1.2, 1, 1.2, 1, 1.2)),
)

_RC: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 8,
    "axes.edgecolor": QUIET,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "xtick.color": QUIET,
    "ytick.color": QUIET,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.minor.width": 0.4,
    "ytick.minor.width": 0.4,
    "grid.color": FAINT,
    "grid.linewidth": 0.5,
    "lines.linewidth": 1.2,
    "lines.markersize": 4.5,
    "legend.frameon": False,
    "legend.fontsize": 7.5,
    "text.color": INK,
    "svg.fonttype": "path",  # the page must look the same where the font is missing
    "svg.hashsalt": "fatigue-runner",  # the same run gives the same bytes
}


@dataclass(frozen=True)
class Look:
    """How one integrator is drawn: the colour and marker of its method, the line of its step."""

    colour: str
    marker: str
    line: Any

    def curve(self) -> dict[str, Any]:
        """Keywords for a line."""
        return {"color": self.colour, "linestyle": self.line}

    def dots(self, filled: bool = False) -> dict[str, Any]:
        """Keywords for markers without a line."""
        face = self.colour if filled else "white"
        return {"color": self.colour, "marker": self.marker, "markerfacecolor": face, "linestyle": "none"}


def looks(summaries: Iterable[MethodSummary]) -> dict[MethodSummary, Look]:
    """A look for every integrator: method by colour and marker, step by line; the reference in black."""
    families: dict[tuple[str, str, str], list[MethodSummary]] = {}
    for summary in summaries:
        if not summary.is_reference:
            families.setdefault(family(summary), []).append(summary)
    found = {s: Look(INK, "o", "-") for s in summaries if s.is_reference}
    for i, name in enumerate(sorted(families)):
        members = sorted(families[name], key=lambda s: -(s.step or 0.0))
        for j, summary in enumerate(members):
            found[summary] = Look(COLOURS[i % len(COLOURS)], MARKERS[i % len(MARKERS)], LINES[j % len(LINES)])
    return found


def family(summary: MethodSummary) -> tuple[str, str, str]:
    """What shares a colour: the method with its corrector and mode, whatever the step."""
    return summary.method, summary.corrector, summary.mode


@contextmanager
def styled() -> Iterator[None]:
    """Matplotlib with the report's settings, the user's own left as they were."""
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(_RC)
        yield


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """An empty figure [in] drawn without a display and without pyplot's global state."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasSVG(figure)
    return figure


def to_svg(figure: Figure) -> str:
    """The figure as an SVG document with its glyphs as outlines."""
    _freeze_layout(figure)
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return buffer.getvalue()


def _freeze_layout(figure: Figure) -> None:
    """Lay the figure out once, on a grid: the solver's last bits differ from run to run, and they name clip paths."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
    figure.set_layout_engine("none")
    for axes in figure.axes:
        left, bottom, width, height = (round(value, 6) for value in axes.get_position().bounds)
        axes.set_position((left, bottom, width, height))


def draw_legend(
    figure: Figure, shown: Sequence[MethodSummary], look: dict[MethodSummary, Look], dots: bool = False
) -> None:
    """One legend above all axes: a line per integrator, with its marker where the figure has `dots`."""
    from matplotlib.lines import Line2D

    entries = [
        Line2D(
            [],
            [],
            label=s.label + (" (reference)" if s.is_reference else ""),
            **look[s].curve(),
            **_dot(look[s], s, dots),
        )
        for s in shown
    ]
    # An entry takes its line and its gap (about 42 pt) and its glyphs; more than one row where they are too wide.
    # A column is as wide as its widest entry.
    widths, room = (
        [42.0 + 4.3 * len(str(entry.get_label())) for entry in entries],
        72.0 * figure.get_figwidth(),
    )
    ncols = math.ceil(len(entries) / math.ceil(sum(widths) / room))
    while ncols > 1 and _columns_width(widths, ncols) > room:
        ncols -= 1
    figure.legend(handles=entries, loc="outside upper center", ncols=ncols, handlelength=2.6)


def _columns_width(widths: Sequence[float], ncols: int) -> float:
    """Of a legend that fills one column after the other."""
    rows = math.ceil(len(widths) / ncols)
    return sum(max(widths[i : i + rows]) for i in range(0, len(widths), rows))


def _dot(look: Look, summary: MethodSummary, dots: bool) -> dict[str, Any]:
    return {"marker": look.marker, "markerfacecolor": "white"} if dots and not summary.is_reference else {}


def plain_logarithm(axis: Axis) -> None:
    """Ticks of a logarithmic axis written out, at 1, 2, 5 times powers of ten (powers over 3 decades)."""
    from matplotlib.ticker import LogLocator, NullFormatter

    low, high = axis.get_view_interval()
    subs = (1.0, 2.0, 5.0) if high / low < 1e3 else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(_plain)
    axis.set_minor_formatter(NullFormatter())


def _plain(value: float, _position: float = 0.0) -> str:
    return f"{value:g}"


def percent(value: float, _position: float = 0.0) -> str:
    """A tick's relative value as a percentage."""
    shown = value * 100
    # Far below what matters the power says more than the zeros.
    return f"{shown:g} %" if shown > 0.9e-3 else f"$10^{{{math.log10(shown):.0f}}}$ %"
