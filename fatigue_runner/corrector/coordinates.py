"""States and accelerations in the coordinates that maps see: the shaft's twist for the generator's angle, blades in multi-blade form.

Numpy's form of what integrators/correction.py and integrators/exponential_adams.py compile.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.corrector.features import (
    FREEDOMS,
    GENERATOR,
    GENERATOR_SPEED,
    PART_BLADES,
    RELATIVE_BLADES,
    ROTOR,
    ROTOR_SPEED,
    STATE_BLADES,
)
from fatigue_runner.integrators import multi_blade
from fatigue_runner.layout import T2B1I1CG

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine

Array = NDArray[np.float64]
_TURN = multi_blade.transforms(T2B1I1CG)

Turn = tuple[Array, Array]  # cosine and sine (n,) of the azimuth


def turn_of(x: Array) -> Turn:
    """The turn of the rotor in states (n, states)."""
    azimuth = x[:, ROTOR]
    return np.cos(azimuth), np.sin(azimuth)


def relative(x: Array, ratio: float) -> Array:
    """(n, states - 1) deflections, shaft twist, rates, rate of the twist of states (n, states); ratio: of the gearbox."""
    twist = x[:, ROTOR] - x[:, GENERATOR] / ratio
    rate = x[:, ROTOR_SPEED] - x[:, GENERATOR_SPEED] / ratio
    return np.concatenate(
        [x[:, :ROTOR], twist[:, None], x[:, FREEDOMS:GENERATOR_SPEED], rate[:, None]], axis=1
    )


def accelerations(turbine: Turbine, x: Array, wind: Array) -> Array:
    """(n, freedoms) of states (n, states) under wind (n, signals), the twist's in place of the generator's."""
    from fatigue_runner.turbine.lanes import evaluate

    slope = evaluate(turbine.kernel_data(0.0), np.ascontiguousarray(x.T), np.ascontiguousarray(wind.T))[0].T
    out = slope[:, FREEDOMS:].copy()
    out[:, GENERATOR] = slope[:, ROTOR_SPEED] - slope[:, GENERATOR_SPEED] / turbine.parameters["g_ratio"]
    return np.asarray(out)


def nonlinear_part(turbine: Turbine, x: Array, wind: Array, damping: float) -> Array:
    """(n, freedoms) accelerations without their linear part; damping [1/s]: see `multi_blade.linear`."""
    ratio = turbine.parameters["g_ratio"]
    linear = relative(x, ratio) @ multi_blade.linear(turbine, 0.0, damping).low.T
    return np.asarray(accelerations(turbine, x, wind) - linear)


def _turned(values: Array, first: tuple[int, ...], turn: Turn, sign: int) -> Array:
    """Cosine and sine parts of the blades' columns turned by the azimuth (sign 1) or back (-1)."""
    cosine, sine = turn[0], sign * turn[1]
    out = values.copy()
    for i in first:
        out[:, i + 1] = cosine * values[:, i + 1] - sine * values[:, i + 2]
        out[:, i + 2] = sine * values[:, i + 1] + cosine * values[:, i + 2]
    return out


def from_fixed(change: Array, turn: Turn) -> Array:
    """(n, states) changes of the state from multi-blade coordinates."""
    return np.asarray(_turned(change, STATE_BLADES, turn, -1) @ np.linalg.inv(_TURN.state).T)


def to_fixed(change: Array, turn: Turn) -> Array:
    """(n, states) changes of the state in multi-blade coordinates."""
    return _turned(change @ _TURN.state.T, STATE_BLADES, turn, 1)


def relative_to_fixed(values: Array, turn: Turn) -> Array:
    """(n, states - 1) relative coordinates in multi-blade form."""
    return _turned(values @ _TURN.relative.T, RELATIVE_BLADES, turn, 1)


def parts_to_fixed(parts: Array, turn: Turn) -> Array:
    """(n, freedoms) nonlinear parts in multi-blade form."""
    return _turned(parts @ _TURN.parts.T, PART_BLADES, turn, 1)
