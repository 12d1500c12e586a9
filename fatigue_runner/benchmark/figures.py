"""The benchmark's figures, in the report's style."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from fatigue_runner.benchmark import answers
from fatigue_runner.benchmark.work_precision import Point
from fatigue_runner.report.style import COLOURS, FAINT, INK, LINES, MARKERS, QUIET, new_figure, styled

# The methods of the paper's box plots; its network takes its place beside them when it is among the points.
PAPER_METHODS = ("heun", "rk3", "heun-richardson")
PAPER_STEPS = (0.01, 0.005)
DECADES = (1e-8, 2.0)


def _look(number: int) -> dict[str, Any]:
    style = LINES[(number // len(COLOURS)) % len(LINES)]
    return {
        "color": COLOURS[number % len(COLOURS)],
        "marker": MARKERS[(number + number // len(COLOURS)) % len(MARKERS)],
        "linestyle": style,
        "markersize": 3.5,
    }


def methods_of(points: Sequence[Point]) -> list[str]:
    return list(dict.fromkeys(p.method.split(" rtol")[0] for p in points))


def error_over_cost(results: Sequence[dict[str, Any]], cost: answers.Cost, label: str) -> Any:
    """NRMSE and DEL error over a cost for every set of cases; the Pareto front as a grey band beneath."""
    with styled():
        figure = new_figure(2.9 * len(results) + 0.6)
        axes = figure.subplots(len(results), 2, squeeze=False)
        for row, result in zip(axes, results, strict=True):
            points = result["points"] + (result["adaptive"] if cost is answers.evaluations else [])
            names = methods_of(points)
            for axis, error, title in zip(
                row,
                (answers.nrmse, answers.del_error),
                ("NRMSE of the worst state", "largest DEL error"),
                strict=True,
            ):
                _draw_front(axis, points, cost, error)
                for number, name in enumerate(names):
                    _draw_method(
                        axis,
                        [p for p in points if p.method.split(" rtol")[0] == name],
                        cost,
                        error,
                        name,
                        number,
                    )
                axis.set_xscale("log")
                axis.set_yscale("log")
                axis.set_ylim(*DECADES)
                axis.set_title(f"{result['cases']}: {title}")
                axis.set_xlabel(label)
                axis.grid(True, which="major")
        handles, labels = axes[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=7, handlelength=2.4)
    return figure


def _draw_front(axis: Any, points: Sequence[Point], cost: answers.Cost, error: answers.Error) -> None:
    front = answers.front(points, cost, error)
    axis.plot(
        [cost(p) for p in front],
        [error(p) for p in front],
        color=FAINT,
        linewidth=6,
        solid_capstyle="round",
        zorder=0,
    )


def _draw_method(
    axis: Any, points: Sequence[Point], cost: answers.Cost, error: answers.Error, name: str, number: int
) -> None:
    shown = sorted(
        (c, e) for p in points if (c := cost(p)) is not None and (e := error(p)) is not None and e > 0
    )
    axis.plot([c for c, _ in shown], [e for _, e in shown], label=name, linewidth=0.9, **_look(number))


def stability(results: Sequence[dict[str, Any]]) -> Any:
    """Largest stable step of every method, and the evaluations per second that it needs at least."""
    with styled():
        figure = new_figure(2.6)
        left, right = figure.subplots(1, 2, sharey=True)
        rows = [r for r in results[0]["stability_limits"] if r["limit"]]
        places = range(len(rows))
        left.barh(places, [r["limit"] * 1e3 for r in rows], color=COLOURS[0], height=0.6)
        right.barh(places, [r["evaluations_per_second"] for r in rows], color=COLOURS[1], height=0.6)
        left.set_yticks(list(places), [r["method"] for r in rows])
        left.invert_yaxis()
        left.set_xlabel("largest stable step [ms]")
        right.set_xlabel("evaluations per simulated second there")
        for axis, key, scale in ((left, "limit", 1e3), (right, "evaluations_per_second", 1.0)):
            for place, r in zip(places, rows, strict=True):
                axis.text(r[key] * scale, place, f" {r[key] * scale:.3g}", va="center", fontsize=7, color=INK)
            axis.margins(x=0.12)
    return figure


def paper_boxes(result: dict[str, Any], error: Callable[[Point], list[float]], name: str) -> Any:
    """The paper's box plots: log10 of an error of every case over the methods, the time of each beneath its name."""
    with styled():
        figure = new_figure(2.8)
        axes = figure.subplots(1, len(PAPER_STEPS), sharey=True)
        for axis, step in zip(axes, PAPER_STEPS, strict=True):
            chosen = [
                p for p in result["points"] if p.method in PAPER_METHODS and p.step == step and error(p)
            ]
            chosen.sort(key=lambda p: p.wall.get("median", math.inf))
            values = [[math.log10(max(v, 1e-30)) for v in error(p)] for p in chosen]
            labels = [f"{p.method}\n{p.wall.get('median', math.nan) * 1e6:.0f} µs/s" for p in chosen]
            if values:
                axis.boxplot(
                    values,
                    tick_labels=labels,
                    widths=0.5,
                    medianprops={"color": COLOURS[1]},
                    flierprops={"markersize": 3, "markeredgecolor": QUIET},
                )
            axis.set_title(f"step {step * 1e3:g} ms")
            axis.grid(True, axis="y")
        axes[0].set_ylabel(f"log10 {name}")
    return figure


def write(results: Sequence[dict[str, Any]], folder: Any) -> list[str]:
    """All figures as SVG and PNG in `folder`; returns their names."""
    from pathlib import Path

    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    made = {
        "work-precision-evaluations": error_over_cost(
            results, answers.evaluations, "evaluations of f per simulated second"
        ),
        "work-precision-time": error_over_cost(results, _microseconds, "µs per simulated second and case"),
        "stability-limits": stability(results),
        "paper-delta-e-range": paper_boxes(results[-1], lambda p: p.delta_e_range, "delta_e_range"),
        "paper-delta-e": paper_boxes(results[-1], lambda p: p.delta_e, "delta_e"),
    }
    with styled():
        for name, figure in made.items():
            figure.savefig(target / f"{name}.png", dpi=130)
    return [f"{name}.png" for name in made]


def _microseconds(point: Point) -> float | None:
    median = point.wall.get("median")
    return None if median is None else median * 1e6
