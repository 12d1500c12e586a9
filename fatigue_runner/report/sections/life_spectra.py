"""What the loads of the life are made of: exceedance, Markov matrix and power spectral density, from the logs of the told integrator."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fatigue_runner.channels import BY_NAME, Channel
from fatigue_runner.fatigue import FatigueInputError, exceedance, markov_matrix, rainflow, spectrum
from fatigue_runner.fatigue.damage import channel_condition
from fatigue_runner.fatigue.lifetime import SECONDS_PER_YEAR
from fatigue_runner.report.blocks import Block, Column, Figure, Paragraph, Section, Table, TableRow
from fatigue_runner.report.rundata import Run
from fatigue_runner.report.style import COLOURS, INK, LINES, new_figure, styled, to_svg
from fatigue_runner.results import life_words as words
from fatigue_runner.results.cells import Row, integrator, number, text
from fatigue_runner.results.lifetime import Life
from fatigue_runner.results.ranking import integrator_key

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ORDER = 45
CELLS = 32  # of the Markov matrix, each way
MOST_LOGS = 120  # a campaign of thousands would make the report wait; the spread of winds is kept
TITLE = "What the loads are made of"


@dataclass
class _Channel:
    """What one channel did over the life: cycles with their counts, and spectra weighted by time."""

    ranges: list[np.ndarray]
    means: list[np.ndarray]
    counts: list[np.ndarray]
    density: np.ndarray | None = None
    frequency: np.ndarray | None = None
    weight: float = 0.0

    def cycles(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return np.concatenate(self.ranges), np.concatenate(self.means), np.concatenate(self.counts)


def build(run: Run) -> Section | None:
    """Extremes as a table, and three figures a channel; a sentence where there are no logs; None without a life."""
    life = run.life
    key = None if life is None else words.told(life)
    if life is None or key is None:
        return None
    rows = [row for row in run.rows if integrator_key(row) == key and text(row, "status") == "done"]
    channels = list(dict.fromkeys(f.name for f in life.loads))
    blocks: list[Block] = [_extremes(rows, channels)]
    found, used = _read(run, life, rows, channels)
    if not found:
        blocks.append(
            Paragraph(
                "Exceedance, Markov matrix and spectra are not drawn: the run folder has no readable logs."
            )
        )
        return Section(TITLE, blocks)
    few = "" if used == len(rows) else f" From {used} of {len(rows)} logs."
    caption = (
        f"By {integrator(rows[0])}, weighted with the climate.{few} Left: load ranges over how many cycles of {life.section.years:g} "
        "years are as large or larger (half cycles counted as half). Middle: Markov matrix, cycles by mean and range, darker is more, "
        "on a logarithmic scale. Right: power spectral density, mean over the time in operation."
    )
    blocks.append(
        Figure(_draw(found), caption, "Exceedance, Markov matrix and power spectral density of every channel")
    )
    return Section(TITLE, blocks)


def _extremes(rows: list[Row], channels: list[str]) -> Table:
    columns = (
        Column("Channel", number=False),
        Column("Smallest"),
        Column("at", "s"),
        Column("in", number=False),
        Column("Largest"),
        Column("at", "s"),
        Column("in", number=False),
        Column("Unit", number=False),
    )
    lines = []
    for channel in channels:
        known = BY_NAME.get(channel, Channel(channel, "", channel, ""))
        cells = [known.label]
        for end, pick in (("min", min), ("max", max)):
            values = [(value, row) for row in rows if (value := number(row, f"{end}_{channel}")) is not None]
            if not values:
                cells += ["–", "–", "–"]
                continue
            value, row = pick(values, key=lambda item: item[0])
            when = number(row, f"{end}_time_{channel}")
            cells += [
                f"{value * known.scale:.0f}",
                "–" if when is None else f"{when:.1f}",
                text(row, "case_id"),
            ]
        lines.append(TableRow([*cells, known.read_unit]))
    return Table(
        columns,
        lines,
        "Extremes of the counted time, with simulated time and case; not extrapolated to the life.",
    )


def _read(run: Run, life: Life, rows: list[Row], channels: list[str]) -> tuple[dict[str, _Channel], int]:
    """Cycles and spectra of every channel, each case weighted with its share of the life."""
    chosen = (
        rows
        if len(rows) <= MOST_LOGS
        else [rows[round(i * (len(rows) - 1) / (MOST_LOGS - 1))] for i in range(MOST_LOGS)]
    )
    edges = [*(b.low for b in life.bins), life.bins[-1].high]
    places = [
        int(np.searchsorted(edges, number(row, "wind_speed") or 0.0, side="right")) - 1 for row in chosen
    ]
    places = [min(max(place, 0), len(life.bins) - 1) for place in places]
    seconds = life.section.years * life.section.availability * SECONDS_PER_YEAR
    found: dict[str, _Channel] = {}
    used = 0
    for row, place in zip(chosen, places, strict=True):
        log = run.log(text(row, "case_id"))
        if log is None or len(log.time) < 3 or not log.complete:
            continue
        used += 1
        start = float(run.setting("discard", 0.0)) - 1e-9
        inside = log.time >= start
        step = float(log.time[1] - log.time[0])
        share = life.bins[place].probability / places.count(place)
        length = float(log.time[-1] - max(start, float(log.time[0])))
        for channel in channels:
            series = np.asarray(log.loads.get(channel, ()), dtype=np.float64)
            if series.size != inside.size or channel_condition(series[inside]) is not None:
                continue
            one = found.setdefault(channel, _Channel([], [], []))
            try:
                ranges, means, counts = rainflow(series[inside])
                frequency, density = spectrum(series[inside], step)
            except FatigueInputError:
                continue
            one.ranges.append(ranges)
            one.means.append(means)
            one.counts.append(counts * (share * seconds / length))
            if one.density is None:
                one.frequency, one.density = frequency, np.zeros_like(density)
            if density.shape == one.density.shape:
                one.density += share * density
                one.weight += share
        run.forget_log(text(row, "case_id"))
    return found, used


def _draw(found: dict[str, _Channel]) -> str:
    with styled():
        figure = new_figure(2.3 * len(found) + 0.2)
        grid = figure.subplots(len(found), 3, squeeze=False)
        for i, (name, one) in enumerate(found.items()):
            channel = BY_NAME.get(name, Channel(name, "", name, ""))
            ranges, means, counts = one.cycles()
            scale = channel.scale
            _draw_exceedance(grid[i][0], ranges * scale, counts, channel)
            _draw_markov(grid[i][1], ranges * scale, means * scale, counts, channel)
            _draw_spectrum(grid[i][2], one, scale, channel)
            grid[i][0].set_title(channel.label, fontweight="normal")
        return to_svg(figure)


def _draw_exceedance(axes: Axes, ranges: np.ndarray, counts: np.ndarray, channel: Channel) -> None:
    sizes, above = exceedance(ranges, counts)
    keep = np.unique(np.geomspace(1, sizes.size, 400).astype(int)) - 1
    axes.semilogx(above[keep], sizes[keep], color=COLOURS[0], linewidth=1.2)
    axes.set_xlabel("cycles of the life")
    axes.set_ylabel(f"range [{channel.read_unit}]")
    axes.grid(axis="both")


def _draw_markov(
    axes: Axes, ranges: np.ndarray, means: np.ndarray, counts: np.ndarray, channel: Channel
) -> None:
    tall = np.linspace(0.0, float(ranges.max()) or 1.0, CELLS + 1)
    low, high = float(means.min()), float(means.max())
    wide = np.linspace(low, high if high > low else low + 1.0, CELLS + 1)
    cells = markov_matrix(ranges, means, counts, tall, wide)
    shown = np.log10(np.where(cells > 0.0, cells, np.nan))
    axes.pcolormesh(wide, tall, shown, cmap="Greys", rasterized=False, linewidth=0)
    axes.set_xlabel(f"mean [{channel.read_unit}]")
    axes.set_ylabel(f"range [{channel.read_unit}]")


def _draw_spectrum(axes: Axes, one: _Channel, scale: float, channel: Channel) -> None:
    if one.density is None or one.frequency is None or one.weight <= 0.0:
        return
    inside = (one.frequency > 0.0) & (one.frequency <= 5.0)
    axes.loglog(
        one.frequency[inside],
        one.density[inside] / one.weight * scale**2,
        color=INK,
        linewidth=0.9,
        linestyle=LINES[0],
    )
    axes.set_xlabel("frequency [Hz]")
    axes.set_ylabel(f"PSD [({channel.read_unit})²/Hz]")
    top = float(np.nanmax(one.density[inside])) / one.weight * scale**2
    if math.isfinite(top) and top > 0.0:
        axes.set_ylim(top * 1e-7, top * 3.0)
    axes.grid(axis="both")
