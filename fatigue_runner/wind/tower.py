"""The tower in the blades' way: any wind with the tower's influence as harmonics of the same sum.

Potential flow around a cylinder, AeroDyn's baseline (`profiles.tower_deficit`): the wind in front of the tower is slowed by a share that
depends on the place alone, so that it is a fixed set of azimuthal amplitudes times the disc's wind of the moment.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np

from fatigue_runner.errors import InputError
from fatigue_runner.layout import HARMONICS, WIND, Channel, harmonic_channels
from fatigue_runner.rotor import Rotor
from fatigue_runner.wind.around import WindAround
from fatigue_runner.wind.azimuthal_spectrum import DEFAULT_HARMONICS
from fatigue_runner.wind.constant import ConstantWind
from fatigue_runner.wind.mean_shear import checked_harmonics, radial_rule
from fatigue_runner.wind.profiles import LinearShear, Tower, tower_amplitudes


@dataclass(frozen=True)
class TowerInfluence(WindAround):
    """`wind`, and what the tower takes from it where a blade passes, as potential flow; of the turbine that it blows on.

    order: azimuthal harmonics that hold it (None: those of the wind, or 6 where it has fewer than 2). The deficit is narrow: cut off
    at M harmonics it is spread over 1/M of a turn, with the right amount in each harmonic. Its mean over a turn is taken from the disc's
    wind. Raises InputError for a turbine without tower diameters, and where a blade would meet the tower.
    """

    kind = "tower-influence"

    order: int | None = None
    rotor: Rotor | None = None

    def __post_init__(self) -> None:
        if self.order is not None and checked_harmonics("tower influence", self.order) < 2:
            raise InputError(f"tower influence: give 2 harmonics or more, got {self.order}")
        if self.wind.kind == "misaligned":
            raise InputError(
                "tower influence: the wind is turned last; give MisalignedWind(TowerInfluence(wind), ...)"
            )
        if self.rotor is not None:
            _ = self._shares

    @classmethod
    def example(cls) -> TowerInfluence:
        tower = ((0.0, 6.0), (87.6, 3.87))
        return cls(
            ConstantWind(8.0, 0.14), 6, Rotor(63.0, 90.0, apex=-5.0, tilt=-0.087, cone=-0.044, tower=tower)
        )

    @property
    def channels(self) -> tuple[Channel, ...]:
        own = (c for c in self.wind.channels if c not in HARMONICS)
        return (*own, *harmonic_channels(self.harmonics))

    def on(self, rotor: Rotor) -> Self:
        return self if self.rotor is not None else replace(self, wind=self.wind.on(rotor), rotor=rotor)

    @property
    def harmonics(self) -> int:
        own = self.wind.harmonics if self.wind.harmonics > 1 else DEFAULT_HARMONICS
        return max(own if self.order is None else self.order, self.wind.harmonics)

    @property
    def name(self) -> str:
        return f"{self.wind.name}-tower"

    @property
    def parameters(self) -> dict[str, Any]:
        return {**self.wind.parameters, "tower_influence": True}

    @property
    def description(self) -> str:
        return f"{self.wind.description}; the tower in the blades' way, potential flow"

    @cached_property
    def _shares(self) -> np.ndarray:
        """Amplitudes c_0, c_1, ... (1 + 2 M,) over the disc's wind."""
        if self.rotor is None:
            raise InputError(
                "tower influence: the wind blows on no turbine yet; give it to a run, or call `on(turbine.rotor)`"
            )
        if not self.rotor.tower:
            raise InputError(
                "tower influence: the turbine's file has no tower diameters; add `diameters` to its `tower` (compare nrel5mw.yaml)"
            )
        rotor = self.rotor
        radii, shares, _ = radial_rule(rotor)
        heights, diameters = zip(*rotor.tower, strict=True)
        shear = LinearShear(float(self.wind.parameters.get("vertical_shear", 0.0)), rotor.radius)
        return tower_amplitudes(
            Tower(heights, diameters), rotor.hub_height, rotor.apex, radii / np.cos(rotor.cone), shares, self.harmonics,
            tilt=rotor.tilt, cone=rotor.cone, profile=shear, yaw=rotor.yaw,
        )  # fmt: skip

    def _cells(self, n_cells: int) -> np.ndarray:
        inner, shares = self.wind._cells(n_cells), self._shares
        out = np.zeros((len(inner), inner.shape[1], self.signals))
        out[:, :, : inner.shape[2]] = inner
        out[:, :, self.signals - 2 * self.harmonics :] += np.multiply.outer(inner[:, :, 0], shares[1:])
        # the shears [m/s] stay what they are
        out[:, :, 0] *= 1 + shares[0]
        out[:, :, 1 : len(WIND)] /= 1 + shares[0]
        return out
