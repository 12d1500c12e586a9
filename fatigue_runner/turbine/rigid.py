"""The rotor as its tables have it, rigid and straight to a uniform wind: which pitch holds a power, and how power answers to pitch.

Close to the operating points of the whole model, and found at once: where searches begin, and what gains are designed from.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.turbine.tables import AeroTables

Array = NDArray[np.float64]

USUAL_CUT_OUT = 25.0  # m/s, where a turbine file does not say
DESIGNED_AT = 15  # operating points above rated


@dataclass(frozen=True, eq=False)
class RigidRotor:
    """parameters: `parameter_names.PARAMETERS`, at zero pitch."""

    parameters: Mapping[str, float]
    tables: AeroTables

    @cached_property
    def _torque(self) -> Any:
        return self._spline("torque")

    @cached_property
    def _thrust(self) -> Any:
        return self._spline("thrust")

    def _spline(self, load: str) -> Any:
        """Over tip-speed ratio and pitch; None where there is one pitch only."""
        from scipy.interpolate import RectBivariateSpline

        pitches = len(self.tables.pitch)
        if pitches == 1:
            return None
        values = self.tables.coefficients[load] * self.parameters["cos_cone"]
        return RectBivariateSpline(
            self.tables.tip_speed_ratio, self.tables.pitch, values, kx=3, ky=min(3, pitches - 1)
        )

    def _coefficient(self, load: str, ratio: Array, pitch: Any) -> Array:
        spline = {"torque": self._torque, "thrust": self._thrust}[load]
        if spline is None:
            values = self.tables.coefficients[load][:, 0] * self.parameters["cos_cone"]
            return np.interp(ratio, self.tables.tip_speed_ratio, values)
        return np.asarray(spline.ev(ratio, pitch))

    def _blown(self, wind: Any, speed: Any) -> tuple[Array, Array]:
        """Wind along the shaft and tip-speed ratio."""
        along = np.asarray(wind, float) * self.parameters["cos_tilt"]
        ratio = np.asarray(speed, float) * self.parameters["radius"] / along
        return along, np.clip(ratio, self.tables.tip_speed_ratio[0], self.tables.tip_speed_ratio[-1])

    def power(self, wind: Any, speed: Any, pitch: Any) -> Array:
        """Shaft power [W]; wind [m/s], rotor speed [rad/s], pitch [rad] broadcast."""
        along, ratio = self._blown(wind, speed)
        q = self.parameters["q_area"] * along**2 * self.parameters["radius"] * np.asarray(speed, float)
        return q * self._coefficient("torque", ratio, pitch)

    def thrust(self, wind: Any, speed: Any, pitch: Any) -> Array:
        """Along the shaft [N]; arguments as for `power`."""
        along, ratio = self._blown(wind, speed)
        return self.parameters["q_area"] * along**2 * self._coefficient("thrust", ratio, pitch)

    def sensitivity(self, wind: Array, speed: float, pitch: Array) -> Array:
        """-dP/dtheta [W/rad], the wake in equilibrium with the new pitch, (n,)."""
        along, ratio = self._blown(wind, speed)
        q = self.parameters["q_area"] * along**2 * self.parameters["radius"] * speed
        return -q * self._torque.ev(ratio, pitch, dy=1)

    def frozen_sensitivity(self, blade: Any, wind: Array, speed: float, pitch: Array) -> Array:
        """The same with the wake as it was, (n,): blade elements of `aerodynamics.BladeAerodynamics`."""
        from fatigue_runner.turbine.aerodynamics import frozen_power_slope

        along, ratio = self._blown(wind, speed)
        return -self.parameters["q_area"] * along**3 * frozen_power_slope(blade, ratio, pitch)

    def pitch_for(self, power: float, wind: float, speed: float, fine: float) -> float | None:
        """Smallest pitch from `fine` on at which the wind gives no more than this power; None where the tables end before."""
        pitches = np.linspace(fine, max(float(self.tables.pitch[-1]), fine), 400)
        surplus = self.power(wind, speed, pitches) - power
        found = np.flatnonzero(surplus <= 0)
        if not len(found):
            return None
        i = int(found[0])
        if i == 0:
            return fine
        share = surplus[i - 1] / (surplus[i - 1] - surplus[i])
        return float(pitches[i - 1] + share * (pitches[i] - pitches[i - 1]))

    def rated_wind(self, power: float, speed: float, fine: float) -> float | None:
        """Wind [m/s] at which this power is reached at this speed and fine pitch; None where no wind up to 40 m/s gives it."""
        winds = np.linspace(3.0, 40.0, 1481)
        reached = np.flatnonzero(self.power(winds, speed, fine) >= power)
        return float(winds[reached[0]]) if len(reached) else None
