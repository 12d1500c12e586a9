"""The figures of arXiv:2504.05493 from this project's measurements: median error over cost, and box plots of the error over its
cost in range and out of range."""

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
    """Median delta_e_range over evaluations of f, the paper's cost where f is slow, and over the compiled kernels' time."""
    from fatigue_runner.report.style import new_figure

    figure = new_figure(3.7)
    left, right = figure.subplots(1, 2, sharey=True)
    for label, (colour, marker) in looks(measured["outcomes"]).items():
        chosen = sorted((o for o in measured["outcomes"] if o.label == label), key=lambda o: -o.step)
        y = [float(np.median(o.values("delta_e_range"))) for o in chosen]
        learned = bool(chosen[0].mode)
        for axes, scale, cost in ((left, 1.0, "evaluations"), (right, 1e6, "wall")):
            x = [getattr(o, cost) * scale for o in chosen]
            axes.plot(x, y, color=colour, marker=marker, linestyle=":" if learned else "-",
                      markersize=6 if learned else 4.5, markerfacecolor=colour if learned else "white", label=name(label))  # fmt: skip
    for axes, title, x_label in (
        (left, "Where f costs milliseconds, as in the paper", "evaluations of f per simulated second"),
        (right, "Compiled, measured", "processor time per simulated second [µs]"),
    ):
        axes.set(xscale="log", yscale="log", title=title, xlabel=x_label)
        axes.grid(True)
    left.set_ylabel(f"median {ERRORS['delta_e_range']}")
    handles, labels = left.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=4)
    return figure


def boxes(in_range: dict[str, Any], out_of_range: dict[str, Any], error: str = "delta_e_range") -> Figure:
    """Box plots of delta_e_range, or of the paper's delta_e, over the measured time (delta_t): in and out of range, at 10 and 5 ms."""
    from matplotlib.patches import Patch

    from fatigue_runner.report.style import new_figure

    figure = new_figure(6.0)
    grid = figure.subplots(len(paper.BOXED), 2, sharey=True, sharex=True)
    look = looks(in_range["outcomes"])
    for row, step in zip(grid, paper.BOXED, strict=True):
        for axes, measured in zip(row, (in_range, out_of_range), strict=True):
            speeds = measured["speeds"]
            text = f"{step * 1e3:g} ms, {len(speeds)} winds in {min(speeds):.0f} to {max(speeds):.0f} m/s"
            _boxes(axes, [o for o in measured["outcomes"] if o.step == step], look, error)
            axes.set_title(text)
        row[0].set_ylabel(ERRORS[error])
    for axes in grid[-1]:
        axes.set_xlabel("δt: processor time per simulated second [µs]")
    handles = [Patch(facecolor=c + "55", edgecolor=c, label=name(label)) for label, (c, _) in look.items()]
    figure.legend(handles=handles, loc="outside upper center", ncols=4)
    return figure


def _boxes(axes: Axes, outcomes: Sequence[Outcome], look: dict[str, tuple[str, str]], error: str) -> None:
    """A box per integrator where its cost is; whiskers to the least and the largest."""
    from fatigue_runner.report.style import INK, plain_logarithm

    axes.set(xscale="log", yscale="log")
    for o in outcomes:
        values = o.values(error)
        if not values.size:
            continue
        at = o.wall * 1e6
        drawn = axes.boxplot(
            [values], positions=[at], widths=[0.11 * at], patch_artist=True, whis=(0, 100), manage_ticks=False,
            medianprops={"color": INK, "linewidth": 1.2},
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
    """Write paper-work-precision.png, paper-boxes.png and paper-boxes-delta-e.png; the paths."""
    from fatigue_runner.report.style import styled

    folder.mkdir(parents=True, exist_ok=True)
    written = []
    with styled():
        for file, figure in (
            ("paper-work-precision", work_precision(in_range)),
            ("paper-boxes", boxes(in_range, out_of_range)),
            ("paper-boxes-delta-e", boxes(in_range, out_of_range, "delta_e")),
        ):
            written.append(folder / f"{file}.png")
            figure.savefig(written[-1], dpi=160, metadata={"Software": None})
    return written
