"""Damage-equivalent loads over wind speed, one panel per channel, with the integrators' errors below it."""

from __future__ import annotations

import math
from statistics import pstdev
from typing import TYPE_CHECKING

from fatigue_runner.channels import BY_NAME, Channel
from fatigue_runner.report.blocks import Figure, Paragraph, Section
from fatigue_runner.report.rundata import Run
from fatigue_runner.report.selection import by_speed, left_out, shown_integrators, together
from fatigue_runner.report.style import (
    FAINT,
    INK,
    QUIET,
    WIDTH,
    Look,
    draw_legend,
    looks,
    new_figure,
    percent,
    styled,
    to_svg,
)
from fatigue_runner.results.cells import Row, numbers, text
from fatigue_runner.results.life_words import customary_exponent
from fatigue_runner.results.ranking import MethodSummary

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ORDER = 40
CROWDED = 40  # wind speeds; more of them are drawn as points without a line
LEAST_SEEDS = 3  # for a scatter between seeds


def build(run: Run) -> Section:
    """DELs over wind speed with the relative errors below; a sentence where they are unknown."""
    title = "Damage-equivalent loads over wind speed"
    panels = _panels(run)
    if not panels:
        return Section(title, [Paragraph("Not drawn: the results hold no damage-equivalent loads.")])
    shown = shown_integrators(run)
    caption = (
        "Short-term DEL of each channel (above; the exponent customary for its material) and the size of "
        "its relative error against the reference of the same wind (below). Where a wind speed was run more "
        "than once, the line is the power mean and the error the largest. Grey line below, where there are "
        "seeds enough: standard deviation of the reference's DEL between seeds, "
        "relative to its mean." + together(run.rows) + left_out(run, shown)
    )
    return Section(
        title, [Figure(_draw(run, panels, shown), caption, "Damage-equivalent loads over wind speed")]
    )


def _panels(run: Run) -> list[tuple[str, float, str]]:
    by_channel: dict[str, dict[float, str]] = {}
    for channel, exponent, suffix in run.columns:
        if not numbers(run.rows, f"del_{suffix}"):
            continue
        by_channel.setdefault(channel, {})[exponent] = suffix
    chosen = {channel: customary_exponent(channel, found) for channel, found in by_channel.items()}
    return [(channel, chosen[channel], found[chosen[channel]]) for channel, found in by_channel.items()]


def _draw(run: Run, panels: list[tuple[str, float, str]], shown: list[MethodSummary]) -> str:
    with styled():
        columns = min(2, len(panels))
        lines = math.ceil(len(panels) / columns)
        figure = new_figure(3.1 * lines + 0.3, WIDTH if columns == 2 else 0.6 * WIDTH)
        look = looks(run.summaries)
        outer = figure.add_gridspec(lines, columns)
        for i, panel in enumerate(panels):
            inner = outer[i // columns, i % columns].subgridspec(2, 1, height_ratios=(1.5, 1))
            above = figure.add_subplot(inner[0])
            below = figure.add_subplot(inner[1], sharex=above)
            _draw_panel(run, panel, shown, look, above, below)
            below.set_xlabel("hub-height wind speed [m/s]")
        draw_legend(figure, [*([run.reference] if run.reference else []), *shown], look, dots=True)
        return to_svg(figure)


def _draw_panel(
    run: Run,
    panel: tuple[str, float, str],
    shown: list[MethodSummary],
    look: dict[MethodSummary, Look],
    above: Axes,
    below: Axes,
) -> None:
    name, exponent, suffix = panel
    channel = BY_NAME.get(name, Channel(name, "", name, ""))
    above.set_title(f"{channel.label}, m = {exponent:g}", fontweight="normal")
    above.set_ylabel(f"DEL [{channel.read_unit}]")
    below.set_ylabel("error")
    for summary in shown:
        _draw_integrator(_rows(run, summary), suffix, exponent, channel.scale, look[summary], above, below)
    if run.reference is not None:
        _draw_reference(_rows(run, run.reference), suffix, exponent, channel.scale, above, below)
    highest = above.dataLim.ymax  # infinite where nothing is drawn
    above.set_ylim(0, 1.07 * highest if 0 < highest < math.inf else 1)
    above.tick_params(labelbottom=False)
    above.grid(axis="y")
    if below.has_data():
        below.set_yscale("log")
        below.yaxis.set_major_formatter(percent)
    below.axhline(0.01, color=FAINT, linewidth=1.2, zorder=0)
    below.grid(axis="y")


def _draw_reference(
    rows: list[Row], suffix: str, exponent: float, scale: float, above: Axes, below: Axes
) -> None:
    speeds, dels = _power_means(rows, f"del_{suffix}", exponent, scale)
    line = "-" if len(speeds) <= CROWDED else "none"
    # Over the points of the integrators where they crowd, under them where both can be seen.
    order = 1 if len(speeds) <= CROWDED else 3
    above.plot(speeds, dels, color=INK, linewidth=0.9, linestyle=line, marker=".", markersize=2, zorder=order)
    scatter = _seed_scatter(rows, f"del_{suffix}")
    if scatter:
        below.plot(*zip(*scatter, strict=True), color=QUIET, linewidth=1.6, alpha=0.6)
        below.annotate(
            "scatter between seeds",
            scatter[0],
            xytext=(2, -3),
            textcoords="offset points",
            fontsize=6.5,
            color=QUIET,
            va="top",
        )


def _draw_integrator(
    rows: list[Row], suffix: str, exponent: float, scale: float, look: Look, above: Axes, below: Axes
) -> None:
    speeds, dels = _power_means(rows, f"del_{suffix}", exponent, scale)
    crowded = len(speeds) > CROWDED
    size = 2.0 if crowded else 4.0
    above.plot(speeds, dels, markersize=size, markeredgewidth=0.7, **look.dots())
    worst = _worst(rows, f"del_error_{suffix}")
    if worst:
        style = look.dots() if crowded else {**look.dots(), **look.curve()}
        below.plot(
            *zip(*worst, strict=True), linewidth=0.8, markersize=size * 0.75, markeredgewidth=0.7, **style
        )


def _rows(run: Run, summary: MethodSummary) -> list[Row]:
    rows = (wind.row_of(summary) for wind in run.winds)
    return [row for row in rows if row is not None and text(row, "status") == "done"]


def _by_speed(rows: list[Row], column: str) -> list[tuple[float, list[float]]]:
    return [(speed, found) for speed, group in by_speed(rows) if (found := numbers(group, column))]


def _power_means(
    rows: list[Row], column: str, exponent: float, scale: float
) -> tuple[list[float], list[float]]:
    """Wind speeds and their DELs, averaged by damage: ((Σ DELᵐ)/n)^(1/m), never the mean of DELs."""
    groups = _by_speed(rows, column)
    means = [_power_mean(values, exponent) * scale for _, values in groups]
    return [speed for speed, _ in groups], means


def _power_mean(values: list[float], exponent: float) -> float:
    largest = max(values)
    if largest <= 0:
        return 0.0
    return largest * (sum((value / largest) ** exponent for value in values) / len(values)) ** (1 / exponent)


def _worst(rows: list[Row], column: str) -> list[tuple[float, float]]:
    groups = ((speed, max(abs(value) for value in values)) for speed, values in _by_speed(rows, column))
    return [
        (speed, size) for speed, size in groups if size > 0
    ]  # an error of zero has no place on a log axis


def _seed_scatter(rows: list[Row], column: str) -> list[tuple[float, float]]:
    """Relative standard deviation of a DEL between seeds, where nothing but the seed differs at a speed."""
    seeded = [row for row in rows if text(row, "seed")]
    conditions = {
        (text(r, "wind_speed"), text(r, "horizontal_shear"), text(r, "turbulence_intensity")) for r in seeded
    }
    speeds = {condition[0] for condition in conditions}
    if len(conditions) != len(speeds):
        return []
    groups = [(speed, values) for speed, values in _by_speed(seeded, column) if len(values) >= LEAST_SEEDS]
    return [(speed, pstdev(v) / (sum(v) / len(v))) for speed, v in groups if sum(v) > 0 and pstdev(v) > 0]
