"""Gains of the pitch's PI loop from the natural frequency and damping that are wished for.

With a rigid drivetrain of inertia I (low-speed side) and generator torque P / w, the rotor speed under PI control is an oscillator:
NREL/TP-500-38060, eqs. 7-11 to 7-22. K_P = 2 I Omega zeta omega / (N (-dP/dtheta)), K_I = I Omega omega^2 / (N (-dP/dtheta)).
The power's sensitivity to pitch grows with the pitch, -dP/dtheta = S (1 + theta / theta_K), which the gain schedule undoes. Lag of
the filter, bending and the torque's own (negative) damping are left out here, as in the report; the closed loop's poles, with all of
it, are checked afterwards (`turbine.loop`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.errors import InputError

Array = NDArray[np.float64]


class Drive(NamedTuple):
    """inertia [kg m2] of the low-speed side, with the generator's; speed: rated rotor speed [rad/s]; gearbox ratio [-]."""

    inertia: float
    speed: float
    gearbox: float


class Gains(NamedTuple):
    """At fine pitch: proportional [s], integral [-]; schedule: pitch beyond fine at which the sensitivity has doubled [rad]."""

    proportional: float
    integral: float
    schedule: float


def tuned(pitch: Array, sensitivity: Array, drive: Drive, frequency: float, damping: float) -> Gains:
    """Gains for the operating points above rated: pitch beyond fine [rad] and -dP/dtheta [W/rad] there, (n,) each.

    frequency [rad/s] and damping [-] of the loop. The line through the sensitivities has the smallest relative errors, since a gain errs by
    as much. Raises InputError where the power does not fall with the pitch, so that no such loop holds the speed.
    """
    if not np.all(sensitivity > 0):
        at = float(np.degrees(pitch[np.argmin(sensitivity)]))
        raise InputError(f"the power does not fall with the pitch at {at:.3g} deg; give the gains by hand")
    slope, first = np.polyfit(pitch, sensitivity, 1, w=1 / sensitivity)
    if not (first > 0 and slope > 0):
        raise InputError(
            "the power's sensitivity to pitch does not grow from a positive value at fine pitch, as the gain schedule needs; "
            "give the gains by hand"
        )
    common = drive.inertia * drive.speed / (drive.gearbox * first)
    return Gains(2 * damping * frequency * common, frequency**2 * common, float(first / slope))
