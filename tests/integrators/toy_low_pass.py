"""A state of first order behind the turbine's own: the rotor speed through a low-pass, x' = (rotor_speed - x) / T."""

from __future__ import annotations

from typing import Any

import numpy as np

from fatigue_runner.layout import Channel, FirstOrder

TIME_CONSTANT = 0.3  # s

STATE = FirstOrder(Channel("slow_rotor_speed", "rad/s", "rotor speed through a low-pass", "rpm"))


def rates(symbol):
    """Slopes by name of the state, for `derivation.printer.Submodel`."""
    return {STATE.signal.name: (symbol["rotor_speed"] - symbol[STATE.signal.name]) / TIME_CONSTANT}


def answer(time: np.ndarray, speed: np.ndarray, start: float) -> np.ndarray:
    """The state at `time` (n,) [s] from `start`, driven by the rotor speed (n,) through which a cubic spline goes.

    Behind a cubic u the state is the sum of (-T)^k times its k-th derivatives, and what fades.
    """
    from scipy.interpolate import CubicSpline

    spline: Any = CubicSpline(time, speed)
    begin, end = time[:-1], time[1:]
    followed = [(-TIME_CONSTANT) ** k * np.array([spline(begin, k), spline(end, k)]) for k in range(3)]
    # the third derivative jumps at the samples: that of the piece between them
    followed.append((-TIME_CONSTANT) ** 3 * np.array([6 * spline.c[0]] * 2))
    out = [start]
    for first, last, step in zip(*sum(followed), end - begin, strict=True):
        out.append(last + (out[-1] - first) * np.exp(-step / TIME_CONSTANT))
    return np.array(out)
