"""Where a case starts: the operating point of its wind, or the paper's initial states."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

INITIAL_STATES = ("operating-point", "paper", "paper-spinning")


def initial_state(turbine: Any, initial: str | Any, wind: Any, pitch: float = 0.0) -> np.ndarray:
    """State (size,) at t = 0 in the order of the turbine's layout for a wind source; pitch [rad].

    `operating-point` is that of the wind's mean speed along the nacelle's axis and its shears. `paper` is the literal state of
    arXiv:2504.05493: all zero but a rotor azimuth of pi/3, which leaves the generator 60 degrees behind
    and winds the shaft up. `paper-spinning` is what was probably meant, since it fits the paper's
    figure: the rotor turns at pi/3 rad/s, the generator with it. A sequence is the state itself, or positions and velocities
    alone. States of first order that are not given begin as `FirstOrder` says.
    Raises InputError where the turbine has no operating point at this wind.
    """
    if initial == "operating-point":
        label = wind.label
        shears = label.get("vertical_shear") or 0.0, label.get("horizontal_shear") or 0.0
        return np.asarray(turbine.operating_point(wind.axial_speed, *shears, pitch=pitch), dtype=np.float64)
    layout = turbine.layout
    state = np.zeros(layout.size)
    if not isinstance(initial, str):
        state[: len(initial)] = initial
        if len(initial) == layout.size:
            return state
    else:
        state[layout.rotor] = math.pi / 3
    if initial == "paper-spinning":
        generator = turbine.parameters["g_ratio"] * math.pi / 3
        state[layout.generator] = generator
        state[layout.rotor_speed] = math.pi / 3
        state[layout.generator_speed] = generator
    for own in layout.first_order:
        if own.follows:
            state[layout.row(own.signal.name)] = state[layout.row(own.follows)]
    return state
