"""Whether a step is short enough for the harmonics of a wind, which come by as often as a blade turns past them."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.errors import InputError

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine
    from fatigue_runner.wind import WindSource

Array = NDArray[np.float64]

LEAST = 2  # steps in a period of the highest harmonic: with fewer it is taken for a slower one
RATIO = 7.5  # tip-speed ratio of a rotor whose speed nobody has given


def longest_step(turbine: Turbine, wind: WindSource, state: Array) -> float:
    """[s] of which a period of the wind's highest harmonic has two; infinite where it has none beyond linear shears.

    state: in which the case starts; its rotor speed counts, or that of tip-speed ratio 7.5 where the rotor stands still.
    """
    return (
        math.inf
        if wind.harmonics < 2
        else 2 * math.pi / (LEAST * wind.harmonics * _speed(turbine, wind, state))
    )


def _speed(turbine: Turbine, wind: WindSource, state: Array) -> float:
    speed = float(state[turbine.layout.rotor_speed])
    return speed if speed > 0 else RATIO * wind.mean_speed / turbine.rotor_radius


def refuse_unresolved(turbine: Turbine, wind: WindSource, state: Array, step: float) -> None:
    """Raises InputError where `step` [s] is above `longest_step`."""
    longest = longest_step(turbine, wind, state)
    if step <= longest:
        return
    speed = _speed(turbine, wind, state)
    held = math.floor(2 * math.pi / (LEAST * step * speed))
    fewer = f"at most {held} harmonics, or " if held > 1 else "1 harmonic, or "
    raise InputError(
        f"wind {wind.name} has {wind.harmonics} azimuthal harmonics, but at {speed * 30 / math.pi:.3g} rpm a step of {step * 1e3:g} ms has "
        f"fewer than {LEAST} steps in a period of the highest; take {fewer}a step of at most {math.floor(longest * 1e3):d} ms"
    )
