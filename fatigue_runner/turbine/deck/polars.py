"""Polars of a deck's airfoils, for each station of the blade, as AeroDyn takes them from files of one table or of several.

`AFTabMod` 1: the first table of a file. 2: between tables by the logarithm of the Reynolds number, which here is each station's own in
typical operation, since the aerodynamic tables are made once. 3: by the user's property, which is 0 unless a controller sets it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fatigue_runner.errors import InputError
from fatigue_runner.turbine.deck.files import Deck
from fatigue_runner.turbine.deck.rosco import rated_rotor_speed
from fatigue_runner.turbine.deck.text import DeckFile, Entry, number

BY_REYNOLDS, BY_USER = 2, 3  # of AFTabMod
AIR = 1.464e-5  # m2/s, kinematic viscosity where the deck has none
AXIAL_WIND = 8.0  # m/s through the rotor near rated wind, two thirds of it
USUAL_TIP_SPEED = 75.0  # m/s
LEAST_ROWS = 3  # of a polar that depends on the angle; AeroDyn takes fewer for constants
HALF_TURN = 179.9  # deg; polars that reach it go round

Points = list[list[float]]


@dataclass(frozen=True)
class Polars:
    """points: {name: [[deg, lift, drag], ...]}; names: of each station."""

    points: dict[str, Points]
    names: list[str]


def station_polars(
    deck: Deck, numbers: Sequence[int], span: Sequence[float], chord: Sequence[float], notes: list[str]
) -> Polars:
    """Of stations with these airfoils (from 1), `span` from the root [m] and chords [m]; what was decided goes to `notes`.

    Raises InputError, with file and line, for tables that cannot be read or interpolated between.
    """
    named = dict(enumerate(_names(deck), start=1))
    mode = deck.aero.switch("AFTabMod", default=1)
    tables = {i: _tables(deck, deck.airfoils[i - 1], mode) for i in sorted(set(numbers))}
    if all(len(found) == 1 for found in tables.values()):
        return Polars({named[i]: found[0].points for i, found in tables.items()}, [named[i] for i in numbers])
    at = (
        _reynolds(deck, np.array(span), np.array(chord), notes)
        if mode == BY_REYNOLDS
        else np.zeros(len(span))
    )
    if mode == BY_USER:
        notes.append(
            "airfoils with a table for each setting of the user's property (AFTabMod 3): that of setting 0 is taken, which OpenFAST has "
            "unless its controller sets another"
        )
    points, names = {}, []
    for i, value in zip(numbers, at, strict=True):
        found = tables[i]
        value = float(np.clip(value, found[0].at, found[-1].at))
        several = len(found) > 1 and mode == BY_REYNOLDS
        name = f"{named[i]}-Re{value / 1e6:.3g}M" if several else named[i]
        names.append(name)
        points[name] = _between(found, value, np.log if several else np.asarray)
    return Polars(points, names)


@dataclass(frozen=True)
class _Table:
    """at: Reynolds number, or setting of the user's property; points: [[deg, lift, drag], ...], which go round."""

    at: float
    points: Points


def _tables(deck: Deck, file: DeckFile, mode: int) -> list[_Table]:
    """Those of a file that AeroDyn would look into, by rising Reynolds number or setting."""
    count = file.count("NumTabs") if file.has("NumTabs") else 1
    heads = file.all("NumAlf")
    if len(heads) < count:
        raise InputError(
            f"{file.where('NumTabs')}: NumTabs says {count} tables, the file has {len(heads)} (NumAlf)"
        )
    if count == 1 or mode not in (BY_REYNOLDS, BY_USER):
        return [_Table(0.0, _points(deck, file, heads[0]))]
    keys, scale = (("Re",), 1e6) if mode == BY_REYNOLDS else (("UserProp", "Ctrl"), 1.0)
    places = file.all(*keys)
    if len(places) < count:
        raise InputError(
            f"{file.where('NumTabs')}: each of the {count} tables needs its {keys[0]} (AFTabMod {mode}); the file has {len(places)}"
        )
    found = [
        _Table(scale * file.number_of(place, keys[0]), _points(deck, file, head))
        for place, head in zip(places[:count], heads, strict=False)
    ]
    for place, low, high in zip(places[1:count], found, found[1:], strict=False):
        if not high.at > low.at:
            raise InputError(f"{file.path}:{place.line}: {keys[0]} must rise from table to table")
    if mode == BY_REYNOLDS and not found[0].at > 0:
        raise InputError(
            f"{file.path}:{places[0].line}: Re must be above 0, in millions; got {found[0].at / 1e6:g}"
        )
    return found


def _between(tables: Sequence[_Table], value: float, scale: Callable[[float], Any]) -> Points:
    """Linear between the tables on both sides of a value, at the angles of both."""
    above = next((i for i, table in enumerate(tables) if table.at >= value), len(tables) - 1)
    low, high = tables[max(above - 1, 0)], tables[above]
    if value in (low.at, high.at) or low is high:
        return (low if value == low.at else high).points
    share = float((scale(value) - scale(low.at)) / (scale(high.at) - scale(low.at)))
    one, two = np.array(low.points), np.array(high.points)
    angles = np.union1d(one[:, 0], two[:, 0])
    mixed = [
        (1 - share) * np.interp(angles, one[:, 0], one[:, k])
        + share * np.interp(angles, two[:, 0], two[:, k])
        for k in (1, 2)
    ]
    return [[float(v) for v in row] for row in zip(angles, *mixed, strict=True)]


def _reynolds(deck: Deck, span: np.ndarray, chord: np.ndarray, notes: list[str]) -> np.ndarray:
    """Of each station, at the rated rotor speed."""
    radius = deck.elasto.number("HubRad") + span
    speed = rated_rotor_speed(deck)
    if speed is None:
        speed, whence = USUAL_TIP_SPEED / radius[-1], f"a tip speed of {USUAL_TIP_SPEED:g} m/s"
    else:
        whence = f"the rated rotor speed, {speed * 30 / np.pi:.3g} rpm"
    own = deck.main.number("KinVisc", default=AIR)
    viscosity = deck.aero.number("KinVisc", default=own)
    if not viscosity > 0:
        raise InputError(f"{deck.aero.where('KinVisc')}: KinVisc must be above 0 m2/s; got {viscosity:g}")
    found = np.hypot(speed * radius, AXIAL_WIND) * chord / viscosity
    outer = found[np.searchsorted(span, 0.75 * span[-1])]
    notes.append(
        f"airfoils with a table for each Reynolds number (AFTabMod 2): each station has the polar of its own at {whence} "
        f"({outer / 1e6:.2g} million at three quarters of the blade); OpenFAST follows it from step to step"
    )
    return found


def _names(deck: Deck) -> list[str]:
    """Names of the files without what they share; numbered where two are the same."""
    out: list[str] = []
    for file in deck.airfoils:
        name = file.path.stem
        while name in out:
            name += "-b"
        out.append(name)
    return out


def _points(deck: Deck, file: DeckFile, head: Entry) -> Points:
    """The rows below a NumAlf, whose columns AeroDyn's file numbers."""
    columns = [
        int(deck.aero.number(f"InCol_{n}", default=d)) - 1 for n, d in (("Alfa", 1), ("Cl", 2), ("Cd", 3))
    ]
    count = int(file.number_of(head, "NumAlf"))
    if count < 1:
        raise InputError(f"{file.path}:{head.line}: NumAlf must be at least 1; got {count}")
    lines, rows = file.rows(head.line + 1, count, 1 + max(columns), "NumAlf")
    points: Points = []
    for line, row in zip(lines, rows, strict=True):
        values = [number(row[c]) for c in columns]
        if any(v is None for v in values):
            raise InputError(
                f"{file.path}:{line}: angle, lift and drag must be numbers; got {' '.join(row)!r:.60}"
            )
        point = [float(v) for v in values if v is not None]
        if points and point[0] <= points[-1][0]:
            if point[0] == points[-1][0]:
                continue
            raise InputError(
                f"{file.path}:{line}: the angles of attack must rise; got {point[0]:g} after {points[-1][0]:g} deg"
            )
        points.append(point)
    first, last = points[0][0], points[-1][0]
    constant = len(points) < LEAST_ROWS or all(point[1:] == points[0][1:] for point in points)
    if constant and not (first <= -HALF_TURN and last >= HALF_TURN):
        return [[angle, *points[0][1:]] for angle in (-180.0, 0.0, 180.0)]  # at any angle, as AeroDyn does
    if -3.3 < first < -3.0 and 3.0 < last < 3.3:
        raise InputError(
            f"{file.path}:{lines[0]}: the angles of attack run from {first:g} to {last:g}: they are in radians, give degrees"
        )
    if first > -HALF_TURN or last < HALF_TURN:
        raise InputError(
            f"{file.path}:{lines[0] if first > -HALF_TURN else lines[-1]}: the polar reaches from {first:g} to {last:g} deg; blades meet "
            "all angles, it must go from -180 to 180 (Viterna's method extends one)"
        )
    points[0][0], points[-1][0] = min(first, -180.0), max(last, 180.0)
    return points
