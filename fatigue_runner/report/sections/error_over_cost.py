"""DEL error over cost, in evaluations of the equations of motion and in time, with the Pareto front."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from fatigue_runner.naming import step_label
from fatigue_runner.report.blocks import Figure, Paragraph, Section
from fatigue_runner.report.labels import Label, draw_labels
from fatigue_runner.report.rundata import Run
from fatigue_runner.report.style import (
    FAINT,
    QUIET,
    Look,
    family,
    looks,
    new_figure,
    percent,
    plain_logarithm,
    styled,
    to_svg,
)
from fatigue_runner.results.ranking import LEVELS, MethodSummary, pareto

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ORDER = 50
Cost = Callable[[MethodSummary], float | None]


def build(run: Run) -> Section:
    """Worst DEL error over cost on logarithmic axes; a sentence where nothing was compared."""
    title = "DEL error over cost"
    drawn = [
        s
        for s in run.integrators
        if s.complete and s.worst_del_error is not None and s.worst_del_error.size > 0
    ]
    if not drawn:
        return Section(
            title, [Paragraph("Not drawn: no integrator finished all its cases beside a reference.")]
        )
    lost = [s.label for s in run.integrators if not s.complete]
    caption = (
        "Each point is one integrator: its worst DEL error over all channels, Wöhler exponents and winds, "
        "over its cost per simulated second, counted (left) and measured (right); the thin stem ends at its "
        "median DEL error. Filled, on the grey line: the Pareto front of each panel. "
        + (f"Not drawn, since cases diverged or failed: {', '.join(lost)}." if lost else "")
    )
    return Section(title, [Figure(_draw(run, drawn), caption.strip(), "Worst DEL error over cost, log-log")])


def _draw(run: Run, drawn: list[MethodSummary]) -> str:
    with styled():
        figure = new_figure(3.9)
        left, right = figure.subplots(1, 2, sharey=True)
        look = looks(run.summaries)
        counted = _draw_panel(left, drawn, look, lambda s: s.evaluations_per_second)
        timed = _draw_panel(right, drawn, look, _microseconds)
        left.set_xlabel("evaluations per simulated second")
        right.set_xlabel("measured time per simulated second [µs]")
        left.set_ylabel("worst DEL error")
        left.yaxis.set_major_formatter(percent)
        draw_labels(left, counted)
        draw_labels(right, timed)
        return to_svg(figure)


def _microseconds(summary: MethodSummary) -> float | None:
    return None if summary.wall_time_per_second is None else summary.wall_time_per_second * 1e6


def _draw_panel(
    axes: Axes, drawn: list[MethodSummary], look: dict[MethodSummary, Look], cost: Cost
) -> list[Label]:
    """Draw one panel; returns its labels, which need the finished layout."""
    points = {s: (x, s.worst_del_error.size) for s in drawn if (x := cost(s)) and s.worst_del_error}
    if not points:
        axes.set_visible(False)
        return []
    front = pareto(points)
    axes.loglog(*zip(*points.values(), strict=True), linestyle="none")  # sets the limits
    axes.margins(x=0.1, y=0.1)
    low, high = axes.get_xlim()
    axes.set_xlim(low, high * (high / low) ** (0.012 * max(len(s.label) for s in points)))  # room for labels
    axes.grid(which="major")
    plain_logarithm(axes.xaxis)
    for level in LEVELS:
        axes.axhline(level, color=QUIET, linewidth=0.7, linestyle=(0, (4, 3)), zorder=0.5)
    _draw_front(axes, sorted(points[s] for s in front))
    labels: list[Label] = []
    families: dict[tuple[str, str, str], list[MethodSummary]] = {}
    for summary in sorted(points, key=lambda s: points[s][0]):
        families.setdefault(family(summary), []).append(summary)
    for members in families.values():
        axes.plot(
            *zip(*(points[s] for s in members), strict=True), color=look[members[0]].colour, linewidth=1.0
        )
        for summary in members:
            _draw_point(axes, summary, points[summary], look[summary], summary in front)
            labels.append(_label(summary, points[summary], look[summary], named=summary is members[-1]))
    return labels


def _draw_front(axes: Axes, front: list[tuple[float, float]]) -> None:
    if front:
        axes.plot(
            *zip(*front, strict=True), color=FAINT, linewidth=4, alpha=0.7, zorder=0.8, drawstyle="steps-post"
        )


def _draw_point(axes: Axes, s: MethodSummary, point: tuple[float, float], look: Look, on_front: bool) -> None:
    x, y = point
    if s.median_del_error:
        axes.plot([x, x], [s.median_del_error, y], color=look.colour, linewidth=0.6, alpha=0.6)
    axes.plot(x, y, markersize=5, **look.dots(filled=on_front))


def _label(s: MethodSummary, point: tuple[float, float], look: Look, named: bool) -> Label:
    """The step beside its point; the last point of a line, which is the only one of a corrector, carries the whole name."""
    step = "" if s.step is None else step_label(s.step)
    return Label(point, s.label if named else step, look.colour, bold=named)
