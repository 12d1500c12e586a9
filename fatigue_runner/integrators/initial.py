"""Where a case starts: the operating point of its wind, or the paper's initial states."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

INITIAL_STATES = ("operating-point", "paper", "paper-spinning")


def initial_state(turbine: Any, initial: str | Any, wind: Any, pitch: float = 0.0) -> np.ndarray:
    """State (size,) at t = 0 in the order of the turbine's layout for a wind source; pitch [rad].

    `operating-point` is that of the wind's mean speed and shears. `paper` is the literal state of
    arXiv:2504.05493: all zero but a rotor azimuth of pi/3, which leaves the generator 60 degrees behind
    and winds the shaft up. `paper-spinning` is what was probably meant, since it fits the paper's
    figure: the rotor turns at pi/3 rad/s, the generator with it; states of first order begin at zero in both. A sequence is the
    state itself.
    Raises InputError where the turbine has no operating point at this wind.
    """
    if not isinstance(initial, str):
        return np.array(initial, dtype=np.float64)
    if initial == "operating-point":
        label = wind.label
        shears = label.get("vertical_shear") or 0.0, label.get("horizontal_shear") or 0.0
        return np.asarray(turbine.operating_point(wind.mean_speed, *shears, pitch=pitch), dtype=np.float64)
    layout = turbine.layout
    state = np.zeros(layout.size)
    state[layout.rotor] = math.pi / 3
    if initial == "paper-spinning":
        generator = turbine.parameters["g_ratio"] * math.pi / 3
        state[layout.generator] = generator
        state[layout.rotor_speed] = math.pi / 3
        state[layout.generator_speed] = generator
        # a filter that has followed for long shows the speed itself
        if "filtered_generator_speed" in layout.names:
            state[layout.row("filtered_generator_speed")] = generator
    return state
