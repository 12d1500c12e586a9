"""What a load does over time, in counts: Markov matrix, exceedance, level crossings, load duration, power spectral density, extremes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fatigue_runner.fatigue.checks import FatigueInputError, cycles_of, finite_series, positive


def markov_matrix(ranges: Any, means: Any, counts: Any, range_edges: Any, mean_edges: Any) -> np.ndarray:
    """Cycles by range and mean, (ranges, means) bins; what lies outside of the edges is not in it.

    ranges, means, counts: (n,) of `rainflow`; edges rise. A bin holds its lower edge, the last one both.
    """
    r, n = cycles_of(ranges, counts)
    edges = _edges(range_edges), _edges(mean_edges)
    return np.histogram2d(r, np.asarray(means, dtype=np.float64), bins=edges, weights=n)[0]


def exceedance(ranges: Any, counts: Any) -> tuple[np.ndarray, np.ndarray]:
    """Ranges from the largest down, and how many cycles are as large or larger, each (n,)."""
    r, n = cycles_of(ranges, counts)
    order = np.argsort(-r, kind="stable")
    return r[order], np.cumsum(n[order])


def level_crossings(series: Any, levels: Any) -> np.ndarray:
    """How often a series rises through each level (k,): from at most the level to above it.

    Source: ASTM E1049-85 (2017), 5.1, with rising crossings counted at every level, below the mean too.
    """
    values, found = finite_series(series), np.asarray(levels, dtype=np.float64)
    order = np.argsort(found, kind="stable")
    rising = values[1:] > values[:-1]
    low = np.searchsorted(found[order], values[:-1][rising], side="left")  # first level not below the start
    high = np.searchsorted(found[order], values[1:][rising], side="left")  # first level not below the end
    steps = np.zeros(found.size + 1)
    np.add.at(steps, low, 1.0)
    np.add.at(steps, high, -1.0)
    crossed = np.empty(found.size)
    crossed[order] = np.cumsum(steps)[:-1]
    return crossed


def load_duration(series: Any, step: float, edges: Any) -> np.ndarray:
    """Seconds that a load (n,), sampled every `step` [s], spends in each bin; a load duration distribution (LDD).

    What lies outside of the edges is not in it. For a shaft the seconds times its speed are revolutions (IEC 61400-4).
    """
    return np.histogram(finite_series(series), bins=_edges(edges))[0] * positive("the time step", step)


def spectrum(series: Any, step: float, segment: float = 100.0) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies [Hz] and the one-sided power spectral density [unit² / Hz] of a load sampled every `step` [s].

    Welch's mean over Hann-windowed segments of `segment` seconds that overlap by half, each less its mean; its integral is the variance
    (Welch, 1967).
    """
    from scipy.signal import welch

    values, dt = finite_series(series), positive("the time step", step)
    samples = min(values.size, max(8, round(positive("the segment", segment) / dt)))
    return welch(values, 1.0 / dt, nperseg=samples)


@dataclass(frozen=True)
class Extreme:
    """The smallest or largest value of a load, and when [s]."""

    value: float
    time: float


def extremes(series: Any, times: Any) -> tuple[Extreme, Extreme]:
    """The smallest and the largest value of a load (n,) with their first times [s] (n,)."""
    values, when = finite_series(series), np.asarray(times, dtype=np.float64)
    if not values.size or values.shape != when.shape:
        raise FatigueInputError(f"a load needs a time for each value, got {values.size} and {when.size}")
    low, high = int(np.argmin(values)), int(np.argmax(values))
    return Extreme(float(values[low]), float(when[low])), Extreme(float(values[high]), float(when[high]))


def _edges(values: Any) -> np.ndarray:
    edges = np.asarray(values, dtype=np.float64)
    if edges.ndim != 1 or edges.size < 2 or not (np.diff(edges) > 0.0).all():
        raise FatigueInputError("edges of bins must rise, two or more of them")
    return edges
