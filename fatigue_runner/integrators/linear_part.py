"""The linear part that exponential methods integrate exactly, and its matrix functions.

x' = A x + g(t, x) with A the Jacobian of f about steady operation, averaged over the azimuth. Any A keeps the order; a good one takes
the stiff shaft and edge motion out of the error and of the stability limit. At fixed pitch it is that of `LINEARISED_AT` for every
case. A turbine that operates is another one in each wind: there A belongs to the case's mean wind, to the next whole m/s
(`linearisation_point`), and is the mean over the winds that turbulence brings around it, since a controller's corners (at rated, its
integral at rest below) lie on one side or the other of a single wind. It depends on the case alone, so that its bits do not depend on its
neighbours; lanes that share a point share the matrices (`dense.of_lanes`).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.caches import kept_with
from fatigue_runner.errors import InputError
from fatigue_runner.turbine.turbine import FIXED

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine

Array = NDArray[np.float64]

LINEARISED_AT = 8.0  # m/s
OPERATED = (3, 25)  # m/s: winds in which a turbine under control operates
SPREAD = 0.25  # of the mean wind, to both sides: what A is averaged over under control
_AZIMUTHS = 24


def linearisation_point(turbine: Turbine, speed: float) -> float:
    """The wind [m/s] for whose cases A is made, from a case's mean wind."""
    if turbine.operation == FIXED:
        return LINEARISED_AT
    return float(round(min(max(speed, OPERATED[0]), OPERATED[1])))


@kept_with(64)
def linear_part(turbine: Turbine, pitch: float, point: float = LINEARISED_AT) -> Array:
    """A (size, size) in the state's own coordinates for cases of a `linearisation_point`.

    Raises InputError where the turbine has no operating point there at this pitch [rad].
    """
    if turbine.operation == FIXED:
        return _jacobian(turbine, point, pitch)
    low, high = max((1 - SPREAD) * point, OPERATED[0]), min((1 + SPREAD) * point, OPERATED[1])
    found = []
    for wind in range(math.ceil(low), math.floor(high) + 1):
        try:
            found.append(_jacobian(turbine, float(wind), pitch))
        except InputError:  # a torque law alone has no steady rotation far above rated
            continue
    return np.mean(found, axis=0) if found else _jacobian(turbine, LINEARISED_AT, pitch)


@kept_with(128)
def _jacobian(turbine: Turbine, wind: float, pitch: float) -> Array:
    """Of f about the operating point at one wind [m/s], averaged over the azimuth."""
    layout = turbine.layout
    base = turbine.operating_point(wind, pitch=pitch)
    ratio, size = turbine.gearbox_ratio, layout.size
    delta = np.array(layout.nudges)
    shifts = np.concatenate([np.diag(delta), -np.diag(delta)], axis=1)
    total = np.zeros((size, size))
    for azimuth in np.arange(_AZIMUTHS) * 2 * np.pi / _AZIMUTHS:
        x = base.copy()
        x[layout.rotor] += azimuth
        x[layout.generator] += ratio * azimuth
        slopes = turbine.rhs(x[:, None] + shifts, wind, pitch=pitch)
        total += (slopes[:, :size] - slopes[:, size:]) / (2 * delta) / _AZIMUTHS
    # the shaft feels the twist only: rounding must not let a turned rotor feel its angle
    total[layout.freedoms :, layout.rotor] = -ratio * total[layout.freedoms :, layout.generator]
    return total


def phi_functions(z: Array, count: int) -> list[Array]:
    """phi_0 = exp, ..., phi_count of a matrix z (n, n): phi_k = sum of z^j / (j + k)!.

    From one exponential of an augmented matrix: Al-Mohy & Higham (2011), doi:10.1137/100788860, theorem 2.1.
    """
    from scipy.linalg import expm

    n = len(z)
    augmented = np.zeros(((count + 1) * n, (count + 1) * n))
    augmented[:n, :n] = z
    for k in range(count):
        augmented[k * n : (k + 1) * n, (k + 1) * n : (k + 2) * n] = np.eye(n)
    whole = expm(augmented)
    return [whole[:n, k * n : (k + 1) * n] for k in range(count + 1)]
