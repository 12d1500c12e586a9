"""How far two turbines are apart, in words: for what is bound to one of them."""

from __future__ import annotations

from collections.abc import Mapping
from math import sqrt
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from fatigue_runner.turbine.turbine import Turbine

SAME = 1e-4  # relative; below that two figures are one
MOST = 4  # differences that are told


def _figures(turbine: Turbine) -> dict[str, float]:
    """What an engineer tells turbines by, and what their loads follow."""
    p: Mapping[str, float] = turbine.parameters
    top = p["n_m"] + p["h_m"] + 3 * p["b_m"]
    power = turbine.tables.tip_speed_ratio[:, None] * turbine.tables.coefficients["torque"]
    return {
        "rotor radius": turbine.rotor_radius,
        "hub height": turbine.hub_height,
        "blade mass": p["b_m"],
        "rotor inertia": 3 * p["b_m2"] + p["h_ixx"],
        "mass on the tower": top,
        "flap frequency": sqrt(p["b_kf"] / (p["b_fxfx"] + p["b_fyfy"])),
        "edge frequency": sqrt(p["b_ke"] / (p["b_exex"] + p["b_eyey"])),
        "tower frequency": sqrt(p["t_ka"] / (p["t_maa"] + top)),
        "gearbox ratio": p["g_ratio"],
        "largest power coefficient": float(power.max()),
    }


def apart(turbine: Turbine, other: Turbine) -> str:
    """`turbine` as seen from `other`: its largest differences in per cent, or what else differs."""
    own, theirs = _figures(turbine), _figures(other)
    off = {name: own[name] / theirs[name] - 1 for name in own if theirs[name]}
    told = sorted((name for name in off if abs(off[name]) > SAME), key=lambda name: -abs(off[name]))[:MOST]
    if told:
        return ", ".join(f"{name} {100 * off[name]:+.3g} %" for name in told)
    changed = [
        name
        for name, value in turbine.parameters.items()
        if not np.isclose(value, other.parameters.get(name, np.nan), rtol=1e-9, atol=0)
    ]
    if changed:
        return f"{len(changed)} parameters of the equations, {', '.join(changed[:MOST])} among them"
    return "the aerodynamic tables" if turbine.operation == other.operation else "the operation"
