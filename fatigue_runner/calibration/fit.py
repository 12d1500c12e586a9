"""The correction of one load channel, fitted to another program's series under the same winds, and how far it can be trusted.

The two programs' series need not be in phase (a rotor that turns a little faster is out of phase within a minute), so nothing is fitted
point by point; what counts is the distribution of the load ranges. With d = L - mean(L) over a case, s its standard deviation,

    L' = mean(L) + a + e^g s sgn(d) |d / s|^p

a, g and p are polynomials in the mean wind speed. g is the ratio of all ranges, p what large ranges have beside small ones (1: nothing).
Of each block of a run g and p are those with which its damage-equivalent loads come nearest to the other program's, over all Wöhler
exponents; the polynomials go through the blocks. Their degree, whether p is fitted, and whether there is a correction at all, is what
errs least on blocks that were left out. The uncertainty is that of the fit: blocks drawn anew (bootstrap).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.fatigue import equivalent_load, rainflow, short_term_cycles

Array = NDArray[np.float64]

NOTHING, DEGREES = -1, (0, 1, 2)  # of the polynomials in wind speed; a degree of -1 has no coefficient
WORTH = 0.9  # a more elaborate form must leave less than this share of a simpler one's error
POWERS = np.linspace(0.8, 1.2, 17)  # tried for p
RESAMPLES = 200
SEED = 0


@dataclass(frozen=True)
class Block:
    """A piece of one run in both programs: wind [m/s], seconds, the channel's samples, of ours and theirs, and the run's name."""

    run: str
    wind: float
    seconds: float
    ours: Array
    theirs: Array


@dataclass(frozen=True)
class Form:
    """degree of the polynomials in wind speed; shaped: whether p is fitted, else 1."""

    degree: int
    shaped: bool

    def __str__(self) -> str:
        if self.degree == NOTHING:
            return "none"
        what = ("one factor", "linear in wind", "quadratic in wind")[self.degree]
        return f"{what}{', ranges by size' if self.shaped else ''}"


@dataclass(frozen=True, eq=False)
class Correction:
    """Of one channel. coefficients (3, degree + 1) of a [unit of the channel], g and p - 1 over (wind - middle) / half the trained range;
    resampled (n, 3, degree + 1): those of runs drawn anew; winds [m/s] and spreads [unit]: least and largest of the training, the
    spread being the standard deviation of our load."""

    form: Form
    coefficients: Array
    resampled: Array
    winds: tuple[float, float]
    spreads: tuple[float, float]

    def apply(self, load: Array, wind: float, number: int | None = None) -> Array:
        """The corrected series (n,) of a whole case; beyond the trained winds that of the nearest; number: of a resampled fit."""
        a, g, p = self.at(wind, number)
        mean, spread = float(load.mean()), float(load.std())
        return np.asarray(mean + a + (shaped(load - mean, spread, p) * np.exp(g) if spread else 0.0))

    def at(self, wind: float, number: int | None = None) -> tuple[float, float, float]:
        """(a, g, p) at a mean wind [m/s]."""
        found = self.coefficients if number is None else self.resampled[number]
        row = powers(np.clip(wind, *self.winds), self.winds, self.form.degree)
        a, g, p = (float(row @ c) for c in found)
        return a, g, 1.0 + p

    def extrapolates(self, wind: float, spread: float) -> str:
        """What of a case lies outside of the training, in words; empty where nothing does."""
        said = []
        low, high = self.winds
        if not low - 0.5 <= wind <= high + 0.5:
            said.append(f"wind {wind:.3g} m/s, trained {low:.3g} to {high:.3g}")
        low, high = self.spreads
        if not low / 1.25 <= spread <= high * 1.25:
            said.append(f"standard deviation {spread:.3g}, trained {low:.3g} to {high:.3g}")
        return "; ".join(said)


def shaped(d: Array, spread: float, p: float) -> Array:
    """s sgn(d) |d / s|^p"""
    return d if p == 1.0 else np.asarray(spread * np.sign(d) * np.abs(d / spread) ** p)


def powers(wind: float | Array, winds: tuple[float, float], degree: int) -> Array:
    """(degree + 1,) or (n, degree + 1) powers of the wind, on the trained range as -1 to 1."""
    middle, half = (winds[0] + winds[1]) / 2, max((winds[1] - winds[0]) / 2, 1e-9)
    place = (np.asarray(wind, float) - middle) / half
    return np.asarray(place[..., None] ** np.arange(degree + 1))


def loads(series: Array, exponents: Sequence[float], seconds: float) -> Array:
    """(exponents,) damage-equivalent loads at 1 Hz of a series."""
    ranges, _, counts = rainflow(series)
    return np.array([equivalent_load(ranges, counts, m, short_term_cycles(seconds)) for m in exponents])


@dataclass(frozen=True, eq=False)
class Measured:
    """What the fit needs of a block: its own best (a, g, p) with p fitted and without, and ln of our loads with p at POWERS and of
    theirs."""

    run: str
    wind: float
    spread: float
    best: dict[bool, Array]
    ours: Array  # (powers, exponents)
    theirs: Array  # (exponents,)

    def error(self, g: float, p: float) -> Array:
        """(exponents,) relative error of the corrected loads; p: its distance from 1."""
        found = np.array([np.interp(1.0 + p, POWERS, column) for column in self.ours.T])
        return np.expm1(found + g - self.theirs)


def measured(block: Block, exponents: Sequence[float]) -> Measured:
    """Count a block."""
    mean, spread = float(block.ours.mean()), float(block.ours.std())
    d, shift = block.ours - mean, float(block.theirs.mean()) - mean
    ours = np.log([loads(shaped(d, spread, p), exponents, block.seconds) for p in POWERS])
    theirs = np.log(loads(block.theirs, exponents, block.seconds))
    gap = theirs - ours  # (powers, exponents): g that each exponent asks for
    place = int(np.argmin(gap.var(axis=1)))
    plain = int(np.argmin(np.abs(POWERS - 1.0)))
    best = {
        True: np.array([shift, gap[place].mean(), POWERS[place] - 1.0]),
        False: np.array([shift, gap[plain].mean(), 0.0]),
    }
    return Measured(block.run, block.wind, spread, best, ours, theirs)


def fitted(found: Sequence[Measured], form: Form, winds: tuple[float, float]) -> Array:
    """(3, degree + 1) coefficients through the blocks by least squares; of a lower degree where there are too few winds for it."""
    degree = min(form.degree, len({b.wind for b in found}) - 1)
    out = np.zeros((3, form.degree + 1))
    if degree >= 0:
        rows = powers(np.array([b.wind for b in found]), winds, degree)
        values = np.array([b.best[form.shaped] for b in found])
        out[:, : degree + 1] = np.linalg.lstsq(rows, values, rcond=None)[0].T
    return out


@dataclass(frozen=True, eq=False)
class Fit:
    """The correction of a channel; the forms that were tried with their errors on blocks left out (rms over exponents and blocks); for each
    run the correction of the same form without it, where another one is left."""

    correction: Correction
    tried: dict[Form, float]
    without: dict[str, Correction] = field(default_factory=dict)


def fit(blocks: Sequence[Block], exponents: Sequence[float]) -> Fit:
    """The correction of one channel from all blocks of its training runs."""
    found = [measured(block, exponents) for block in blocks]
    winds = min(b.wind for b in found), max(b.wind for b in found)
    tried = {}
    for form in _forms(found):
        errors = [_errors(found, form, winds, i) for i in range(len(found))]
        tried[form] = float(np.sqrt(np.mean(np.square(errors))))
    least = min(tried.values())
    form = next(f for f, error in tried.items() if WORTH * error <= least)  # the simplest first
    rng = np.random.Generator(np.random.PCG64(SEED))
    drawn = [[found[i] for i in rng.integers(0, len(found), len(found))] for _ in range(RESAMPLES)]
    correction = _correction(found, form, [fitted(chosen, form, winds) for chosen in drawn])
    kept = {name: [b for b in found if b.run != name] for name in dict.fromkeys(b.run for b in found)}
    return Fit(correction, tried, {name: _correction(rest, form, []) for name, rest in kept.items() if rest})


def _correction(found: Sequence[Measured], form: Form, resampled: Sequence[Array]) -> Correction:
    winds, spreads = [b.wind for b in found], [b.spread for b in found]
    extent = min(winds), max(winds)
    own = fitted(found, form, extent)
    drawn = np.array(resampled).reshape(len(resampled), *own.shape)
    return Correction(form, own, drawn, extent, (min(spreads), max(spreads)))


def _forms(found: Sequence[Measured]) -> list[Form]:
    """From the simplest on: those that so many winds can settle with a block left out."""
    speeds = len({b.wind for b in found})
    able = [Form(d, s) for d in DEGREES for s in (False, True) if d < speeds and len(found) > d + 1]
    return [Form(NOTHING, False), *able]


def _errors(found: Sequence[Measured], form: Form, winds: tuple[float, float], left: int) -> Array:
    """(exponents,) relative errors of the loads of block `left`, which is left out of the fit."""
    coefficients = fitted([b for i, b in enumerate(found) if i != left], form, winds)
    row = powers(found[left].wind, winds, form.degree)
    _, g, p = (float(row @ c) for c in coefficients)
    return found[left].error(g, p)
