"""A life from the rows of the results table: lifetime equivalent loads and damage of every integrator, with what the seeds leave open.

`life_of` weighs every wind with the climate; the figures of a channel add by their power sum, those of a place by Miner's. Everything
is made from the table alone, so that another climate needs no new simulation.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from fatigue_runner.channels import BY_NAME, channel_name
from fatigue_runner.errors import InputError
from fatigue_runner.fatigue import Climate
from fatigue_runner.fatigue.lifetime import (
    HOURS_PER_YEAR,
    SECONDS_PER_YEAR,
    interval,
    power_mean,
    resampled,
)
from fatigue_runner.inputs.files import write_atomically
from fatigue_runner.naming import integrator_label
from fatigue_runner.results.cells import Row, number, text
from fatigue_runner.results.columns import WIND, Column
from fatigue_runner.results.frames import to_arrow, to_pandas
from fatigue_runner.results.lifetime_section import LifetimeSection, check_covered
from fatigue_runner.results.ranking import fatigue_columns, integrator_key, section_columns

_DAMAGE = re.compile(r"^damage_(?!ratio_)(?P<place>[a-z]\w*)_(?P<azimuth>\d{3})$")
FEW_SEEDS = 2  # fewer in every bin leave nothing to draw from

Key = tuple[str, float | None, str, str, bool]

_INTEGRATOR = (
    Column("method", "integrator", "integration method", "", "text"),
    Column("step", "integrator", "its time step", "s"),
    Column("corrector", "integrator", "name of the learned corrector", "", "text"),
    Column("mode", "integrator", "enhanced: corrected; hybrid: corrected and guarded", "", "text"),
    Column("is_reference", "integrator", "whether the others are measured against it", "", "truth"),
)
_COVER = (
    Column(
        "governing_wind_from", "fatigue", "lower edge of the wind bin that does most of the damage", "m/s"
    ),
    Column("governing_wind_to", "fatigue", "its upper edge", "m/s"),
    Column("governing_share", "fatigue", "its share of the damage"),
    Column("cases", "outcome", "cases that count", "-", "whole"),
    Column("lost_cases", "outcome", "cases that diverged, failed or have no load", "-", "whole"),
    Column("covered", "outcome", "probability of the winds that count"),
    Column("lost", "outcome", "probability of the winds of lost cases"),
)
LOAD_COLUMNS = (
    *_INTEGRATOR,
    Column("channel", "fatigue", "load channel", "", "text"),
    Column("wohler_exponent", "fatigue", "Wöhler exponent m"),
    Column("lifetime_del", "fatigue", "constant load range that does the life's damage in n_eq cycles", "of the channel"),
    Column("lifetime_del_low", "fatigue", "lower end of the seeds' interval", "of the channel"),
    Column("lifetime_del_high", "fatigue", "its upper end", "of the channel"),
    Column("error", "fatigue", "relative error against the reference over the winds that both finished"),
    Column("unit", "fatigue", "unit of the loads", "", "text"),
    *_COVER,
)  # fmt: skip
DAMAGE_COLUMNS = (
    *_INTEGRATOR,
    Column("place", "fatigue", "section whose wall is counted", "", "text"),
    Column("azimuth_deg", "fatigue", "where on its circumference: 0 downwind, 90 lateral (blade: towards the trailing edge)", "deg"),
    Column("damage", "fatigue", "Miner's sum of the life; 1 is failure"),
    Column("damage_low", "fatigue", "lower end of the seeds' interval"),
    Column("damage_high", "fatigue", "its upper end"),
    Column("life_years", "fatigue", "years until the sum is 1; empty where nothing wears", "years"),
    Column("error", "fatigue", "relative error against the reference over the winds that both finished"),
    *_COVER,
)  # fmt: skip


@dataclass(frozen=True)
class WindBin:
    """One bin of the climate: its edges [m/s], probability, and how many winds stand in it."""

    low: float
    high: float
    probability: float
    winds: int

    @property
    def hours_per_year(self) -> float:
        """How long its wind blows in a year of 8760 h."""
        return self.probability * HOURS_PER_YEAR


@dataclass(frozen=True, eq=False)
class Figure:
    """One figure of a life: of a channel and exponent, or of a place and azimuth [deg].

    value None: no case counts. low, high: what the seeds leave; None with one seed a bin. error: against the reference, over the winds
    that both finished; None for itself and without one. shares: of the damage, by bin. scatter: (high - low) / (2 value).
    """

    integrator: Key
    name: str
    at: float
    value: float | None
    low: float | None
    high: float | None
    error: float | None
    shares: tuple[float, ...]
    cases: int
    lost_cases: int
    covered: float
    lost: float

    @property
    def governing(self) -> int | None:
        """The bin that does most of the damage; None where nothing wears."""
        return int(np.argmax(self.shares)) if any(self.shares) else None

    @property
    def scatter(self) -> float | None:
        """Half of the seeds' interval over the value."""
        if self.low is None or self.high is None or not self.value:
            return None
        return (self.high - self.low) / (2.0 * self.value)


@dataclass(frozen=True, eq=False)
class Life:
    """A life: the winds' bins, a figure for every integrator, channel and exponent, and for every place and azimuth; sections: as loads, of
    places along tower and blade."""

    section: LifetimeSection
    climate: Climate
    bins: tuple[WindBin, ...]
    loads: tuple[Figure, ...]
    damages: tuple[Figure, ...]
    sections: tuple[Figure, ...] = ()

    @property
    def covered(self) -> float:
        """Probability of all bins, as it is, not renormalised."""
        return math.fsum(b.probability for b in self.bins)

    @property
    def below(self) -> float:
        """Probability of wind below the first bin."""
        return max(0.0, float(self.climate.exceedance(0.0) - self.climate.exceedance(self.bins[0].low)))

    @property
    def above(self) -> float:
        """Probability of wind above the last bin."""
        return float(self.climate.exceedance(self.bins[-1].high))

    @cached_property
    def integrators(self) -> tuple[Key, ...]:
        """Every integrator of the table, the reference first where there is one."""
        keys = dict.fromkeys(figure.integrator for figure in (*self.loads, *self.damages))
        return tuple(sorted(keys, key=lambda key: not key[-1]))

    def load(self, integrator: Key, channel: str, m: float) -> Figure | None:
        """The lifetime load of a channel and exponent, by its own or by OpenFAST's name; None where it was not counted."""
        channel = channel_name(channel, (f.name for f in self.sections))
        return next(
            (
                f
                for f in (*self.loads, *self.sections)
                if (f.integrator, f.name, f.at) == (integrator, channel, float(m))
            ),
            None,
        )

    def around(self, integrator: Key, place: str) -> list[Figure]:
        """The damage around a place, by azimuth."""
        return sorted(
            (f for f in self.damages if (f.integrator, f.name) == (integrator, place)), key=lambda f: f.at
        )

    @cached_property
    def places(self) -> tuple[str, ...]:
        """The places whose wall was counted."""
        return tuple(dict.fromkeys(f.name for f in self.damages))

    def hot_spot(self, integrator: Key, place: str) -> Figure | None:
        """Where a place wears most; None without a figure."""
        known = [f for f in self.around(integrator, place) if f.value is not None]
        return max(known, key=lambda f: f.value or 0.0, default=None)

    def years_of(self, figure: Figure) -> float | None:
        """Years until Miner's sum of a place is 1; None where nothing wears or is known."""
        return self.section.years / figure.value if figure.value else None

    def statement(self) -> list[str]:
        """What every figure rests on, in sentences: climate, the bins' sum, idle time."""
        scaled = "scaled to 1 as asked" if self.section.renormalise else "taken as it is, not renormalised"
        idle = 1.0 - self.covered * self.section.availability
        said = [
            f"Climate: {self.climate.name}. The {len(self.bins)} bins from {self.bins[0].low:g} to {self.bins[-1].high:g} m/s hold "
            f"{self.covered:.4f} of the time ({scaled}); {self.below:.4f} blows below them, {self.above:.4f} above.",
        ]
        if not self.section.renormalise:
            said.append(
                f"Idle for {idle:.1%} of the {self.section.years:g} years (availability {self.section.availability:g}): "
                "no damage is counted then."
            )
        return said

    def load_rows(self) -> list[dict[str, Any]]:
        """The table of lifetime loads, `LOAD_COLUMNS`."""
        return [
            {
                **_named(f.integrator), "channel": f.name, "wohler_exponent": f.at, "lifetime_del": f.value,
                "lifetime_del_low": f.low, "lifetime_del_high": f.high, "error": f.error,
                "unit": BY_NAME[f.name].unit if f.name in BY_NAME else "", **self._cover(f),
            }
            for f in (*self.loads, *self.sections)
        ]  # fmt: skip

    def damage_rows(self) -> list[dict[str, Any]]:
        """The table of damage around the places, `DAMAGE_COLUMNS`."""
        return [
            {
                **_named(f.integrator), "place": f.name, "azimuth_deg": f.at, "damage": f.value, "damage_low": f.low,
                "damage_high": f.high, "life_years": self.years_of(f), "error": f.error, **self._cover(f),
            }
            for f in self.damages
        ]  # fmt: skip

    def to_pandas(self) -> Any:
        """The table of lifetime loads as a pandas DataFrame, where pandas is installed."""
        return to_pandas(self.load_rows(), [column.name for column in LOAD_COLUMNS])

    def damage_to_pandas(self) -> Any:
        """The table of damage around the places as a pandas DataFrame, where pandas is installed."""
        return to_pandas(self.damage_rows(), [column.name for column in DAMAGE_COLUMNS])

    def to_arrow(self) -> Any:
        """The table of lifetime loads as a pyarrow Table, where pyarrow is installed."""
        return to_arrow(self.load_rows(), {column.name: column.kind for column in LOAD_COLUMNS})

    def damage_to_arrow(self) -> Any:
        """The table of damage around the places as a pyarrow Table, where pyarrow is installed."""
        return to_arrow(self.damage_rows(), {column.name: column.kind for column in DAMAGE_COLUMNS})

    def write(self, folder: Path) -> None:
        """Write `lifetime.csv`, and `damage.csv` where places were counted, beside results.csv."""
        _write(folder / "lifetime.csv", LOAD_COLUMNS, self.load_rows())
        if self.damages:
            _write(folder / "damage.csv", DAMAGE_COLUMNS, self.damage_rows())
        else:
            (folder / "damage.csv").unlink(missing_ok=True)  # of an earlier run with places

    def _cover(self, figure: Figure) -> dict[str, Any]:
        place = figure.governing
        edges = (None, None, None)
        if place is not None:
            edges = (self.bins[place].low, self.bins[place].high, figure.shares[place])  # type: ignore[assignment]
        return {
            **dict(zip(("governing_wind_from", "governing_wind_to", "governing_share"), edges, strict=True)),
            "cases": figure.cases, "lost_cases": figure.lost_cases, "covered": figure.covered, "lost": figure.lost,
        }  # fmt: skip


def label_of(integrator: Key) -> str:
    """An integrator as a person reads it."""
    method, step, corrector, mode, _ = integrator
    return integrator_label(method, step, corrector, mode)


def damage_columns(rows: Iterable[Row]) -> list[tuple[str, float, str]]:
    """(place, azimuth [deg], column) of every damage that the table has."""
    names = dict.fromkeys(str(column) for columns in dict.fromkeys(map(tuple, rows)) for column in columns)
    found = (m for m in map(_DAMAGE.match, names) if m is not None)
    return [(m["place"], float(m["azimuth"]), m.string) for m in found]


def life_of(
    rows: Iterable[Row], section: LifetimeSection, operating_range: Sequence[float] | None = None
) -> Life:
    """The life that the cases of a results table stand for.

    rows: of a results table; operating_range [m/s]: where the turbine turns, unless the section says so. The winds of one bin share its
    probability; that of a case without a figure is lost, and handed to no other.
    Raises InputError for winds without a mean speed, and for bins that are empty, overlap or miss part of the operating range.
    """
    table = list(rows)
    winds: dict[tuple[str, ...], float] = {}
    for row in table:
        speed = number(row, "wind_speed")
        if speed is not None:
            winds.setdefault(_wind(row), speed)
    if not winds:
        raise InputError("the results have no wind with a mean speed; a life needs one")
    bins = section.bins_of(list(winds.values()))
    if operating_range is not None and section.operating_range is None:
        check_covered(bins, operating_range)
    climate = section.distribution
    probabilities = bins.probabilities(climate)
    places = dict(zip(winds, bins.places(list(winds.values())), strict=True))
    counts = np.bincount(list(places.values()), minlength=len(bins))
    if section.renormalise:
        probabilities = probabilities / probabilities.sum()
    design = _Design(section, places, probabilities, counts)
    groups: dict[Key, dict[tuple[str, ...], Row]] = {}
    for row in table:
        if number(row, "wind_speed") is not None:
            groups.setdefault(integrator_key(row), {})[_wind(row)] = row
    reference = next((rows for key, rows in groups.items() if key[-1]), None)
    quantities, sections = (
        [(channel, m, f"del_{suffix}", m) for channel, m, suffix in columns]
        for columns in (fatigue_columns(table), section_columns(table))
    )
    damages = [(place, at, column, 1.0) for place, at, column in damage_columns(table)]
    made = [
        [
            _figure(key, group, reference, quantity, design)
            for key, group in groups.items()
            for quantity in kind
        ]
        for kind in (quantities, damages, sections)
    ]
    shown = bins.probabilities(climate)
    return Life(
        section,
        climate,
        tuple(
            WindBin(bins.edges[i], bins.edges[i + 1], float(shown[i]), int(counts[i]))
            for i in range(len(bins))
        ),
        tuple(made[0]),
        tuple(made[1]),
        tuple(made[2]),
    )


@dataclass(frozen=True, eq=False)
class _Design:
    """Which winds there are: the bin of each, the probability of each bin, and the winds that share it."""

    section: LifetimeSection
    places: dict[tuple[str, ...], int]
    probabilities: np.ndarray
    counts: np.ndarray
    drawn: dict[tuple[int, ...], np.ndarray] = field(default_factory=dict)

    def draws(self, bins: tuple[int, ...]) -> np.ndarray:
        """The bootstrap's counts (resamples, n): the same for every figure of the same winds, so that their scatter goes together."""
        if bins not in self.drawn:
            self.drawn[bins] = resampled(bins, self.section.resamples)
        return self.drawn[bins]

    def share(self, wind: tuple[str, ...]) -> float:
        place = self.places[wind]
        return float(self.probabilities[place] / self.counts[place])

    def total(self, values: np.ndarray, weights: np.ndarray, m: float, at_1_hz: bool) -> Any:
        """The figure of a life: a lifetime load for a 1-Hz load, Miner's sum for a damage a year."""
        section = self.section
        life = section.years * section.availability
        if at_1_hz:
            return power_mean(values, weights, m) * (life * SECONDS_PER_YEAR / section.n_eq) ** (1.0 / m)
        return life * (weights @ values)


def _figure(
    key: Key,
    group: dict[tuple[str, ...], Row],
    reference: dict[tuple[str, ...], Row] | None,
    quantity: tuple[str, float, str, float],
    design: _Design,
) -> Figure:
    name, at, column, m = quantity
    is_load = column.startswith("del_")
    known = _values(group, column)
    winds = [wind for wind in design.places if wind in known]
    lost = [wind for wind in design.places if wind not in known]
    values = np.array([known[wind] for wind in winds])
    weights = np.array([design.share(wind) for wind in winds])
    value = low = high = None
    shares = [0.0] * len(design.counts)
    if winds:
        value = float(design.total(values, weights, m, is_load))
        parts = weights * _scaled(values) ** m
        for wind, part in zip(winds, parts, strict=True):
            shares[design.places[wind]] += float(part / parts.sum()) if parts.sum() > 0.0 else 0.0
        bins = [design.places[wind] for wind in winds]
        if len(winds) >= FEW_SEEDS * len(set(bins)):
            drawn = design.draws(tuple(bins)) * weights
            low, high = interval(design.total(values, drawn, m, is_load), design.section.confidence)
    return Figure(
        key,
        name,
        at,
        value,
        low,
        high,
        None
        if reference is None or key[-1]
        else _error(known, _values(reference, column), design, m, is_load),
        tuple(shares),
        len(winds),
        len(lost),
        math.fsum(weights),
        math.fsum(design.share(wind) for wind in lost),
    )


def _error(
    own: dict[tuple[str, ...], float],
    theirs: dict[tuple[str, ...], float],
    design: _Design,
    m: float,
    is_load: bool,
) -> float | None:
    """Relative error of a life over the winds that both know."""
    both = [wind for wind in design.places if wind in own and wind in theirs]
    weights = np.array([design.share(wind) for wind in both])
    mine, reference = (
        float(design.total(np.array([values[wind] for wind in both]), weights, m, is_load)) if both else 0.0
        for values in (own, theirs)
    )
    return mine / reference - 1.0 if reference else None


def _values(group: dict[tuple[str, ...], Row], column: str) -> dict[tuple[str, ...], float]:
    """The known figures of the finished cases by wind."""
    found = {wind: number(row, column) for wind, row in group.items() if text(row, "status") == "done"}
    return {wind: value for wind, value in found.items() if value is not None}


def _scaled(values: np.ndarray) -> np.ndarray:
    return values / (float(values.max(initial=0.0)) or 1.0)


def _wind(row: Row) -> tuple[str, ...]:
    return tuple(text(row, column) for column in WIND)


def _named(key: Key) -> dict[str, Any]:
    method, step, corrector, mode, is_reference = key
    return {
        "method": method,
        "step": step,
        "corrector": corrector or None,
        "mode": mode or None,
        "is_reference": is_reference,
    }


def _write(path: Path, columns: Sequence[Column], rows: Sequence[dict[str, Any]]) -> None:
    out = io.StringIO()
    writer = csv.DictWriter(out, [column.name for column in columns], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_atomically(path, out.getvalue().encode())
