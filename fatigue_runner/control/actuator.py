"""A pitch actuator of second order between any controller and the blades.

theta'' = omega^2 (theta_c - theta) - 2 zeta omega theta': the blades follow the commanded pitch theta_c with a natural frequency and a
damping ratio. NREL's baseline has none (NREL/TP-500-38060, section 7: "no pitch-actuator dynamics").
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from fatigue_runner.control.submodel import Root, Submodel, Values
from fatigue_runner.layout import DEGREES, PITCH_COMMAND, Channel, FirstOrder

ANGLE, RATE = "pitch_actuator_angle", "pitch_actuator_rate"

_STATES = (
    FirstOrder(Channel(ANGLE, "rad", "pitch of the actuator", "deg", DEGREES), 1e-5),
    FirstOrder(Channel(RATE, "rad/s", "pitch rate of the actuator", "deg/s", DEGREES), 1e-5),
)
PARAMETERS = {
    "act_omega": "natural frequency of the pitch actuator [rad/s]",
    "act_zeta": "its damping ratio [-]",
}


def actuated(controller: Submodel) -> Submodel:
    """The controller with its pitch behind an actuator: two more states, at the end."""

    def outputs(states: Values, p: Values, sqrt: Root) -> dict[str, Any]:
        return controller.outputs(states, p, sqrt) | {"pitch": states[ANGLE]}

    def rates(states: Values, p: Values, sqrt: Root) -> dict[str, Any]:
        behind = controller.outputs(states, p, sqrt)["pitch"] - states[ANGLE]
        pull = p["act_omega"] * (p["act_omega"] * behind - 2 * p["act_zeta"] * states[RATE])
        return controller.rates(states, p, sqrt) | {ANGLE: states[RATE], RATE: pull}

    def read(given: Values, law: Values, pitching: bool) -> dict[str, float]:
        own = given["actuator"]
        return controller.read(given, law, pitching) | {
            "act_omega": own["natural_frequency"],
            "act_zeta": own["damping_ratio"],
        }

    def start(p: Values, speed: float, pitch: float) -> tuple[float, ...]:
        return (*controller.start(p, speed, pitch), pitch, 0.0)

    def observe(states: Values, p: Values) -> dict[str, Any]:
        command = controller.outputs(states, p, np.sqrt)["pitch"]
        return {PITCH_COMMAND.name: command, **controller.observe(states, p)}

    return replace(
        controller,
        name=f"{controller.name}_actuator",
        states=(*controller.states, *_STATES),
        parameters={**controller.parameters, **PARAMETERS},
        outputs=outputs,
        rates=rates,
        read=read,
        start=start,
        signals=(PITCH_COMMAND, *controller.signals),
        observe=observe,
    )
