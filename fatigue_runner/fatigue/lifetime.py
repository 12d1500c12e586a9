"""From simulations to a lifetime: the wind climate's bin probabilities and the power sum over bins."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fatigue_runner.errors import did_you_mean
from fatigue_runner.fatigue.checks import FatigueInputError, non_negative, positive

SECONDS_PER_YEAR = 8760.0 * 3600.0

# Reference wind speed V_ref [m/s]; source: IEC 61400-1:2019, table 1.
IEC_REFERENCE_SPEED = {"I": 50.0, "II": 42.5, "III": 37.5}


@dataclass(frozen=True)
class WindClimate:
    """Weibull distribution of the ten-minute mean wind speed, by its mean [m/s] and shape (2 is Rayleigh)."""

    mean_speed: float
    shape: float = 2.0
    name: str = "Weibull"

    def __post_init__(self) -> None:
        positive("the mean wind speed", self.mean_speed)
        positive("the Weibull shape", self.shape)

    @property
    def scale(self) -> float:
        """Weibull scale [m/s], from the mean."""
        return self.mean_speed / math.gamma(1.0 + 1.0 / self.shape)

    def exceedance(self, speed: Any) -> np.ndarray:
        """Probability that the wind speed [m/s] is exceeded, 1 - CDF; same shape as `speed`."""
        return np.exp(-((np.maximum(np.asarray(speed, dtype=np.float64), 0.0) / self.scale) ** self.shape))


def iec_climate(wind_class: str) -> WindClimate:
    """Rayleigh climate of an IEC class, V_ave = 0.2 V_ref. Source: IEC 61400-1:2019, 6.3.2.1."""
    if wind_class not in IEC_REFERENCE_SPEED:
        raise FatigueInputError(
            f"unknown IEC wind class {wind_class!r}{did_you_mean(wind_class, IEC_REFERENCE_SPEED)}"
        )
    return WindClimate(0.2 * IEC_REFERENCE_SPEED[wind_class], name=f"IEC class {wind_class}")


def bin_probabilities(climate: WindClimate, centres: Any, width: float) -> np.ndarray:
    """Probability of each wind-speed bin (n,), from the distribution function, not from the density.

    centres: (n,) [m/s], each bin reaching `width`/2 to both sides; their sum is what they cover, not 1.
    Raises FatigueInputError for bins that overlap, since their wind would count twice.
    """
    v, half = np.atleast_1d(non_negative("bin centres", centres)), 0.5 * positive("the bin width", width)
    gaps = np.diff(np.sort(v))
    if (gaps < 2.0 * half * (1.0 - 1e-9)).any():
        raise FatigueInputError(
            f"bins of width {width:g} m/s overlap: two centres are {gaps.min():g} m/s apart"
        )
    return climate.exceedance(v - half) - climate.exceedance(v + half)


def case_probabilities(climate: WindClimate, speeds: Sequence[float], width: float) -> np.ndarray:
    """Probability of each case (n,): the cases (seeds) of one wind speed [m/s] share their bin's equally."""
    cases = [float(v) for v in speeds]
    seeds = Counter(cases)
    share = dict(zip(seeds, bin_probabilities(climate, list(seeds), width), strict=True))
    return np.array([share[v] / seeds[v] for v in cases])


@dataclass(frozen=True)
class LifetimeLoad:
    """A lifetime damage-equivalent load and how much of the climate it stands for.

    load [unit of the channel], None when every case failed; covered: probability of the cases that were
    counted; lost: probability of those that failed; renormalised: whether `covered` was scaled to 1.
    """

    load: float | None
    exponent: float
    n_eq: float
    years: float
    covered: float
    lost: float
    renormalised: bool

    def __str__(self) -> str:
        load = "no lifetime DEL, all cases failed" if self.load is None else f"lifetime DEL {self.load:.6g}"
        normal = "renormalised to 1" if self.renormalised else "not renormalised"
        return (
            f"{load} (m = {self.exponent:g}, N_eq = {self.n_eq:g}, {self.years:g} years); "
            f"cases cover {self.covered:.4f} of the wind climate, "
            f"{self.lost:.4f} lost to failed cases, {normal}"
        )


def lifetime_equivalent_load(
    loads: Sequence[float | None],
    probabilities: Any,
    m: float,
    n_eq: float = 1e7,
    years: float = 20.0,
    frequency: float = 1.0,
    renormalise: bool = False,
) -> LifetimeLoad:
    """Lifetime DEL of short-term DELs by their power sum, (Σ p_j T f L_jᵐ / n_eq)^(1/m); no mean of DELs.

    loads: (n,) short-term DELs at `frequency` [Hz], None for a case that failed: its probability is reported
    as lost and not handed to the others. probabilities: (n,) of the cases (`case_probabilities`).
    `renormalise` scales those counted to a sum of 1.
    Raises FatigueInputError for NaN or negative values, unequal lengths and probabilities beyond 1 in sum.
    Source: MLife theory manual (NREL, 2012), lifetime equivalent loads; years of 8760 h.
    """
    p = np.atleast_1d(non_negative("probabilities", probabilities))
    if len(loads) != p.size:
        raise FatigueInputError(
            f"one probability per load is needed, got {len(loads)} loads and {p.size} probabilities"
        )
    if p.sum() > 1.0 + 1e-9:
        raise FatigueInputError(
            f"probabilities sum to {p.sum():g}, more than 1; seeds of one bin share its probability"
        )
    done = np.array([load is not None for load in loads], dtype=bool)
    values = non_negative("loads", [load for load in loads if load is not None])
    exponent, cycles = positive("the Wöhler exponent m", m), positive("n_eq", n_eq)
    covered = float(p[done].sum())
    weights = p[done] / covered if renormalise and covered > 0.0 else p[done]
    load = None
    if values.size:
        largest = float(values.max()) or 1.0  # scaled, so that no power overflows
        lifetime = positive("years", years) * SECONDS_PER_YEAR * positive("frequency", frequency)
        load = float(
            largest * (weights @ (values / largest) ** exponent * lifetime / cycles) ** (1.0 / exponent)
        )
    return LifetimeLoad(load, exponent, cycles, float(years), covered, float(p[~done].sum()), renormalise)
