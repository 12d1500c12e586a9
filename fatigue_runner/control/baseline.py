"""The baseline controller of NREL/TP-500-38060, section 7, in continuous time.

Both laws act on the filtered generator speed w_f. Pitch: with e = w_f - rated speed, u = K_P e + K_I (integral of e), limited to u >= 0
by a smooth maximum, the gain schedule theta = u / (1 + theta / theta_K) is solved in closed form. The integral does not run below zero:
what would is pulled back with the rate `unwind`. Torque: regions 1, 1.5, 2, 2.5 and 3 with smooth corners; region 3 holds wherever the
pitch is above `region_3_pitch`, too, as in the DISCON. Left out: the limits of 8 deg/s and 15 kN m/s (the pitch rate is watched).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from pydantic import Field, model_validator

from fatigue_runner.control.section import ControlSection, Positive
from fatigue_runner.control.submodel import Root, Submodel, Values, larger, smaller
from fatigue_runner.inputs.section import problem
from fatigue_runner.layout import RPM, TORQUE_REGION, Channel, FirstOrder

SPEED, INTEGRAL = "filtered_generator_speed", "speed_error_integral"
BELOW_RATED = -1.0  # about where the integral rests below rated [rad]


class BaselineSection(ControlSection):
    """Its keys: gains at fine pitch, speeds of the high-speed side. `turbine/data/nrel5mw.yaml` has them with their units."""

    kind: ClassVar[str] = "baseline"

    rated_speed_rpm: Positive
    proportional_gain: Positive | None = None
    integral_gain: Positive | None = None
    gain_schedule_pitch_deg: Positive | None = None
    filter_frequency_hz: Positive
    cut_in_speed_rpm: Positive
    region_2_speed_rpm: Positive
    largest_torque: Positive
    fine_pitch_deg: float = Field(default=0.0, gt=-45, lt=45)
    region_3_pitch_deg: Positive = 1.0
    region_3_blend_deg: Positive = 0.25
    saturation_blend_deg: Positive = 0.05
    unwind_rate: Positive = 10.0
    unwind_blend: Positive = 0.2
    torque_blend: Positive = 300.0

    @model_validator(mode="after")
    def _rising_speeds(self) -> BaselineSection:
        if not self.cut_in_speed_rpm < self.region_2_speed_rpm < self.rated_speed_rpm:
            raise problem(
                "speeds must rise from cut_in_speed_rpm over region_2_speed_rpm to rated_speed_rpm; "
                f"got {self.cut_in_speed_rpm:g}, {self.region_2_speed_rpm:g}, {self.rated_speed_rpm:g}",
                key="region_2_speed_rpm",
            )
        return self

    @model_validator(mode="after")
    def _gains(self) -> BaselineSection:
        for name in GAINS if self.tuning is None else ():
            if getattr(self, name) is None:
                raise problem("is missing; give it, or `tuning`, from which all gains follow", key=name)
        return self


GAINS = ("proportional_gain", "integral_gain", "gain_schedule_pitch_deg")

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


def _laws(w: Any, p: Values) -> tuple[Any, Any, Any, Any]:
    """Torque of regions 1.5, 2, 2.5 and 3 at a filtered generator speed w."""
    return (
        p["ctl_s15"] * (w - p["ctl_cut_in"]),
        p["ctl_k"] * w * w,
        p["ctl_s25"] * (w - p["ctl_w25"]),
        p["ctl_power"] / w + p["ctl_torque"],
    )


def _beyond_fine(states: Values, p: Values, sqrt: Root) -> Any:
    """Pitch above the fine pitch [rad]: the positive root of theta (1 + theta / theta_K) = u."""
    demand = p["ctl_kp"] * (states[SPEED] - p["ctl_rated"]) + p["ctl_ki"] * states[INTEGRAL]
    u = larger(demand, 0 * demand, p["ctl_u_blend"], sqrt)
    return p["ctl_gk"] / 2 * (sqrt(1 + 4 * u / p["ctl_gk"]) - 1)


def outputs(states: Values, p: Values, sqrt: Root) -> dict[str, Any]:
    """Pitch [rad] and generator torque [N m]."""
    w, blend = states[SPEED], p["ctl_t_blend"]
    beyond = _beyond_fine(states, p, sqrt)
    begin, optimal, slip, rated = _laws(w, p)
    line = smaller(begin, optimal, blend, sqrt)
    below = larger(larger(line, 0 * w, blend, sqrt), slip, blend, sqrt)
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


def start(p: Values, speed: float, pitch: float) -> tuple[float, ...]:
    beyond = pitch - p["ctl_fine"]
    # without pitch control the integral goes its own way: up to where the unwinding holds it, or on and on above rated
    if not beyond > 0 or not p["ctl_ki"]:
        return speed, BELOW_RATED
    return speed, beyond * (1 + beyond / p["ctl_gk"]) / p["ctl_ki"]


def speeds(p: Values) -> tuple[float, float]:
    return 0.9 * p["ctl_cut_in"], p["ctl_rated"]


def observe(states: Values, p: Values) -> dict[str, Any]:
    """The region whose law gives the torque, corners not rounded."""
    begin, optimal, slip, rated = _laws(states[SPEED], p)
    line = np.minimum(begin, optimal)
    region = np.where(begin < optimal, 1.5, 2.0)
    region = np.where(begin <= 0, 1.0, region)
    region = np.where(slip > np.maximum(line, 0), 2.5, region)
    held = _beyond_fine(states, p, np.sqrt) > p["ctl_pitch_3"]
    region = np.where((np.maximum(line, slip) >= rated) | held, 3.0, region)
    return {TORQUE_REGION.name: region}


def read(given: Mapping[str, Any], law: Mapping[str, float], pitching: bool = True) -> dict[str, float]:
    """`PARAMETERS` [SI]; degrees and rpm as the section's names say."""
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


BASELINE = Submodel(
    "baseline", _STATES, PARAMETERS, outputs, rates, read, start, speeds, (TORQUE_REGION,), observe
)
