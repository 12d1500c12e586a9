"""A controller's gains from the turbine: inertia, operating points above rated, and what the pitch does to the power there."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fatigue_runner.control.tuning import Drive, tuned
from fatigue_runner.errors import InputError
from fatigue_runner.turbine.rigid import DESIGNED_AT, USUAL_CUT_OUT, RigidRotor


def designed_gains(
    section: Mapping[str, Any], data: Mapping[str, Any], rotor: RigidRotor
) -> dict[str, float]:
    """The `control` section's gains as its `tuning` wants them, and `wake`, of which sensitivity they are made.

    data: the turbine file's mapping. Raises InputError where the turbine does not reach its power, or loses none by pitching.
    """
    p, tuning = rotor.parameters, section["tuning"]
    speed = section["rated_speed_rpm"] * np.pi / 30 / p["g_ratio"]
    power, fine = p["tg_p"] + p["tg_t"] * speed * p["g_ratio"], float(np.radians(section["fine_pitch_deg"]))
    last = float((data.get("operating_wind") or (0.0, USUAL_CUT_OUT))[1])
    rated = rotor.rated_wind(power, speed, fine)
    if rated is None or not rated < last:
        raise InputError(f"the turbine does not reach its power below {last:g} m/s; give the gains by hand")
    winds = np.linspace(rated, last, DESIGNED_AT)
    found = [rotor.pitch_for(power, float(wind), speed, fine) for wind in winds]
    if None in found:
        raise InputError(
            f"the aerodynamic tables end at {np.degrees(rotor.tables.pitch[-1]):g} deg, below the pitch that {last:g} m/s needs; "
            "make tables with more pitch angles, or give the gains by hand"
        )
    pitch = np.array(found, float)
    airfoils = "airfoils" in data["aerodynamics"]
    wake = tuning["wake"] or ("frozen" if airfoils else "equilibrium")
    if wake == "frozen" and not airfoils:
        raise InputError("wake: frozen needs the airfoils of the blade; use wake: equilibrium")
    if wake == "frozen":
        from fatigue_runner.turbine.table_builder import turbine_blade

        sensitivity = rotor.frozen_sensitivity(turbine_blade(data)[0], winds, speed, pitch)
    else:
        sensitivity = rotor.sensitivity(winds, speed, pitch)
    inertia = 3 * p["b_m2"] + p["h_ixx"] + p["g_i"] * p["g_ratio"] ** 2
    gains = tuned(
        pitch - fine,
        sensitivity,
        Drive(inertia, speed, p["g_ratio"]),
        tuning["natural_frequency"],
        tuning["damping_ratio"],
    )
    return {
        "proportional_gain": gains.proportional,
        "integral_gain": gains.integral,
        "gain_schedule_pitch_deg": float(np.degrees(gains.schedule)),
    }
