"""By which share each part of a blade feels the wind: the radial weight of a blade-effective wind."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.turbine.aerodynamics import STEPS, BladeAerodynamics, strip_loads

# What the weight can be that of; the project's blade-effective wind has that of the root flap moment.
LOADS = ("flap_moment", "thrust", "torque")


class SpanWeight(NamedTuple):
    """radii (n,): r / tip radius, from the hub to the tip; density (n,): linear between, of integral one."""

    radii: np.ndarray
    density: np.ndarray


def span_weight(
    blade: BladeAerodynamics, tip_speed_ratio: float, pitch: float, load: str = "flap_moment"
) -> SpanWeight:
    """Sensitivity of a blade's load to the wind over its span, at one operating point; pitch [rad].

    Strips are independent in blade-element-momentum theory, so the derivative with respect to the wind of the whole
    rotor at fixed rotor speed holds strip by strip. Loads fall to zero at the hub and the tip, as in `rotor_loads`.
    5 MW, tip-speed ratio 7.5: the mean radius is 0.71 for the root flap moment (axis turned with the pitch), 0.63
    for the thrust, 0.67 for the torque; over the operating range it moves by 0.03. Raises InputError for an unknown
    load and where the load does not rise with the wind (stall, feathered blades).
    """
    if load not in LOADS:
        raise InputError(f"span weight: unknown load {load!r}{did_you_mean(load, LOADS)}")
    normal, tangential = _sensitivities(blade, tip_speed_ratio, pitch)
    if load == "flap_moment":
        arm = blade.radius - blade.hub_radius
        values = arm * (np.cos(pitch) * normal + np.sin(pitch) * tangential)
    else:
        values = normal if load == "thrust" else blade.radius * tangential
    radii = np.concatenate([[blade.hub_radius], blade.radius, [blade.tip_radius]]) / blade.tip_radius
    density = np.concatenate([[0.0], values, [0.0]])
    integral = np.trapezoid(density, radii)
    if not integral > 0:
        raise InputError(
            f"span weight: at tip-speed ratio {tip_speed_ratio:g} and pitch {np.degrees(pitch):g} deg "
            f"the {load.replace('_', ' ')} falls when the wind rises; take those of normal operation"
        )
    return SpanWeight(radii, density / integral)


def _sensitivities(
    blade: BladeAerodynamics, tip_speed_ratio: float, pitch: float
) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives of the loads per length, normal and tangential, by the wind; on a common scale, (n,) each.

    Central differences as wide as those of the tables, so that a kink of stall becomes the slope across it.
    """
    step = STEPS["kappa"]
    wind = 1.0 + step * np.array([[1.0], [-1.0]])
    still, angle = np.zeros_like(wind), np.full_like(wind, pitch)
    loads = strip_loads(blade, tip_speed_ratio / wind, angle, still, still, still, still, still)
    normal, tangential = ((wind**2 * load)[0] - (wind**2 * load)[1] for load in loads)
    return normal / (2 * step), tangential / (2 * step)
