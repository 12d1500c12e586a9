"""Where a turbine whose pitch is fixed leaves what it is made for: its rated speed, and the wind that drives it there."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from fatigue_runner.errors import InputError
from fatigue_runner.layout import Layout

WINDS = (3.0, 25.0)  # m/s, where it is looked for
STEP = 0.5  # m/s


class Turning(Protocol):
    """What is asked here of a `Turbine`."""

    @property
    def control(self) -> Mapping[str, Any] | None: ...

    @property
    def gearbox_ratio(self) -> float: ...

    @property
    def layout(self) -> Layout: ...

    def operating_point(self, wind: float, *, pitch: float = ...) -> np.ndarray: ...


def rated_rotor_speed(turbine: Turning) -> float | None:
    """The rotor speed [rad/s] that the turbine's controller would hold; None where its file has no controller."""
    if turbine.control is None:
        return None
    return float(turbine.control["rated_speed_rpm"]) * math.pi / 30.0 / turbine.gearbox_ratio


def rated_speed_wind(turbine: Turning, pitch: float) -> float | None:
    """The wind [m/s] in which the turbine, at a fixed pitch [rad], turns at its rated speed; None where it does so in none of WINDS.

    By its steady rotation from light winds up, to a tenth of a metre per second: just above there may be none, which takes long to find.
    """
    rated = rated_rotor_speed(turbine)
    if rated is None:
        return None
    low, high = WINDS
    before = None
    for wind in (low + STEP * i for i in range(round((high - low) / STEP) + 1)):
        try:
            speed = float(turbine.operating_point(wind, pitch=pitch)[turbine.layout.rotor_speed])
        except InputError:  # in too little wind it stands still; in too much, nothing holds it
            if before is not None:
                return wind
            continue
        if speed > rated:
            return None if before is None else wind
        slope = 0.0 if before is None else speed - before
        if speed + slope > rated:
            return wind + STEP * (rated - speed) / slope
        before = speed
    return None
