"""The fatigue of glass-fibre laminates by a slope and the ultimate strengths: the mean of a cycle counts as its amplitude does.

    amplitude
       |        . (R_t - |R_c|) / 2       N = ( (R_t + |R_c| - |2 g_a S_m - R_t + |R_c||) / (2 g_b S_a) )^m
       |      /   \\
       |    /       \\                     a triangle over the mean stress: with a mean at either strength nothing is left
       |  /           \\                   to swing, half way between them most
       |/_______________\\___ mean
      -|R_c|             R_t
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fatigue_runner.fatigue.checks import FatigueInputError, non_negative, positive

SOURCE = "Germanischer Lloyd, Guideline for the Certification of Wind Turbines (2010), 5.5.3, linear Goodman diagram"
# Slope m without tests of the laminate itself. Source: the same clause.
SLOPES = {"polyester": 9.0, "epoxy": 10.0, "carbon-epoxy": 14.0}


@dataclass(frozen=True)
class Laminate:
    """A laminate under ranges and means of stress, or of strain, in one `unit` with its strengths.

    exponent m; tension R_t and compression |R_c|: characteristic static strengths, both positive; mean_factor and amplitude_factor:
    the partial safety factors g_a and g_b on them, 1 for the characteristic curve.
    """

    name: str
    exponent: float
    tension: float
    compression: float
    mean_factor: float = 1.0
    amplitude_factor: float = 1.0
    source: str = SOURCE
    unit: str = "MPa"

    def __post_init__(self) -> None:
        for what in ("exponent", "tension", "compression", "mean_factor", "amplitude_factor"):
            positive(f"laminate {self.name}: {what}", getattr(self, what))

    @property
    def sees_means(self) -> bool:
        """Whether the mean of a cycle counts."""
        return True

    def thickness_factor(self, thickness: float | None) -> float:
        """1: the strengths are those of the laminate as it is."""
        return 1.0

    def cycles_to_failure(self, ranges: Any, means: Any = None) -> np.ndarray:
        """Cycles N that each range [unit] survives about its mean (0 where none are given), same shape; infinite for 0.

        Raises FatigueInputError where a mean reaches a strength: a static failure.
        """
        s = non_negative("stress ranges", ranges)
        mean = np.zeros_like(s) if means is None else np.asarray(means, dtype=np.float64)
        twice = self.tension + self.compression
        room = twice - np.abs(2.0 * self.mean_factor * mean - self.tension + self.compression)
        if (room <= 0.0).any():
            worst = float(mean.flat[int(np.argmin(room))])
            raise FatigueInputError(
                f"a mean of {worst:g} {self.unit} reaches the strength of the laminate {self.name} (tension {self.tension:g}, "
                f"compression {self.compression:g}, factor {self.mean_factor:g}): static failure; check the section and the unit"
            )
        moved = s > 0.0
        with np.errstate(over="ignore"):
            found = (room / np.where(moved, self.amplitude_factor * s, 1.0)) ** self.exponent
        return np.where(moved, found, np.inf)
