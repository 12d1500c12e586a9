"""The work-precision benchmark's figures, in the report's style: error over cost, stability limits."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from fatigue_runner.benchmark.study import answers
from fatigue_runner.benchmark.study.integrators import ADAPTIVE
from fatigue_runner.benchmark.study.points import Point
from fatigue_runner.integrators import ENHANCED, HYBRID
from fatigue_runner.report.style import COLOURS, FAINT, INK, LINES, QUIET, new_figure, styled

# What is shown: errors above are of no use, errors below are closer than anybody asks.
NRMSE_RANGE, DEL_RANGE = (5e-7, 0.3), (1e-6, 0.3)
CORRECTED_MARKS = {ENHANCED: "*", HYBRID: "X"}
# One colour and one marker per method, so that a corrector's mark tells its method: Okabe & Ito (2008) and, where those end, Tol's
# "muted" scheme (SRON/EPS/TN/09-002).
METHOD_COLOURS = (
    "#999999", "#D55E00", "#E69F00", "#CC79A7", "#882255", "#0072B2", "#56B4E9", "#009E73", "#332288", "#999933", "#AA4499", "#1a1a1a",
    "#117733", "#CC6677", "#44AA99",
)  # fmt: skip
METHOD_MARKERS: tuple[Any, ...] = (*"os^DvPhp<>d8H", (4, 1, 0), (6, 1, 0))


def looks(points: Iterable[Point]) -> dict[str, dict[str, Any]]:
    """Colour and marker of every method; its corrected and adaptive forms have its colour."""
    names = list(dict.fromkeys(_method(p) for p in points))
    return {
        name: {
            "color": METHOD_COLOURS[i % len(METHOD_COLOURS)],
            "marker": METHOD_MARKERS[i % len(METHOD_MARKERS)],
        }
        for i, name in enumerate(names)
    }


def _method(point: Point) -> str:
    return point.method.removesuffix("-adaptive")


def error_over_cost(results: Sequence[dict[str, Any]], cost: answers.Cost, label: str) -> Any:
    """NRMSE and DEL error over a cost for every set of cases; the Pareto front as a grey band beneath."""
    by_evaluations = cost is answers.evaluations
    shown = [[*r["points"], *(r["adaptive"] if by_evaluations else ())] for r in results]
    with styled():
        figure = new_figure(2.75 * len(results) + 0.9)
        axes = figure.subplots(len(results), 2, squeeze=False)
        look = looks(p for points in shown for p in points)
        for row, result, points in zip(axes, results, shown, strict=True):
            for axis, error, title, limits in zip(
                row,
                (answers.nrmse, answers.del_error),
                ("NRMSE of the worst state", "largest DEL error"),
                (NRMSE_RANGE, DEL_RANGE),
                strict=True,
            ):
                _draw(axis, points, cost, error, look)
                axis.set(xscale="log", yscale="log", ylim=limits)
                _fit(axis, points, cost, error, limits)
                axis.set_title(f"{result['cases']} ({result['turbine']}): {title}")
                axis.grid(True, which="major")
        for axis in axes[-1]:
            axis.set_xlabel(label)
        _legend(figure, look, {p.kind for points in shown for p in points})
    return figure


def _draw(
    axis: Any, points: Sequence[Point], cost: answers.Cost, error: answers.Error, look: dict[str, Any]
) -> None:
    best = answers.front(points, cost, error)
    axis.plot(
        [cost(p) for p in best],
        [error(p) for p in best],
        color=FAINT,
        linewidth=6,
        solid_capstyle="round",
        zorder=0,
    )
    series: dict[str, list[Point]] = {}
    for p in points:
        if cost(p) is not None and (error(p) or 0.0) > 0.0:
            series.setdefault(p.series, []).append(p)
    for found in series.values():
        found.sort(key=lambda p: -p.step)
        x, y = [cost(p) for p in found], [error(p) for p in found]
        axis.plot(x, y, **_style(found[0], look[_method(found[0])]))


def _style(point: Point, look: dict[str, Any]) -> dict[str, Any]:
    if point.corrected:
        return {
            "color": look["color"],
            "marker": CORRECTED_MARKS[point.kind],
            "markersize": 9 if point.kind == ENHANCED else 5.5,
            "markeredgecolor": INK,
            "markeredgewidth": 0.6,
            "linestyle": (0, (1, 2)),
            "linewidth": 0.9,
            "zorder": 4 if point.kind == ENHANCED else 3,
        }
    if point.kind == ADAPTIVE:
        return {
            "color": look["color"],
            "marker": "|",
            "markersize": 6,
            "linewidth": 0.7,
            "linestyle": LINES[2],
        }
    return {**look, "markersize": 3.5, "markerfacecolor": "white", "linewidth": 0.9}


def _fit(
    axis: Any,
    points: Sequence[Point],
    cost: answers.Cost,
    error: answers.Error,
    limits: tuple[float, float],
) -> None:
    """The costs of what is within the errors shown."""
    from fatigue_runner.report.style import plain_logarithm

    inside = [c for p in points if (c := cost(p)) and limits[0] <= (error(p) or 0.0) <= limits[1]]
    if inside:
        axis.set_xlim(0.8 * min(inside), 1.25 * max(inside))
    plain_logarithm(axis.xaxis)


def _legend(figure: Any, look: dict[str, dict[str, Any]], kinds: set[str]) -> None:
    from matplotlib.lines import Line2D

    def line(label: str, **style: Any) -> Line2D:
        return Line2D([], [], label=label, **style)

    handles = [
        line(name, **style, markersize=3.5, markerfacecolor="white", linewidth=0.9)
        for name, style in look.items()
    ]
    edge = {"color": QUIET, "markeredgecolor": INK, "markeredgewidth": 0.6, "linestyle": (0, (1, 2))}
    if ENHANCED in kinds:
        handles.append(line("with corrector", marker="*", markersize=9, **edge))
    if HYBRID in kinds:
        handles.append(line("hybrid", marker="X", markersize=5.5, **edge))
    if ADAPTIVE in kinds:
        handles.append(
            line("adaptive", marker="|", markersize=6, color=QUIET, linewidth=0.7, linestyle=LINES[2])
        )
    handles.append(line("Pareto front", color=FAINT, linewidth=6, solid_capstyle="round"))
    figure.legend(handles=handles, loc="outside upper center", ncols=6, handlelength=2.4)


def stability(rows: Sequence[dict[str, Any]]) -> Any:
    """Largest stable step of every method, and the evaluations per second that it needs at least; rows: `stability_limits`."""
    with styled():
        figure = new_figure(2.8)
        left, right = figure.subplots(1, 2, sharey=True)
        rows = sorted((r for r in rows if r["limit"]), key=lambda r: r["limit"])
        places = range(len(rows))
        for axis, key, scale, colour in (
            (left, "limit", 1e3, COLOURS[0]),
            (right, "evaluations_per_second", 1.0, COLOURS[1]),
        ):
            values = [r[key] * scale for r in rows]
            axis.barh(places, values, color=colour, height=0.6)
            axis.set_xscale("log")
            axis.set_xlim(min(values) / 2, max(values) * 4)
            _ticks(axis)
            for place, value in zip(places, values, strict=True):
                more = "at least " if key == "limit" and rows[place]["at_least"] else ""
                axis.text(value, place, f" {more}{_plain(value)}", va="center", fontsize=7, color=INK)
        left.set_yticks(list(places), [r["method"] for r in rows])
        left.set_xlabel("largest stable step [ms]")
        right.set_xlabel("evaluations per simulated second there")
    return figure


def _ticks(axis: Any) -> None:
    from fatigue_runner.report.style import plain_logarithm

    plain_logarithm(axis.xaxis)


def _plain(value: float) -> str:
    return f"{value:.0f}" if value >= 100 else f"{value:.3g}"


def write(results: Sequence[dict[str, Any]], folder: Path) -> list[str]:
    """All figures as PNG in `folder`; returns their names without `.png`."""
    folder.mkdir(parents=True, exist_ok=True)
    made: dict[str, Callable[[], Any]] = {
        "work-precision-time": lambda: error_over_cost(
            results, _microseconds, "µs per simulated second and case"
        ),
        "work-precision-evaluations": lambda: error_over_cost(
            results, answers.evaluations, "evaluations of f per simulated second"
        ),
        "work-precision-delta-t": lambda: error_over_cost(
            results, _delta_t, "δt: µs of evaluations per simulated second and case"
        ),
        "stability-limits": lambda: stability(results[0]["stability_limits"]),
    }
    for name, draw in made.items():
        with styled():
            draw().savefig(folder / f"{name}.png", dpi=150, metadata={"Software": None})
    return list(made)


def _microseconds(point: Point) -> float | None:
    return _scaled(answers.wall(point))


def _delta_t(point: Point) -> float | None:
    return _scaled(answers.delta_t(point))


def _scaled(seconds: float | None) -> float | None:
    return None if seconds is None else seconds * 1e6
