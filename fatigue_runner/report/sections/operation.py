"""How the turbine operated: speed, pitch, power and thrust over wind beside steady operation, and a minute of three winds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import fmean
from typing import TYPE_CHECKING

import numpy as np

from fatigue_runner.channels import BY_NAME
from fatigue_runner.report.blocks import Block, Column, Figure, Section, Table, TableRow
from fatigue_runner.report.rundata import Run, WindCase
from fatigue_runner.report.sections.histories import WINDOW, window_words
from fatigue_runner.report.selection import by_speed, shown_winds, together
from fatigue_runner.report.style import COLOURS, INK, QUIET, new_figure, styled, to_svg
from fatigue_runner.results.cells import Row, number, numbers, text
from fatigue_runner.results.ranking import MethodSummary

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fatigue_runner.logbook import Log

ORDER = 27
CURVES = ("rotor_speed", "blade_pitch", "generator_power", "rotor_thrust")
HISTORIES = ("wind_speed", "generator_speed", "blade_pitch", "generator_power")
SHORT = {
    "wind_speed": "wind",
    "generator_speed": "generator",
    "blade_pitch": "pitch",
    "generator_power": "power",
}
DIGITS = {"rotor_speed": 2, "blade_pitch": 2, "generator_power": 0, "rotor_thrust": 1}
MOST = 24  # mean speeds in the table; a random sweep has hundreds
MOST_DOTS = 300  # winds that are drawn one by one
WHAT = "Mean of each wind (dots), its standard deviation in time (bars) and its extremes (ticks), over the mean of the wind at hub height"
WHAT_OF_MANY = (
    "Mean over the winds of each mean wind speed (dots), root mean square of their standard deviations in time (bars) and the extremes of "
    "all (ticks), over the mean of the wind at hub height"
)


def build(run: Run) -> Section | None:
    """None where nobody steers the turbine, or its speed is unknown."""
    if run.setting("operation", "fixed") == "fixed":
        return None
    rows = _rows(run)
    if not any(number(row, "mean_rotor_speed") is not None for row in rows):
        return None
    steady, what = run.operating_curve, WHAT if len(rows) <= MOST_DOTS else WHAT_OF_MANY
    line = " The line is the operation in steady, uniform wind." if steady else ""
    blocks: list[Block] = [
        Figure(
            _draw_curves(rows, steady),
            f"{what}, by {_told(run).label}.{together(rows)}{line} In turbulence power falls short of the line near rated wind, and "
            "thrust with it: a gust "
            "gives no more than rated, a lull takes.",
            "Rotor speed, pitch, power and thrust over wind speed",
        ),
        _table(rows),
    ]
    winds = [wind for wind in shown_winds(run) if _case(run, wind)]
    if winds:
        caption = (
            f"Wind (mean over the rotor), generator speed, pitch and electrical power at {len(winds)} winds of the campaign, by "
            f"{_told(run).label}{window_words(run)}."
        )
        blocks.append(
            Figure(
                _draw_histories(run, winds), caption, "Histories of wind, generator speed, pitch and power"
            )
        )
    return Section("How the turbine operated", blocks)


def _told(run: Run) -> MethodSummary:
    """The reference, or the integrator with most finished cases where there is none."""
    return max(run.summaries, key=lambda s: (s.is_reference, s.done))


def _rows(run: Run) -> list[Row]:
    return [row for row in run.rows_of(_told(run)) if text(row, "status") == "done"]


def _case(run: Run, wind: WindCase) -> Log | None:
    """The log of a wind, where it holds what is drawn."""
    row = wind.row_of(_told(run))
    log = None if row is None else run.log(text(row, "case_id"))
    if log is None or len(log.time) < 2 or not {"blade_pitch", "generator_power"} <= log.loads.keys():
        return None
    return log if len(log.state) and len(log.wind) else None


def _draw_curves(rows: list[Row], steady: Mapping[str, Sequence[float]]) -> str:
    with styled():
        figure = new_figure(4.4)
        panels = figure.subplots(2, 2, sharex=True)
        for axes, name in zip(panels.ravel(), CURVES, strict=True):
            channel = BY_NAME[name]
            axes.set_title(f"{channel.label} [{channel.read_unit}]", fontweight="normal")
            if steady:
                line = np.array(steady[name]) * channel.scale
                axes.plot(steady["wind_speed"], line, color=INK, linewidth=1.0, zorder=1)
            _draw_scatter(axes, rows, name, channel.scale)
            axes.grid(axis="y")
        for axes in panels[1]:
            axes.set_xlabel("hub-height wind speed [m/s]")
        return to_svg(figure)


def _draw_scatter(axes: Axes, rows: list[Row], name: str, scale: float) -> None:
    winds, means, spreads, lows, highs = [], [], [], [], []
    for wind, group in _marks(rows):
        found = [numbers(group, f"{figure}_{name}") for figure in ("mean", "std", "min", "max")]
        if all(found):
            winds.append(wind)
            means.append(scale * fmean(found[0]))
            spreads.append(scale * fmean(value**2 for value in found[1]) ** 0.5)
            lows.append(scale * min(found[2]))
            highs.append(scale * max(found[3]))
    if not winds:
        return
    low, high = ([m + sign * s for m, s in zip(means, spreads, strict=True)] for sign in (-1, 1))
    axes.vlines(winds, low, high, color=COLOURS[0], linewidth=1.6, alpha=0.6, zorder=2)
    for extremes in (lows, highs):
        axes.plot(winds, extremes, color=QUIET, linestyle="none", marker="_", markersize=5, zorder=2)
    axes.plot(
        winds, means, color=COLOURS[0], linestyle="none", marker="o", markersize=3.5,
        markerfacecolor="white", zorder=3,
    )  # fmt: skip


def _marks(rows: list[Row]) -> list[tuple[float, list[Row]]]:
    """(wind, its row) of every wind, or the rows of each mean wind speed where they are too many."""
    if len(rows) > MOST_DOTS:
        return by_speed(rows)
    return [(speed, [row]) for row in rows if (speed := number(row, "wind_speed")) is not None]


def _table(rows: list[Row]) -> Table:
    columns = [Column("Mean wind", "m/s"), Column("Winds")]
    for name in CURVES:
        label = BY_NAME[name].label.partition(" (")[0]
        columns += [
            Column(label[:1].upper() + label[1:], f"{BY_NAME[name].read_unit}, mean"),
            Column("±", "in time"),
        ]
    groups = by_speed(rows, len(rows))
    table = []
    for speed, alike in groups[:: max(1, len(groups) // MOST)]:
        cells = [f"{speed:.4g}", f"{len(alike)}"]
        for name in CURVES:
            cells += [
                _mean(alike, f"{figure}_{name}", BY_NAME[name].scale, DIGITS[name])
                for figure in ("mean", "std")
            ]
        table.append(TableRow(cells))
    return Table(
        columns,
        table,
        "Means over the winds of each mean wind speed, and of their standard deviations in time.",
    )


def _mean(rows: list[Row], column: str, scale: float, digits: int) -> str:
    values = [value for row in rows if (value := number(row, column)) is not None]
    return f"{fmean(values) * scale:,.{digits}f}" if values else "–"


def _draw_histories(run: Run, winds: list[WindCase]) -> str:
    with styled():
        figure = new_figure(4.6)
        panels = figure.subplots(len(HISTORIES), len(winds), sharex=True, sharey="row", squeeze=False)
        for column, wind in enumerate(winds):
            log = _case(run, wind)
            assert log is not None
            start = min(float(run.setting("discard", 0.0)), float(log.time[-1]))
            inside = (log.time >= start) & (log.time <= start + WINDOW)
            seed = text(wind.rows[0], "seed")
            panels[0][column].set_title(f"{wind.speed:.3g} m/s" + (f", seed {seed}" if seed else ""))
            panels[-1][column].set_xlabel("time [s]")
            for line, name in enumerate(HISTORIES):
                axes, channel = panels[line][column], BY_NAME[name]
                axes.plot(log.time[inside], log[name][inside] * channel.scale, color=INK, linewidth=0.8)
                axes.grid(axis="y")
                if column == 0:
                    axes.set_ylabel(f"{SHORT[name]}\n[{channel.read_unit}]")
        return to_svg(figure)
