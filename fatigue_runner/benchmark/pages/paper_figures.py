"""The figures of arXiv:2504.05493 from this project's measurements: median error over delta_t, and box plots of the error over it in
range and out of range."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fatigue_runner.benchmark.study import paper
from fatigue_runner.benchmark.study.paper import Outcome

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAMES = {"heun": "Heun", "rk3": "RK3", "heun-richardson": "Heun + Richardson"}
SAME, SHIFT = 0.05, 0.09  # boxes whose costs are that close stand that far apart, as shares of the cost
SCALES = {"paper": 1.0, "lane": 1e6}
LABELS = {
    "paper": "δt: processor time per simulated second [s]",
    "lane": "δt: processor time per simulated second [µs]",
}
ERRORS = {"delta_e_range": r"$\delta_{e,\mathrm{range}}$", "delta_e": r"$\delta_e$"}


def name(label: str) -> str:
    """`heun + network, hybrid` as a figure writes it."""
    return NAMES.get(label, label.replace("heun", "Heun", 1).replace(", enhanced", ""))


def looks(outcomes: Sequence[Outcome]) -> dict[str, tuple[str, str]]:
    """(colour, marker) by label."""
    from fatigue_runner.report.style import COLOURS, INK, MARKERS

    colours, markers = (*COLOURS, INK), (*MARKERS, "X")
    labels = list(dict.fromkeys(o.label for o in outcomes))
    return {label: (colours[i % len(colours)], markers[i % len(markers)]) for i, label in enumerate(labels)}


def work_precision(measured: dict[str, Any]) -> Figure:
    """Median delta_e_range over delta_t where f is as slow as the paper's, and compiled."""
    from fatigue_runner.report.style import new_figure

    figure = new_figure(3.7)
    left, right = figure.subplots(1, 2, sharey=True)
    for label, (colour, marker) in looks(measured["outcomes"]).items():
        chosen = sorted((o for o in measured["outcomes"] if o.label == label), key=lambda o: -o.step)
        y = [float(np.median(o.values("delta_e_range"))) for o in chosen]
        learned = bool(chosen[0].mode)
        for axes, kind in ((left, "paper"), (right, "lane")):
            x = [o.delta_t[kind] * SCALES[kind] for o in chosen]
            axes.plot(x, y, color=colour, marker=marker, linestyle=":" if learned else "-",
                      markersize=6 if learned else 4.5, markerfacecolor=colour if learned else "white", label=name(label))  # fmt: skip
    for axes, title, kind in (
        (left, "With an f of 1.5 ms, as in the paper", "paper"),
        (right, "Compiled, per case of many", "lane"),
    ):
        axes.set(xscale="log", yscale="log", title=title, xlabel=LABELS[kind])
        axes.grid(True)
    left.set_ylabel(f"median {ERRORS['delta_e_range']}")
    handles, labels = left.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=4)
    return figure


def boxes(
    in_range: dict[str, Any], out_of_range: dict[str, Any], error: str = "delta_e_range", kind: str = "paper"
) -> Figure:
    """Box plots of delta_e_range, or of the paper's delta_e, over delta_t: in and out of range, at 10 and 5 ms; in range RK3 also at
    15 and 10 ms."""
    from matplotlib.patches import Patch

    from fatigue_runner.report.style import new_figure

    figure = new_figure(6.0)
    grid = figure.subplots(len(paper.BOXED), 2, sharey=True, sharex=True)
    look = looks(in_range["outcomes"])
    for row, step in zip(grid, paper.BOXED, strict=True):
        for axes, measured in zip(row, (in_range, out_of_range), strict=True):
            speeds = measured["speeds"]
            text = f"{step * 1e3:g} ms, {len(speeds)} winds in {min(speeds):.0f} to {max(speeds):.0f} m/s"
            rival = [o for o in measured["outcomes"] if (o.label, o.step) == ("rk3", paper.BESIDE[step])]
            shown = [o for o in measured["outcomes"] if o.step == step]
            _boxes(axes, shown + (rival if measured is in_range else []), look, error, kind)
            axes.set_title(text)
        row[0].set_ylabel(ERRORS[error])
    for axes in grid[-1]:
        axes.set_xlabel(LABELS[kind])
    handles = [Patch(facecolor=c + "55", edgecolor=c, label=name(label)) for label, (c, _) in look.items()]
    figure.legend(handles=handles, loc="outside upper center", ncols=4)
    return figure


def _boxes(
    axes: Axes, outcomes: Sequence[Outcome], look: dict[str, tuple[str, str]], error: str, kind: str
) -> None:
    """A box per integrator where its cost is, those of one cost side by side; whiskers to the least and the largest."""
    from fatigue_runner.report.style import INK, plain_logarithm

    def at_cost(o: Outcome) -> float:
        return o.delta_t[kind] * SCALES[kind]

    axes.set(xscale="log", yscale="log")
    places: list[float] = []
    for o in outcomes:
        values = o.values(error)
        if not values.size:
            continue
        beside = sum(abs(place / at_cost(o) - 1) < SAME for place in places)
        places.append(at_cost(o))
        at = at_cost(o) * (1 + SHIFT * beside)
        drawn = axes.boxplot(
            [values], positions=[at], widths=[0.06 * at], patch_artist=True, whis=(0, 100), manage_ticks=False,
            medianprops={"color": INK, "linewidth": 1.2},
            whiskerprops={"color": look[o.label][0]}, capprops={"color": look[o.label][0]},
        )  # fmt: skip
        colour = look[o.label][0]
        for patch in drawn["boxes"]:
            patch.set_facecolor(colour + "55")
            patch.set_edgecolor(colour)
    axes.grid(True, axis="y")
    axes.margins(x=0.08)
    axes.autoscale_view()
    plain_logarithm(axes.xaxis)


def draw(in_range: dict[str, Any], out_of_range: dict[str, Any], folder: Path) -> list[Path]:
    """Write paper-work-precision.png, paper-boxes.png, paper-boxes-compiled.png and paper-boxes-delta-e.png; the paths."""
    from fatigue_runner.report.style import styled

    folder.mkdir(parents=True, exist_ok=True)
    written = []
    with styled():
        for file, figure in (
            ("paper-work-precision", work_precision(in_range)),
            ("paper-boxes", boxes(in_range, out_of_range)),
            ("paper-boxes-compiled", boxes(in_range, out_of_range, kind="lane")),
            ("paper-boxes-delta-e", boxes(in_range, out_of_range, "delta_e")),
        ):
            written.append(folder / f"{file}.png")
            figure.savefig(written[-1], dpi=160, metadata={"Software": None})
    return written
