"""The wall of a section: stress from two bending moments at every azimuth of a circle, and the damage around it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from fatigue_runner.fatigue.checks import FatigueInputError, positive
from fatigue_runner.fatigue.damage import channel_condition, goodman
from fatigue_runner.fatigue.lifetime import SECONDS_PER_YEAR
from fatigue_runner.fatigue.rainflow import rainflow


class Strength(Protocol):
    """What a wall stands: an S-N curve or a laminate."""

    @property
    def name(self) -> str: ...

    @property
    def source(self) -> str: ...

    @property
    def sees_means(self) -> bool:
        """Whether the mean of a cycle counts."""

    def thickness_factor(self, thickness: float | None) -> float:
        """On the stress of a wall of this thickness [m]."""

    def cycles_to_failure(self, ranges: Any, means: Any = None) -> np.ndarray:
        """Cycles that each range [MPa] about its mean survives."""


@dataclass(frozen=True)
class Circle:
    """A circular section by its outer diameter and wall [m]."""

    diameter: float
    wall: float

    def __post_init__(self) -> None:
        positive("the diameter of a section", self.diameter)
        positive("the wall of a section", self.wall)
        if not 2.0 * self.wall < self.diameter:
            raise FatigueInputError(
                f"a wall of {self.wall:g} m does not fit into a diameter of {self.diameter:g} m"
            )

    @property
    def modulus(self) -> float:
        """Section modulus W = I / (D/2) [m³]."""
        inner = self.diameter - 2.0 * self.wall
        return math.pi / 32.0 * (self.diameter**4 - inner**4) / self.diameter


@dataclass(frozen=True)
class Place:
    """A section of the turbine: the load channels of its two bending moments, and the name of its circle in the turbine's file.

    about_y is positive where the side at azimuth 0 (downwind, or the blade's suction side) is compressed; about_x where that at 90 degrees
    (lateral to the left seen from upwind, or the trailing edge) is stretched: right-handed moments, as OpenFAST's.
    """

    about_y: str
    about_x: str
    circle: str
    label: str


PLACES = {
    "tower_base": Place("tower_base_fore_aft_moment", "tower_base_side_side_moment", "tower_base", "tower base"),
    **{
        f"blade{i}_root": Place(f"blade{i}_root_flapwise_moment", f"blade{i}_root_edgewise_moment", "blade_root", f"blade {i} root")
        for i in (1, 2, 3)
    },
}  # fmt: skip


@dataclass(frozen=True)
class Wall:
    """What is counted at a place: its circle, what its material stands, and factors on the stress.

    stress_concentration: local over nominal stress; safety_factor: the product of the partial factors on load and material;
    ultimate [MPa]: Goodman's correction of every range to a mean of zero, for a strength that does not see means itself; azimuths:
    points around the circle.
    """

    place: Place
    circle: Circle
    strength: Strength
    stress_concentration: float = 1.0
    safety_factor: float = 1.0
    ultimate: float | None = None
    azimuths: int = 24

    @property
    def angles(self) -> np.ndarray:
        """Azimuths of the points [deg], in whole degrees."""
        return np.round(np.arange(self.azimuths) * 360.0 / self.azimuths)

    @property
    def stress_per_moment(self) -> float:
        """Stress [MPa] per bending moment [N.m], with every factor but the safety factor."""
        thickness = self.strength.thickness_factor(self.circle.wall)
        return 1e-6 / self.circle.modulus * thickness * self.stress_concentration

    def damage_per_year(
        self, loads: Mapping[str, np.ndarray], duration: float, residue: str = "half"
    ) -> np.ndarray | None:
        """Miner's sum of a year in which this wind blows all the time, at every azimuth (azimuths,).

        loads: of the case, [N.m]; duration [s] that they last. None where a moment has no fatigue but as a constant.
        Stress at azimuth a: (M_x sin a - M_y cos a) / W; weight and other axial forces are left out.
        """
        y, x = loads[self.place.about_y], loads[self.place.about_x]
        if any(condition not in (None, "constant") for condition in map(channel_condition, (y, x))):
            return None
        scale = self.stress_per_moment * self.safety_factor
        means_count = self.strength.sees_means or self.ultimate is not None
        half = self.azimuths // 2 if not means_count and self.azimuths % 2 == 0 else self.azimuths
        found = np.zeros(self.azimuths)
        for i, angle in enumerate(np.radians(self.angles[:half])):
            stress = (math.sin(angle) * x - math.cos(angle) * y) * scale
            found[i] = self._damage(stress, residue)
        if half < self.azimuths:
            found[half:] = found[:half]  # the opposite side has the same ranges
        return found * (SECONDS_PER_YEAR / duration)

    def _damage(self, stress: np.ndarray, residue: str) -> float:
        ranges, means, counts = rainflow(stress, residue)
        if self.ultimate is not None:
            ranges = goodman(ranges, means, self.ultimate)
        return float(np.sum(counts / self.strength.cycles_to_failure(ranges, means)))
