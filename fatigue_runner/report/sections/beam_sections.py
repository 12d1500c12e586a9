"""Where the loads wear along tower and blade, and in which direction at the root: those sections that a campaign asks for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fatigue_runner.channels import (
    Channel,
    edgewise_at,
    flapwise_at,
    fore_aft_at,
    placed,
    side_side_at,
    towards,
)
from fatigue_runner.report.blocks import Column, Figure, Section, Table, TableRow
from fatigue_runner.report.rundata import Run
from fatigue_runner.report.style import COLOURS, INK, LINES, MARKERS, new_figure, styled, to_svg
from fatigue_runner.results.cells import number, text
from fatigue_runner.results.life_words import customary_exponent, told
from fatigue_runner.results.ranking import integrator_key, section_columns

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ORDER = 45

Kind = Callable[[float], Channel]
ALONG: tuple[tuple[str, str, tuple[tuple[Kind, str], ...]], ...] = (
    ("Tower", "height above its foot [m]", ((fore_aft_at, "fore-aft"), (side_side_at, "side-side"))),
    ("Blade 1", "distance from the rotor's axis, along the blade [m]", ((flapwise_at, "flapwise"), (edgewise_at, "edgewise"))),
)  # fmt: skip


@dataclass(frozen=True)
class Value:
    """The load of one section [N m] at its customary Wöhler exponent."""

    channel: Channel
    kind: Kind
    at: float
    exponent: float
    load: float


def build(run: Run) -> Section | None:
    """A figure of DEL over height, radius and direction, and its table; None where no sections were asked for."""
    values, of = _values(run)
    if not values:
        return None
    caption = (
        f"{of} The sections carry what lies beyond them: inertia, weight and air load of the same bodies as the loads at base and root. "
        "Root by direction: 0° flapwise, 90° edgewise, turning with the pitch; directions were counted over half a circle, the other "
        "half has the same ranges."
    )
    figure = Figure(_draw(values), caption, "Damage-equivalent loads along tower and blade and by direction")
    return Section("Where along tower and blade", [figure, _table(values, of)])


def _values(run: Run) -> tuple[list[Value], str]:
    """Every section's load of the reference, or of the integrator with most cases; and what kind of load it is, in words."""
    by_channel: dict[str, dict[float, str]] = {}
    for channel, exponent, suffix in section_columns(run.rows):
        by_channel.setdefault(channel, {})[exponent] = suffix
    if not by_channel or not run.summaries:
        return [], ""
    life = run.life
    key = told(life) if life is not None else None
    shown = next((s for s in run.summaries if s.key == key), None) or max(
        run.summaries, key=lambda s: (s.is_reference, s.done)
    )
    rows = [r for r in run.rows if integrator_key(r) == shown.key and text(r, "status") == "done"]
    found = []
    for channel, suffixes in by_channel.items():
        m = customary_exponent(channel, suffixes)
        if life is not None:
            figure = life.load(shown.key, channel, m)
            load = None if figure is None else figure.value
        else:
            load = _power_mean([number(row, f"del_{suffixes[m]}") for row in rows], m)
        place = placed(channel)
        if load is not None and place is not None:
            found.append(Value(place.channel, place.kind, place.at, m, load))
    if life is not None:
        return (
            found,
            f"Lifetime DEL ({life.section.n_eq:.3g} cycles in {life.section.years:g} years) by {shown.label}.",
        )
    return (
        found,
        f"Power mean of the short-term DELs over all finished winds, each alike, by {shown.label}: no life was asked for.",
    )


def _power_mean(loads: list[float | None], m: float) -> float | None:
    known = np.array([load for load in loads if load is not None])
    largest = float(known.max()) if known.size else 0.0
    if largest <= 0.0:
        return 0.0 if known.size else None
    return largest * float(np.mean((known / largest) ** m)) ** (1.0 / m)


def _table(values: list[Value], of: str) -> Table:
    columns = (Column("Load", number=False), Column("at", "m, or °"), Column("m"), Column("DEL", "kN·m"))
    rows = [
        TableRow(
            [v.channel.label.split(" at ")[0], f"{v.at:g}", f"{v.exponent:g}", f"{v.load * v.channel.scale:,.4g}"]
        )
        for v in values
    ]  # fmt: skip
    return Table(
        columns, rows, f"{of} At the exponent customary for the material; all others are in results.csv."
    )


def _draw(values: list[Value]) -> str:
    beams = [panel for panel in ALONG if any(v.kind is kind for v in values for kind, _ in panel[2])]
    directions = [v for v in values if v.kind is towards]
    with styled():
        figure = new_figure(3.3)
        count = len(beams) + bool(directions)
        for i, (beam, axis, kinds) in enumerate(beams):
            _draw_beam(figure.add_subplot(1, count, i + 1), values, beam, axis, kinds)
        if directions:
            _draw_rose(figure.add_subplot(1, count, count, projection="polar"), directions)
        return to_svg(figure)


def _draw_beam(
    axes: Axes, values: list[Value], beam: str, axis: str, kinds: tuple[tuple[Kind, str], ...]
) -> None:
    for i, (kind, label) in enumerate(kinds):
        along = sorted((v.at, v.load * v.channel.scale) for v in values if v.kind is kind)
        if along:
            at, loads = zip(*along, strict=True)
            axes.plot(
                loads, at, color=COLOURS[i], linestyle=LINES[i], marker=MARKERS[i], markerfacecolor="white", label=label,
            )  # fmt: skip
    exponents = sorted({v.exponent for v in values if any(v.kind is kind for kind, _ in kinds)})
    axes.set_title(f"{beam}, m = {', '.join(f'{m:g}' for m in exponents)}", fontweight="normal")
    axes.set_xlabel("DEL [kN·m]")
    axes.set_ylabel(axis)
    axes.set_xlim(left=0)
    axes.set_ylim(bottom=0)
    axes.grid()
    axes.legend(loc="upper right")


def _draw_rose(axes: Axes, values: list[Value]) -> None:
    from matplotlib.ticker import MaxNLocator

    half = sorted((v.at, v.load * v.channel.scale) for v in values)
    around = [*half, *((at + 180.0, load) for at, load in half), (half[0][0] + 360.0, half[0][1])]
    at, loads = zip(*around, strict=True)
    axes.plot(np.radians(at), loads, color=INK, marker=".", markersize=3)
    axes.set_title(f"Blade 1 root by direction [kN·m], m = {values[0].exponent:g}", fontweight="normal")
    axes.set_theta_zero_location("N")  # type: ignore[attr-defined]
    axes.set_xticks(np.radians(range(0, 360, 30)))
    axes.set_ylim(0, 1.05 * max(loads))
    axes.yaxis.set_major_locator(MaxNLocator(4))
    axes.set_rlabel_position(15.0)  # type: ignore[attr-defined]
    axes.tick_params(labelsize=6.5)
    axes.grid(linewidth=0.4)
