"""The life first: how long, which place and wind, which integrator is good enough for it, what to distrust; then its tables and figures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fatigue_runner.channels import BY_NAME
from fatigue_runner.report.blocks import Block, Column, Figure, Paragraph, Section, Table, TableRow, Warnings
from fatigue_runner.report.rundata import Run
from fatigue_runner.report.style import (
    COLOURS,
    INK,
    LINES,
    QUIET,
    draw_legend,
    looks,
    new_figure,
    percent,
    styled,
    to_svg,
)
from fatigue_runner.results import life_words as words
from fatigue_runner.results.cells import format_percent
from fatigue_runner.results.lifetime import Figure as LifeFigure
from fatigue_runner.results.lifetime import Key, Life, label_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ORDER = 5
HATCHES = ("", "///", "...", "xxx", "\\\\\\", "++")  # told apart in black and white


def build(run: Run) -> Section | None:
    """Words, then tables and figures; None where the campaign asks for no life."""
    life = run.life
    if life is None:
        return (
            Section("How long does it last?", [Paragraph(f"Not told: {run.no_life}.")])
            if run.no_life
            else None
        )
    key = words.told(life)
    if key is None:
        return None
    places = words.places_in_words(life)
    lead = [*places, *words.loads_in_words(life), *words.integrator_in_words(life, run.summaries)]
    blocks: list[Block] = [Paragraph(_unbroken(said), strong=i == 0) for i, said in enumerate(lead)]
    blocks.append(Paragraph(_unbroken(" ".join(life.statement()))))
    if doubts := words.distrust(life, _counted(run)):
        blocks.append(Warnings([_unbroken(said) for said in doubts]))
    blocks += [_places(life, key)] if life.places else []
    blocks += [_loads(life, key), _bins(life, key)]
    if life.places:
        blocks.append(
            Figure(
                _draw_circles(life, key), CIRCLE, "Damage around the sections of tower base and blade root"
            )
        )
    blocks.append(Figure(_draw_shares(life, key), SHARES, "Share of the life's damage by wind-speed bin"))
    compared = [s for s in run.integrators if words.worst_error(life, s.key) is not None]
    if compared:
        blocks.append(
            Figure(
                _draw_errors(run, life, key), ERRORS, "Errors of lifetime loads beside what the seeds leave"
            )
        )
    return Section(f"How long does it last? A life of {life.section.years:g} years", blocks)


CIRCLE = (
    "Miner's sum of the life around each section (radius, from the middle outwards), 1 is failure. Tower: 0° downwind, 90° to the left "
    "seen from upwind; blade root: 0° the suction side, 90° the trailing edge. The dashed line is the interval that the seeds leave."
)
SHARES = (
    "What each wind-speed bin adds to the damage of the life: of the sections where they wear most, and of each channel's lifetime load at "
    "the exponent customary for its material; beside it the time that its wind blows."
)
ERRORS = (
    "Relative error of every integrator's lifetime loads against the reference, a mark for each Wöhler exponent, and the half interval "
    "that the seeds leave at the same exponents (grey). A mark a decade below the grey is good enough: other seeds would move the life "
    "ten times as far."
)


def _unbroken(text: str) -> str:
    for unit in ("m/s", "years", "%", "kN·m"):
        text = text.replace(f" {unit}", f"\u00a0{unit}")
    return text.replace(" = ", "\u00a0=\u00a0").replace(" ± ", "\u00a0±\u00a0")


def _counted(run: Run) -> float | None:
    duration = run.setting("duration")
    return None if duration is None else float(duration) - float(run.setting("discard", 0.0))


def _places(life: Life, key: Key) -> Table:
    columns = (
        Column("Place", number=False),
        Column("Worst at", "azimuth"),
        Column("Miner's sum", f"of {life.section.years:g} years"),
        Column("Interval", f"{life.section.confidence:.0%} of the seeds"),
        Column("Life", "years"),
        Column("Governing wind", "m/s"),
        Column("Its share"),
        Column("Lost", "probability"),
    )
    found = [(place, life.hot_spot(key, place)) for place in life.places]
    rows = [TableRow([words.place_label(p), *_place_cells(life, f)]) for p, f in found]
    caption = (
        f"Where each section wears most, by {label_of(key)}. Miner's sum 1 is failure; the whole circumference is in damage.csv. "
        "Curves and factors stand in the definitions."
    )
    return Table(columns, rows, caption)


def _place_cells(life: Life, figure: LifeFigure | None) -> list[str]:
    if figure is None or figure.value is None:
        return ["–"] * 7
    return [
        f"{figure.at:.0f}°",
        _significant(figure.value),
        _interval(figure, 1.0, _significant),
        words.years_text(life.years_of(figure)),
        *_wind(life, figure),
        f"{figure.lost:.4f}",
    ]


def _loads(life: Life, key: Key) -> Table:
    columns = (
        Column("Channel", number=False, pick=True),
        Column("m", pick=True),
        Column("Lifetime DEL", f"{words.cycles_text(life.section.n_eq)} cycles"),
        Column("Interval", f"{life.section.confidence:.0%} of the seeds"),
        Column("Unit", number=False),
        Column("Governing wind", "m/s"),
        Column("Its share"),
        Column("Winds", "counted / lost"),
        Column("Lost", "probability"),
    )
    rows = [_load_row(life, f) for f in life.loads if f.integrator == key]
    caption = (
        f"Lifetime equivalent loads (ranges) by {label_of(key)}: power sum over the winds, none renormalised unless it says so above. "
        "Every integrator's are in lifetime.csv."
    )
    return Table(columns, rows, caption)


def _load_row(life: Life, figure: LifeFigure) -> TableRow:
    known = BY_NAME.get(figure.name)
    label, scale, unit = (known.label, known.scale, known.read_unit) if known else (figure.name, 1.0, "")
    value = "–" if figure.value is None else f"{figure.value * scale:.0f}"
    cells = [
        label,
        f"{figure.at:g}",
        value,
        _interval(figure, scale, lambda v: f"{v:.0f}"),
        unit,
        *_wind(life, figure),
        f"{figure.cases} / {figure.lost_cases}",
        f"{figure.lost:.4f}",
    ]
    return TableRow(cells, "bad" if figure.lost_cases else "")


def _interval(figure: LifeFigure, scale: float, form: object) -> str:
    if figure.low is None or figure.high is None:
        return "–"
    shown = form if callable(form) else str
    return f"{shown(figure.low * scale)} to {shown(figure.high * scale)}"


def _wind(life: Life, figure: LifeFigure) -> list[str]:
    place = figure.governing
    if place is None:
        return ["–", "–"]
    wind = life.bins[place]
    return [f"{wind.low:g} to {wind.high:g}", f"{figure.shares[place]:.0%}".replace("%", "\u00a0%")]


def _significant(value: float) -> str:
    if value == 0.0:
        return "0"
    return (
        f"{value:.2g}"
        if 1e-3 <= value < 1e3
        else f"{value:.1e}".replace("e-0", "e−").replace("e-", "e−").replace("e+0", "e")
    )


def _bins(life: Life, key: Key) -> Table:
    figures = _shown(life, key)
    columns = (
        Column("Wind", "m/s"),
        Column("Winds"),
        Column("Probability"),
        Column("Blows", "hours a year"),
        *(Column(name, "share of damage") for name, _ in figures),
    )
    rows = [
        TableRow(
            [
                f"{wind.low:g} to {wind.high:g}",
                f"{wind.winds}",
                f"{wind.probability:.4f}",
                f"{wind.hours_per_year:.0f}",
                *(format_percent(figure.shares[i]) for _, figure in figures),
            ]
        )
        for i, wind in enumerate(life.bins)
    ]
    total = [f"{life.covered:.4f}", f"{sum(b.hours_per_year for b in life.bins):.0f}", *("" for _ in figures)]
    rows.append(TableRow(["sum", f"{sum(b.winds for b in life.bins)}", *total], "quiet"))
    return Table(
        columns, rows, f"The bins of the climate ({life.climate.name}), and what each adds to the damage."
    )


def _shown(life: Life, key: Key) -> list[tuple[str, LifeFigure]]:
    """The places where they wear most, then each channel at its customary exponent."""
    found = [(words.place_label(place), life.hot_spot(key, place)) for place in life.places]
    for channel in dict.fromkeys(f.name for f in life.loads):
        exponents = [f.at for f in life.loads if f.integrator == key and f.name == channel]
        m = words.customary_exponent(channel, exponents)
        label = BY_NAME[channel].label.removesuffix(" moment") if channel in BY_NAME else channel
        found.append((f"{label}, m = {m:g}", life.load(key, channel, m)))
    return [(name, figure) for name, figure in found if figure is not None and figure.value]


def _draw_circles(life: Life, key: Key) -> str:
    from matplotlib.ticker import MaxNLocator

    with styled():
        figure = new_figure(3.4)
        for i, place in enumerate(life.places):
            axes: Axes = figure.add_subplot(1, len(life.places), i + 1, projection="polar")
            around = [f for f in life.around(key, place) if f.value is not None]
            angles = np.radians([f.at for f in around] + [around[0].at]) if around else np.zeros(0)
            closed = [*around, *around[:1]]
            axes.plot(angles, [f.value or 0.0 for f in closed], color=INK, linewidth=1.3)
            for end in ("low", "high"):
                values = [getattr(f, end) for f in closed]
                if closed and all(v is not None for v in values):
                    axes.plot(angles, values, color=QUIET, linewidth=0.8, linestyle=LINES[1])
            axes.set_title(words.place_label(place), fontweight="normal", pad=12)
            axes.set_theta_zero_location("N")  # type: ignore[attr-defined]
            axes.set_xticks(np.radians(range(0, 360, 45)))
            axes.tick_params(labelsize=6.5)
            axes.yaxis.set_major_formatter(lambda value, _: _significant(value))
            axes.yaxis.set_major_locator(MaxNLocator(4))
            axes.grid(linewidth=0.4)
            axes.set_rlabel_position(22.5)  # type: ignore[attr-defined]
        return to_svg(figure)


def _draw_shares(life: Life, key: Key) -> str:
    figures = _shown(life, key)
    middles = np.array([0.5 * (b.low + b.high) for b in life.bins])
    widths = np.array([b.high - b.low for b in life.bins])
    with styled():
        figure = new_figure(2.9)
        axes = figure.subplots()
        step = 0.86 / max(len(figures), 1)
        for i, (name, one) in enumerate(figures):
            place = middles + widths * (-0.43 + step * (i + 0.5))
            axes.bar(
                place, one.shares, widths * step, label=name, color=COLOURS[i % len(COLOURS)], hatch=HATCHES[i % len(HATCHES)],
                edgecolor="white", linewidth=0.3,
            )  # fmt: skip
        time = [b.probability / (life.covered or 1.0) for b in life.bins]
        axes.stairs(
            time,
            [b.low for b in life.bins] + [life.bins[-1].high],
            color=INK,
            linewidth=0.9,
            label="time, of that in the bins",
        )
        axes.set_xlabel("hub-height wind speed [m/s]")
        axes.set_ylabel("share")
        axes.yaxis.set_major_formatter(lambda value, _: f"{value:.0%}")
        axes.set_xticks([*(b.low for b in life.bins), life.bins[-1].high])
        axes.grid(axis="y")
        figure.legend(loc="outside upper center", ncols=4 if len(figures) < 8 else 5)
        return to_svg(figure)


def _draw_errors(run: Run, life: Life, key: Key) -> str:
    channels = list(dict.fromkeys(f.name for f in life.loads))
    shown = [s for s in run.integrators if words.worst_error(life, s.key) is not None][:8]
    look = looks(run.summaries)
    with styled():
        figure = new_figure(2.9)
        axes = figure.subplots()
        for i, channel in enumerate(channels):
            scatter = [
                f.scatter for f in life.loads if f.integrator == key and f.name == channel and f.scatter
            ]
            if scatter:
                axes.fill_between(
                    [i - 0.42, i + 0.42],
                    0.94 * 0.94 * min(scatter),
                    1.06 * max(scatter),
                    color="#c8c8c8",
                    linewidth=0,
                )
            for j, s in enumerate(shown):
                x = i + (-0.34 + 0.68 * (j + 0.5) / len(shown))
                errors = [
                    abs(f.error)
                    for f in life.loads
                    if f.integrator == s.key and f.name == channel and f.error
                ]
                axes.plot([x] * len(errors), errors, markersize=4, **look[s].dots())
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(percent)
        labels = [
            BY_NAME[c]
            .label.removesuffix(" moment")
            .replace(" root ", " root\n")
            .replace("tower-base ", "tower-base\n")
            if c in BY_NAME
            else c
            for c in channels
        ]
        axes.set_xticks(range(len(channels)), labels)
        axes.set_xlim(-0.5, len(channels) - 0.5)
        axes.set_ylabel("error of the lifetime DEL")
        axes.grid(axis="y")
        draw_legend(figure, shown, look, dots=True)
        return to_svg(figure)
