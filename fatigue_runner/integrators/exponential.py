"""Exponential Runge-Kutta methods: the turbine's linear part is integrated exactly, the stages see only the rest.

x' = A x + g(t, x) with A the Jacobian of f about the operating point at `LINEARISED_AT`, averaged over the azimuth: one matrix
per turbine and pitch whatever the case's wind, so that a case's bits do not depend on its block and lanes share the matrices.
Any A keeps the order; a good one takes the stiff shaft and edge motion out of the error and of the stability limit.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine

Array = NDArray[np.float64]

LINEARISED_AT = 8.0  # m/s
_AZIMUTHS = 24


@dataclass(frozen=True)
class ExponentialRungeKutta:
    """Krogstad's method of order 4 with four stages; see `loops_exponential`."""

    name: str
    order: int
    source: str
    evaluations_per_step: int

    @property
    def family(self) -> str:
        return "exponential-runge-kutta"

    @property
    def varying_pitch(self) -> bool:
        return False  # its matrices belong to one pitch

    @property
    def correctable(self) -> bool:
        return False

    def evaluations(self, steps: int) -> int:
        """Of a run of `steps` steps, with the initial slope."""
        return 1 + steps * self.evaluations_per_step

    def growth(self, z: NDArray[np.complex128]) -> Array | None:
        """None: what is linear is exact, so that the rest decides; `stability_limit` tries it out."""
        return None


ETDRK4 = ExponentialRungeKutta(
    "etdrk4", 4,
    "Krogstad (2005), doi:10.1016/j.jcp.2004.08.006, ETDRK4-B, after Cox & Matthews (2002), doi:10.1006/jcph.2002.6995",
    4,
)  # fmt: skip


@lru_cache(maxsize=64)
def linear_part(turbine: Turbine, pitch: float) -> Array:
    """(16, 16) Jacobian of f in the state's own coordinates, averaged over the azimuth.

    Raises InputError where the turbine has no operating point at `LINEARISED_AT` and this pitch [rad].
    """
    base = turbine.operating_point(LINEARISED_AT, pitch=pitch)
    ratio = turbine.parameters["g_ratio"]
    delta = np.array([1e-4, 1e-4, 1e-3, 1e-3, 1e-3, 1e-4, 1e-6, 1e-4] * 2)
    shifts = np.concatenate([np.diag(delta), -np.diag(delta)], axis=1)
    total = np.zeros((16, 16))
    for azimuth in np.arange(_AZIMUTHS) * 2 * np.pi / _AZIMUTHS:
        x = base.copy()
        x[6] += azimuth
        x[7] += ratio * azimuth
        slopes = turbine.rhs(x[:, None] + shifts, LINEARISED_AT, pitch=pitch)
        total += (slopes[:, :16] - slopes[:, 16:]) / (2 * delta) / _AZIMUTHS
    # the shaft feels the twist only: rounding must not let a turned rotor feel its angle
    total[8:, 6] = -ratio * total[8:, 7]
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


@lru_cache(maxsize=256)
def matrices(turbine: Turbine, step: float, pitch: float) -> tuple[Array, ...]:
    """A, then h/2 phi_1(hA/2), h phi_1(hA), h phi_2(hA/2), h phi_2(hA), h phi_3(hA), as `correction.dense` reads them."""
    from fatigue_runner.integrators.correction import pack

    a = linear_part(turbine, pitch)
    half, full = phi_functions(a * step / 2, 2), phi_functions(a * step, 3)
    parts = (a, step / 2 * half[1], step * full[1], step * half[2], step * full[2], step * full[3])
    return tuple(pack(part)[0] for part in parts)
