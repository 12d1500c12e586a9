"""The winds that a controlled turbine is made for: cut-in and cut-out, and the pitch that a wind needs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fatigue_runner.errors import InputError

if TYPE_CHECKING:
    from fatigue_runner.turbine.turbine import Turbine


def check_wind(turbine: Turbine, wind: float) -> str:
    """What a person should know of a mean wind speed [m/s] under the controller; empty where there is nothing, or nobody pitches.

    Winds outside of cut-in to cut-out are allowed: the program neither stops nor starts a turbine. Raises InputError where the
    aerodynamic tables end below the pitch that this wind needs.
    """
    control, controller = turbine.control, turbine.controller
    if not turbine.pitches or control is None or controller is None:
        return ""
    low, high = np.degrees(turbine.pitch_range)
    fine = control["fine_pitch_deg"]
    if not low - 1e-9 <= fine <= high + 1e-9:
        raise InputError(
            f"turbine {turbine.name}: its fine pitch of {fine:g} deg is outside the aerodynamic tables ({low:g} to {high:g} deg); "
            "change `fine_pitch_deg` of its control, or make tables that reach there"
        )
    if turbine.needed_pitch(wind) is None:
        most = max(
            (v for v in np.arange(1.0, wind, 0.1) if turbine.needed_pitch(float(v)) is not None), default=0.0
        )
        raise InputError(
            f"turbine {turbine.name}: its aerodynamic tables end at {high:g} deg pitch, below what {wind:g} m/s needs; "
            f"make tables with more pitch angles, or use winds up to {most:.3g} m/s"
        )
    if turbine.operating_wind is None:
        return ""
    low_wind, high_wind = turbine.operating_wind
    if wind > high_wind:
        return (
            f"{wind:g} m/s is above the cut-out wind of {turbine.name} ({high_wind:g} m/s): no shutdown is simulated, the loads are "
            "those of a turbine that goes on running"
        )
    if wind < low_wind:
        return (
            f"{wind:g} m/s is below the cut-in wind of {turbine.name} ({low_wind:g} m/s): no standstill is simulated, the loads are "
            "those of a turbine that goes on running"
        )
    return ""
