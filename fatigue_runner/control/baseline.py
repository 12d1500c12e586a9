"""The baseline controller of NREL/TP-500-38060, section 7, in continuous time.

Both laws act on the filtered generator speed w_f. Pitch: with e = w_f - rated speed, u = K_P e + K_I (integral of e), limited to u >= 0
by a smooth maximum, the gain schedule theta = u / (1 + theta / theta_K) is solved in closed form. The integral does not run below zero:
what would is pulled back with the rate `unwind`. Torque: regions 1, 1.5, 2, 2.5 and 3 with smooth corners; region 3 holds wherever the
pitch is above `region_3_pitch`, too, as in the DISCON. Left out: the limits of 8 deg/s and 15 kN m/s (the pitch rate is watched).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from fatigue_runner.control.submodel import Root, Submodel, Values, larger, smaller
from fatigue_runner.layout import RPM, Channel, FirstOrder

SPEED, INTEGRAL = "filtered_generator_speed", "speed_error_integral"

# where steady operation may have the integral: just below zero below rated; above, it grows with the pitch that holds the speed
INTEGRALS = (-1.0, 5.0, 15.0, 40.0, 80.0, 120.0, 150.0, 200.0, 250.0)

_STATES = (
    FirstOrder(Channel(SPEED, "rad/s", "filtered generator speed", "rpm", RPM), 1e-3, "generator_speed"),
    FirstOrder(Channel(INTEGRAL, "rad", "integral of the generator's speed error", "rad"), nudge=1e-3),
)

PARAMETERS = {
    "ctl_filter": "corner of the low-pass of the generator speed [rad/s]",
    "ctl_rated": "generator speed that the pitch holds [rad/s]",
    "ctl_kp": "proportional gain at zero pitch [s]",
    "ctl_ki": "integral gain at zero pitch [-]",
    "ctl_gk": "pitch at which the power sensitivity has doubled [rad]",
    "ctl_fine": "fine pitch [rad]",
    "ctl_u_blend": "pitch over which the limit at fine pitch is rounded [rad]",
    "ctl_unwind": "rate at which an integral below zero is pulled back [1/s]",
    "ctl_i_blend": "integral over which that sets in [rad]",
    "ctl_cut_in": "generator speed at which region 1.5 begins [rad/s]",
    "ctl_s15": "slope of region 1.5 [N m s/rad]",
    "ctl_k": "region 2: torque over speed squared [N m s2/rad2]",
    "ctl_s25": "slope of region 2.5 [N m s/rad]",
    "ctl_w25": "speed of zero torque of region 2.5's line [rad/s]",
    "ctl_power": "power of region 3 (constant power) [W]",
    "ctl_torque": "torque of region 3 (constant torque), added to power / speed [N m]",
    "ctl_most": "largest torque [N m]",
    "ctl_t_blend": "torque over which regions blend [N m]",
    "ctl_pitch_3": "pitch beyond fine above which region 3 holds at any speed [rad]",
    "ctl_pitch_blend": "pitch over which that sets in [rad]",
}


def outputs(states: Values, p: Values, sqrt: Root) -> dict[str, Any]:
    """Pitch [rad] and generator torque [N m]."""
    w, blend = states[SPEED], p["ctl_t_blend"]
    demand = p["ctl_kp"] * (w - p["ctl_rated"]) + p["ctl_ki"] * states[INTEGRAL]
    u = larger(demand, 0 * demand, p["ctl_u_blend"], sqrt)
    beyond = p["ctl_gk"] / 2 * (sqrt(1 + 4 * u / p["ctl_gk"]) - 1)
    line = smaller(p["ctl_s15"] * (w - p["ctl_cut_in"]), p["ctl_k"] * w * w, blend, sqrt)
    below = larger(larger(line, 0 * w, blend, sqrt), p["ctl_s25"] * (w - p["ctl_w25"]), blend, sqrt)
    rated = p["ctl_power"] / w + p["ctl_torque"]
    place = (beyond - p["ctl_pitch_3"]) / p["ctl_pitch_blend"]
    step = place / sqrt(1 + place * place)
    share = (2 + step * (3 - step * step)) / 4  # the polynomial cuts the tails of the root off
    torque = smaller(below, rated, blend, sqrt)
    torque = torque + share * (rated - torque)
    return {
        "pitch": p["ctl_fine"] + beyond,
        "generator_torque": smaller(torque, p["ctl_most"], blend, sqrt),
    }


def rates(states: Values, p: Values, sqrt: Root) -> dict[str, Any]:
    w, integral = states[SPEED], states[INTEGRAL]
    back = larger(-integral, 0 * integral, p["ctl_i_blend"], sqrt)
    return {
        SPEED: p["ctl_filter"] * (states["generator_speed"] - w),
        INTEGRAL: w - p["ctl_rated"] + p["ctl_unwind"] * back,
    }


BASELINE = Submodel("baseline", _STATES, PARAMETERS, outputs, rates)


def parameters(given: Mapping[str, Any], law: Mapping[str, float], pitching: bool = True) -> dict[str, float]:
    """`PARAMETERS` from a turbine file's `control` section (SI, degrees and rpm as its names say) and the generator's law
    (`parameters.generator_law`); without `pitching` the blades stay at fine pitch."""
    rpm, degrees = math.pi / 30, math.pi / 180
    cut_in, region_2 = given["cut_in_speed_rpm"] * rpm, given["region_2_speed_rpm"] * rpm
    on = 1.0 if pitching else 0.0
    return {
        "ctl_filter": given["filter_frequency_hz"] * 2 * math.pi,
        "ctl_rated": given["rated_speed_rpm"] * rpm,
        "ctl_kp": on * given["proportional_gain"],
        "ctl_ki": on * given["integral_gain"],
        "ctl_gk": given["gain_schedule_pitch_deg"] * degrees,
        "ctl_fine": given["fine_pitch_deg"] * degrees,
        "ctl_u_blend": on * given["saturation_blend_deg"] * degrees,
        "ctl_unwind": given["unwind_rate"],
        "ctl_i_blend": given["unwind_blend"],
        "ctl_cut_in": cut_in,
        "ctl_s15": law["tg_k"] * region_2**2 / (region_2 - cut_in),
        "ctl_k": law["tg_k"],
        "ctl_s25": law["tg_a2"],
        "ctl_w25": law["tg_ws"],
        "ctl_power": law["tg_p"],
        "ctl_torque": law["tg_t"],
        "ctl_most": given["largest_torque"],
        "ctl_t_blend": law["tg_e"],
        "ctl_pitch_3": given["region_3_pitch_deg"] * degrees,
        "ctl_pitch_blend": given["region_3_blend_deg"] * degrees,
    }
