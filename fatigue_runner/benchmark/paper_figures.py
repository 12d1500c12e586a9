"""The figures of arXiv:2504.05493 from this project's measurements: median error over cost, and four box plots.

`python -m fatigue_runner.benchmark.paper_figures` draws them from the shipped correctors and the paper's campaigns.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fatigue_runner.benchmark import paper
from fatigue_runner.benchmark.paper import Outcome

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAMES = {
    "heun": "Heun", "rk3": "RK3", "heun-richardson": "Heun + Richardson",
    "heun + network, enhanced": "Heun + network", "heun + network, hybrid": "Heun + network, hybrid",
}  # fmt: skip
ORDER = tuple(NAMES)
SHORT = ("Heun", "RK3", "Heun +\nRichardson", "Heun +\nnetwork", "network,\nhybrid")
ERROR = r"$\delta_{e,\mathrm{range}}$"


def _look(label: str) -> tuple[str, str]:
    from fatigue_runner.report.style import COLOURS, MARKERS

    i = ORDER.index(label)
    return COLOURS[i], MARKERS[i]


def work_precision(measured: dict[str, Any]) -> Figure:
    """Median delta_e_range over evaluations of f, the paper's cost where f is slow, and over the compiled kernels' time."""
    from fatigue_runner.report.style import new_figure

    figure = new_figure(3.6)
    left, right = figure.subplots(1, 2, sharey=True)
    for label in ORDER:
        chosen = [o for o in measured["outcomes"] if o.label == label]
        colour, marker = _look(label)
        y = [float(np.median(o.values("delta_e_range"))) for o in chosen]
        line = "none" if chosen and chosen[0].mode else "-"
        for axes, scale, name in ((left, 1.0, "evaluations"), (right, 1e6, "wall")):
            x = [getattr(o, name) * scale for o in chosen]
            axes.plot(x, y, color=colour, marker=marker, linestyle=line, markerfacecolor="white" if line == "-" else colour,
                      label=NAMES[label])  # fmt: skip
    for axes, title, x_label in (
        (left, "Where f costs milliseconds, as in the paper", "evaluations of f per simulated second"),
        (right, "Compiled, measured", "processor time per simulated second [µs]"),
    ):
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_title(title)
        axes.set_xlabel(x_label)
        axes.grid(True)
    left.set_ylabel(f"median {ERROR}")
    handles, labels = left.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
    return figure


def boxes(in_range: dict[str, Any], out_of_range: dict[str, Any]) -> Figure:
    """Four box plots of delta_e_range: in range and out of range, at 10 and at 5 ms."""
    from fatigue_runner.report.style import new_figure

    figure = new_figure(5.6)
    grid = figure.subplots(2, 2, sharey=True)
    for row, step in zip(grid, paper.BOXED, strict=True):
        for axes, measured in zip(row, (in_range, out_of_range), strict=True):
            speeds = measured["speeds"]
            text = f"{step * 1e3:g} ms, {len(speeds)} winds in {min(speeds):.0f} to {max(speeds):.0f} m/s"
            _box(axes, [o for o in measured["outcomes"] if o.step == step], text)
        row[0].set_ylabel(ERROR)
    return figure


def _box(axes: Axes, outcomes: Sequence[Outcome], title: str) -> None:
    from fatigue_runner.report.style import INK

    by_label = {o.label: o for o in outcomes}
    shown = [label for label in ORDER if label in by_label]
    drawn = axes.boxplot(
        [by_label[label].values("delta_e_range") for label in shown],
        widths=0.5, patch_artist=True, whis=(0, 100),
        medianprops={"color": INK, "linewidth": 1.2},
    )  # fmt: skip
    for patch, label in zip(drawn["boxes"], shown, strict=True):
        patch.set_facecolor(_look(label)[0] + "55")
        patch.set_edgecolor(_look(label)[0])
    axes.set_yscale("log")
    axes.set_xticks(range(1, len(shown) + 1), [SHORT[ORDER.index(label)] for label in shown])
    axes.set_title(title)
    axes.grid(True, axis="y")


def draw(in_range: dict[str, Any], out_of_range: dict[str, Any], folder: Path) -> list[Path]:
    """Write paper-work-precision.png and paper-boxes.png; the paths."""
    from fatigue_runner.report.style import styled

    folder.mkdir(parents=True, exist_ok=True)
    written = []
    with styled():
        for name, figure in (
            ("paper-work-precision", work_precision(in_range)),
            ("paper-boxes", boxes(in_range, out_of_range)),
        ):
            written.append(folder / f"{name}.png")
            figure.savefig(written[-1], dpi=160, metadata={"Software": None})
    return written


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure and draw."""
    from fatigue_runner.corrector.artefact import load
    from fatigue_runner.errors import InputError

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--correctors",
        nargs="*",
        type=Path,
        default=sorted(Path("correctors").glob("paper-heun-*.safetensors")),
    )
    parser.add_argument("--campaigns", type=Path, default=Path("campaigns"))
    parser.add_argument("--images", type=Path, default=Path("docs/images"))
    parser.add_argument("--json", type=Path)
    given = parser.parse_args(arguments)
    try:
        correctors = [load(path) for path in given.correctors]
        measured = [
            paper.measure(given.campaigns / f"paper_{which}.yaml", correctors, steps, print)
            for which, steps in (("in_range", paper.STEPS), ("out_of_range", paper.BOXED))
        ]
    except InputError as error:
        parser.exit(2, f"{error}\n")
    for path in draw(measured[0], measured[1], given.images):
        print(path)
    if given.json:
        given.json.write_text(json.dumps([paper.to_json(m) for m in measured], indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
