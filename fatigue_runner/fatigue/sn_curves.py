"""S-N curves: the number of cycles N that a stress range S survives, as data with their sources.

    log S
      |\\                       N = a_i / S^(m_i) on each branch:
      | \\  m_1                 log N = log a_i - m_i log S
      |  \\
      |   o knee 1 (N given)
      |     ` .  m_2           linear:   one branch
      |         ` .            bilinear: two branches, one knee
      |             o- - - -   cut-off:  ranges below it do no damage
      |__________________________ log N

To add a curve, add an entry to a table below, or `register` one; the tests pick it up.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from fatigue_runner.errors import did_you_mean
from fatigue_runner.fatigue.checks import FatigueInputError, non_negative

# Standards round log a to three decimals, which opens steps of up to 0.1 % in stress at the knees.
KNEE_TOLERANCE = 2e-3


@dataclass(frozen=True)
class SNCurve:
    """A piecewise log-linear S-N curve, checked when made.

    exponents m_i, log10 intercepts log a_i (of N) and, between them, the knees [cycles]; ranges below
    `cutoff` do no damage. Ranges, not amplitudes, in `unit`. Plates thicker than `reference_thickness` [m] are weaker, see
    `thickness_factor`.
    """

    name: str
    exponents: tuple[float, ...]
    log_intercepts: tuple[float, ...]
    source: str
    knees: tuple[float, ...] = ()
    cutoff: float = 0.0
    unit: str = "MPa"
    thickness_exponent: float = 0.0
    reference_thickness: float = 0.025

    def __post_init__(self) -> None:
        sizes = len(self.exponents), len(self.log_intercepts), len(self.knees) + 1
        if len(set(sizes)) > 1 or sizes[0] == 0:
            raise FatigueInputError(
                f"S-N curve {self.name}: one log intercept per exponent and one knee between two, got "
                f"{sizes[0]} exponents, {sizes[1]} intercepts and {len(self.knees)} knees"
            )
        if not min(self.exponents) > 0.0 or not self.cutoff >= 0.0:
            raise FatigueInputError(
                f"S-N curve {self.name}: exponents must be above zero and the cut-off not negative: a curve falls, got "
                f"{', '.join(f'{m:g}' for m in self.exponents)}"
            )
        if list(self.knees) != sorted(set(self.knees)):
            raise FatigueInputError(f"S-N curve {self.name}: knees must grow, got {self.knees}")
        for i, knee in enumerate(self.knees):
            before, after = self._branch_range(i, knee), self._branch_range(i + 1, knee)
            if abs(after / before - 1.0) > KNEE_TOLERANCE:
                raise FatigueInputError(
                    f"S-N curve {self.name}: the branches do not meet at N = {knee:g}: "
                    f"{before:.4g} and {after:.4g} {self.unit}"
                )

    def _branch_range(self, i: int, cycles: float) -> float:
        return 10.0 ** ((self.log_intercepts[i] - math.log10(cycles)) / self.exponents[i])

    @classmethod
    def through(
        cls,
        name: str,
        stress: float,
        cycles: float,
        exponents: tuple[float, ...],
        source: str,
        knees: tuple[float, ...] = (),
        cutoff_cycles: float = math.inf,
        unit: str = "MPa",
        thickness_exponent: float = 0.0,
    ) -> SNCurve:
        """Continuous curve whose first branch passes (`stress`, `cycles`), cut off at `cutoff_cycles`."""
        if not min(exponents, default=0.0) > 0.0:
            raise FatigueInputError(
                f"S-N curve {name}: exponents must be above zero: a curve falls, got {list(exponents)}"
            )
        if len(knees) != len(exponents) - 1:
            raise FatigueInputError(
                f"S-N curve {name}: one knee between two exponents, got {len(exponents)} exponents and {len(knees)} knees"
            )
        log_a = [math.log10(cycles) + exponents[0] * math.log10(stress)]
        for m, following, knee in zip(exponents, exponents[1:], knees, strict=False):
            log_a.append(math.log10(knee) + following * (log_a[-1] - math.log10(knee)) / m)
        curve = cls(name, exponents, tuple(log_a), source, knees, unit=unit)
        cutoff = curve.stress_range(cutoff_cycles)
        return cls(name, exponents, tuple(log_a), source, knees, cutoff, unit, thickness_exponent)

    def thickness_factor(self, thickness: float | None) -> float:
        """What the stress of a plate of this thickness [m] is multiplied with: (t / t_ref)^k above the reference, else 1.

        Source: DNVGL-RP-C203 (April 2016), 2.4.3 with t_ref = 25 mm; EN 1993-1-9:2005, tables 8.3 and 8.4, as k_s = (25 mm / t)^0.2 on the
        strength of transverse butt welds.
        """
        if thickness is None or thickness <= self.reference_thickness:
            return 1.0
        return (thickness / self.reference_thickness) ** self.thickness_exponent

    def stress_range(self, cycles: float) -> float:
        """Range [unit] that survives `cycles`; the cut-off, or 0, for infinitely many."""
        branch = int(np.searchsorted(self.knees, cycles, side="left"))
        return max(self.cutoff, self._branch_range(branch, cycles)) if math.isfinite(cycles) else self.cutoff

    @property
    def sees_means(self) -> bool:
        """Whether the mean of a cycle counts; welds keep their own stresses, so that it does not."""
        return False

    def cycles_to_failure(self, ranges: Any, means: Any = None) -> np.ndarray:
        """Cycles N that each range [unit] survives, same shape; infinite for 0 and below the cut-off. The means do not count."""
        s = non_negative("stress ranges", ranges)
        knee_ranges = np.array([self._branch_range(i, knee) for i, knee in enumerate(self.knees)])
        branch = np.sum(s[..., None] < knee_ranges, axis=-1)
        damaging = (s > 0.0) & (s >= self.cutoff)
        m, log_a = np.array(self.exponents)[branch], np.array(self.log_intercepts)[branch]
        log_n = np.where(damaging, log_a - m * np.log10(np.where(damaging, s, 1.0)), np.inf)
        with np.errstate(over="ignore"):  # a range of next to nothing survives for ever
            return 10.0**log_n


SN_CURVES: dict[str, SNCurve] = {}


def register(curve: SNCurve) -> SNCurve:
    """Make `curve` known by its name; a name that is taken is refused."""
    if curve.name in SN_CURVES:
        raise FatigueInputError(f"S-N curve {curve.name!r} exists already ({SN_CURVES[curve.name].source})")
    SN_CURVES[curve.name] = curve
    return curve


def sn_curve(name: str) -> SNCurve:
    """The S-N curve of that name; FatigueInputError with the nearest known name otherwise."""
    if name not in SN_CURVES:
        raise FatigueInputError(f"unknown S-N curve {name!r}{did_you_mean(name, SN_CURVES)}")
    return SN_CURVES[name]


# Welded steel, MPa, mean minus two standard deviations of log N, plates up to the reference thickness of 25 mm.
# Class: (m_1, log a_1 in air, log a_2, log a_1 in seawater with cathodic protection, log a in seawater
# under free corrosion, thickness exponent k). m_2 = 5 beyond 1e7 cycles in air and 1e6 with protection; m = 3 under free corrosion.
# (Later editions turn B1 to C2 at 5e6 cycles and give C, C1, C2 the slope 3.5.)
DNV = "DNVGL-RP-C203 (April 2016), table 2-{}"
DNV_RP_C203 = {
    "b1": (4.0, 15.117, 17.146, 14.917, 12.436, 0.0),
    "b2": (4.0, 14.885, 16.856, 14.685, 12.262, 0.0),
    "c": (3.0, 12.592, 16.320, 12.192, 12.115, 0.05),
    "c1": (3.0, 12.449, 16.081, 12.049, 11.972, 0.10),
    "c2": (3.0, 12.301, 15.835, 11.901, 11.824, 0.15),
    "d": (3.0, 12.164, 15.606, 11.764, 11.687, 0.20),
    "e": (3.0, 12.010, 15.350, 11.610, 11.533, 0.20),
    "f": (3.0, 11.855, 15.091, 11.455, 11.378, 0.25),
    "f1": (3.0, 11.699, 14.832, 11.299, 11.222, 0.25),
    "f3": (3.0, 11.546, 14.576, 11.146, 11.068, 0.25),
    "g": (3.0, 11.398, 14.330, 10.998, 10.921, 0.25),
    "w1": (3.0, 11.261, 14.101, 10.861, 10.784, 0.25),
    "w2": (3.0, 11.107, 13.845, 10.707, 10.630, 0.25),
    "w3": (3.0, 10.970, 13.617, 10.570, 10.493, 0.25),
}


def _dnv(
    name: str, table: int, exponents: tuple[float, ...], log_a: tuple[float, ...], k: float, *knees: float
) -> None:
    register(SNCurve(name, exponents, log_a, DNV.format(table), knees, thickness_exponent=k))


for _class, (_m, _air, _second, _protected, _free, _k) in DNV_RP_C203.items():
    _dnv(f"dnv-{_class}-air", 1, (_m, 5.0), (_air, _second), _k, 1e7)
    _dnv(f"dnv-{_class}-seawater-protected", 2, (_m, 5.0), (_protected, _second), _k, 1e6)
    _dnv(f"dnv-{_class}-seawater-free", 4, (3.0,), (_free,), _k)

# Welded steel, direct stress, MPa: the category is the range at 2e6 cycles; m = 3 to 5e6, 5 to the cut-off.
EN_CATEGORIES = (160, 140, 125, 112, 100, 90, 80, 71, 63, 56, 50, 45, 40, 36)
for _category in EN_CATEGORIES:
    register(
        SNCurve.through(
            f"ec3-{_category}",
            float(_category),
            2e6,
            exponents=(3.0, 5.0),
            source="EN 1993-1-9:2005, 7.1 and figure 7.1",
            knees=(5e6,),
            cutoff_cycles=1e8,
        )
    )
