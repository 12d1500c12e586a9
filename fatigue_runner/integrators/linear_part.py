"""The linear part that exponential methods integrate exactly, and its matrix functions.

x' = A x + g(t, x) with A the Jacobian of f about the operating point at `LINEARISED_AT`, averaged over the azimuth: one matrix
per turbine and pitch whatever the case's wind, so that a case's bits do not depend on its block and lanes share the matrices.
Any A keeps the order; a good one takes the stiff shaft and edge motion out of the error and of the stability limit.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine

Array = NDArray[np.float64]

LINEARISED_AT = 8.0  # m/s
_AZIMUTHS = 24


@lru_cache(maxsize=64)
def linear_part(turbine: Turbine, pitch: float) -> Array:
    """Jacobian of f (size, size) in the state's own coordinates, averaged over the azimuth.

    Raises InputError where the turbine has no operating point at `LINEARISED_AT` and this pitch [rad].
    """
    layout = turbine.layout
    base = turbine.operating_point(LINEARISED_AT, pitch=pitch)
    ratio, size = turbine.gearbox_ratio, layout.size
    delta = np.array(layout.nudges)
    shifts = np.concatenate([np.diag(delta), -np.diag(delta)], axis=1)
    total = np.zeros((size, size))
    for azimuth in np.arange(_AZIMUTHS) * 2 * np.pi / _AZIMUTHS:
        x = base.copy()
        x[layout.rotor] += azimuth
        x[layout.generator] += ratio * azimuth
        slopes = turbine.rhs(x[:, None] + shifts, LINEARISED_AT, pitch=pitch)
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
