"""From simulations to a lifetime: what each case counts for, and the power sum over the cases."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fatigue_runner.fatigue.checks import FatigueInputError, non_negative, positive
from fatigue_runner.fatigue.climate import Climate, bin_probabilities

HOURS_PER_YEAR = 8760.0  # as in IEC 61400-1 and pCrunch; a mean year of 365.25 days would be 0.07 % longer
SECONDS_PER_YEAR = HOURS_PER_YEAR * 3600.0


def case_probabilities(climate: Climate, speeds: Sequence[float], width: float) -> np.ndarray:
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
    lifetime = positive("years", years) * SECONDS_PER_YEAR * positive("frequency", frequency)
    load = (
        float(power_mean(values, weights, exponent) * (lifetime / cycles) ** (1.0 / exponent))
        if values.size
        else None
    )
    return LifetimeLoad(load, exponent, cycles, float(years), covered, float(p[~done].sum()), renormalise)


def power_mean(values: np.ndarray, weights: np.ndarray, m: float) -> Any:
    """(Σ w vᵐ)^(1/m) of values (n,) not negative; weights (n,) give a float, (r, n) an array (r,)."""
    largest = float(values.max(initial=0.0)) or 1.0  # scaled, so that no power overflows
    return largest * (weights @ (values / largest) ** m) ** (1.0 / m)


def resampled(places: Sequence[int], samples: int, seed: int = 0) -> np.ndarray:
    """How often each case is drawn, (samples, n), when the seeds of every bin are drawn anew with replacement.

    places: the bin of each case. Deterministic: the same bins and `seed` give the same draws. One case in a bin is always drawn, so
    that its bin adds no scatter. Source: Efron (1979), the bootstrap, within strata.
    """
    bins = np.asarray(places, dtype=int)
    draw = np.random.default_rng(seed)
    counts = np.empty((samples, bins.size))
    for place in np.unique(bins):
        mine = np.flatnonzero(bins == place)
        counts[:, mine] = draw.multinomial(mine.size, np.full(mine.size, 1.0 / mine.size), size=samples)
    return counts


def interval(values: np.ndarray, confidence: float) -> tuple[float, float]:
    """The percentile interval of bootstrapped figures (samples,): what lies outside of it has 1 - confidence."""
    tail = 50.0 * (1.0 - confidence)
    low, high = np.percentile(values, [tail, 100.0 - tail])
    return float(low), float(high)
