"""Exponential Adams methods: one evaluation a step, the linear part exact, the rest a polynomial through its last values.

x' = A x + g(t, x) with A as for ETDRK4. From g at earlier steps a predictor gives x~ at the step's end, f is evaluated there, and a
corrector integrates the polynomial through that value and the earlier ones (PEC mode: the values at x~ are the ones kept; f = A x + g
takes the distance of x~ from x into account to first order). Weights: Hochbruck & Ostermann (2011), doi:10.1007/s11075-010-9408-y, and
Beylkin, Keiser & Vozovoi (1998), doi:10.1006/jcph.1998.6093, for the implicit ones.

Everything is written in the hub's frame that does not turn (multi-blade, Coleman coordinates at the azimuth of the step's start): there an
isotropic rotor has constant coefficients, and one matrix product makes a predictor or a corrector. A learned correction
(`corrector.exponential_adams`) is another matrix on the same rows.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import factorial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.integrators.exponential import linear_part, phi_functions

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine

Array = NDArray[np.float64]

STARTING = 8  # sub-steps of RK4 in each step before there are enough earlier values
# rows of what a step sees: 1; 15 relative states; wind at start, middle, end; then earlier nonlinear parts, the newest first; the new one
STATE_ROW, WIND_ROW, PAST_ROW = 1, 16, 25
PARTS = 8  # rows of a nonlinear part: accelerations, of the shaft's twist in place of the generator's
MOST_PAST = 4


@dataclass(frozen=True)
class ExponentialAdams:
    """`past` earlier values, this step's included, for the predictor; the corrector has them and the new one."""

    name: str
    order: int
    source: str
    predictor: int
    past: int
    evaluations_per_step: int = 1

    @property
    def family(self) -> str:
        return "exponential-adams"

    @property
    def varying_pitch(self) -> bool:
        return False  # its matrices belong to one pitch

    @property
    def correctable(self) -> bool:
        return True

    def evaluations(self, steps: int) -> int:
        """Of a run of `steps` steps, with the initial slope and the start."""
        return 1 + min(steps, self.past - 1) * 4 * STARTING + steps

    def growth(self, z: NDArray[np.complex128]) -> Array | None:
        """None: what is linear is exact, so that the rest decides; `stability_limit` tries it out."""
        return None


_SOURCE = (
    "exponential Adams-Bashforth-Moulton, PEC; Hochbruck & Ostermann (2011), doi:10.1007/s11075-010-9408-y"
)
ETDABM3 = ExponentialAdams("etdabm3", 3, _SOURCE, 2, 2)
ETDABM4 = ExponentialAdams("etdabm4", 4, _SOURCE, 3, 3)


def base_rows(past: int) -> int:
    """Rows that a corrector sees with `past` earlier nonlinear parts."""
    return PAST_ROW + PARTS * (past + 1)


def to_multi_blade(rows: int, first: tuple[int, ...]) -> Array:
    """(rows, rows) from three blades' rows, which begin at each of `first`, to mean, cosine and sine part at azimuth zero."""
    out = np.eye(rows)
    half, third = np.sqrt(3) / 2, 1 / 3
    block = np.array([[third] * 3, [2 * third, -third, -third], [0.0, 2 * third * half, -2 * third * half]])
    for i in first:
        out[i : i + 3, i : i + 3] = block
    return out


T_STATE, T_RELATIVE, T_PARTS = (
    to_multi_blade(16, (2, 10)),
    to_multi_blade(15, (2, 9)),
    to_multi_blade(8, (2,)),
)


@dataclass(frozen=True)
class Linear:
    """A in relative coordinates (15: deflections, twist, rates, rate of twist): `low` (8, 15) gives the accelerations, that of the
    twist last; `rates` (16, 15) all of A x. `isotropic`: (16, 16) A of the state's own coordinates."""

    low: Array
    rates: Array
    isotropic: Array


@lru_cache(maxsize=64)
def linear(turbine: Turbine, pitch: float, damping: float = 0.0) -> Linear:
    """The linear part as it looks from every azimuth alike, to rounding: what the average leaves of a coupling is dropped.

    damping [1/s]: added to the generator's. The torque law's line of region 2.5 is 5/s steeper than region 2, and with A of region 2
    steps above 0.1 s are unstable there; between the two both are stable (measured), and a learned part makes up for the accuracy.
    """
    ratio = turbine.parameters["g_ratio"]
    own = linear_part(turbine, pitch).copy()
    own[15, 15] -= damping
    a = T_STATE @ own @ np.linalg.inv(T_STATE)
    turning = np.zeros(16, bool)
    turning[[3, 4, 11, 12]] = True
    a[np.ix_(turning, ~turning)] = 0.0
    a[np.ix_(~turning, turning)] = 0.0
    for i in (3, 11):
        for j in (3, 11):
            same, cross = (a[i, j] + a[i + 1, j + 1]) / 2, (a[i, j + 1] - a[i + 1, j]) / 2
            a[i, j] = a[i + 1, j + 1] = same
            a[i, j + 1], a[i + 1, j] = cross, -cross
    a = np.linalg.inv(T_STATE) @ a @ T_STATE
    a[8:, 6] = -ratio * a[8:, 7]
    rates = np.zeros((16, 15))
    rates[:, :6], rates[:, 6] = a[:, :6], -ratio * a[:, 7]
    rates[:, 7:13], rates[:, 13] = a[:, 8:14], a[:, 14] + ratio * a[:, 15]
    rates[:, 14] = -ratio * a[:, 15]
    low = rates[8:].copy()
    low[7] = rates[14] - rates[15] / ratio
    return Linear(low, rates, a)


def _parts_to_state(ratio: float) -> Array:
    """(16, 8): accelerations of the state from a nonlinear part."""
    out = np.zeros((16, 8))
    out[8:15, :7] = np.eye(7)
    out[15, 6:8] = ratio, -ratio
    return out


def weights(a: Array, step: float, nodes: list[int]) -> list[Array]:
    """(16, 16) each: the step's integral of exp((1 - t) h A) g(t), g the polynomial through its values at `nodes` [steps]."""
    count = len(nodes)
    phi = phi_functions(a * step, count)
    powers = np.linalg.inv(np.vander(nodes, count, increasing=True).astype(float))
    return [sum(powers[k, j] * factorial(k) * step * phi[k + 1] for k in range(count)) for j in range(count)]


@lru_cache(maxsize=256)
def matrices(
    turbine: Turbine, method: ExponentialAdams, step: float, pitch: float, past: int, damping: float = 0.0
) -> tuple[Array, Array]:
    """Predictor (16, rows before the new part) and corrector (16, `base_rows`) on the rows of a step, in multi-blade coordinates."""
    line = linear(turbine, pitch, damping)
    spread = _parts_to_state(turbine.parameters["g_ratio"])
    back = np.linalg.inv(T_RELATIVE), np.linalg.inv(T_PARTS)
    rows = base_rows(past)
    state = step * phi_functions(line.isotropic * step, 1)[1] @ line.rates

    def put(nodes: list[int]) -> Array:
        out = np.zeros((16, rows))
        out[:, STATE_ROW:WIND_ROW] = T_STATE @ state @ back[0]
        for node, weight in zip(nodes, weights(line.isotropic, step, nodes), strict=True):
            first = PAST_ROW + PARTS * (past if node == 1 else -node)
            out[:, first : first + PARTS] = T_STATE @ weight @ spread @ back[1]
        return out

    predictor = put([-j for j in range(method.predictor)])[:, : rows - PARTS]
    return np.ascontiguousarray(predictor), put([1, *(-j for j in range(method.past))])


def loop_data(turbine: Turbine, pitch: float, past: int, damping: float = 0.0) -> tuple[Any, ...]:
    """`method` of the compiled loop: A of the accelerations, ratio of the gearbox, earlier parts, RK4 and its sub-steps for the start."""
    from fatigue_runner.integrators.correction import pack
    from fatigue_runner.integrators.kernel_data import runge_kutta_data
    from fatigue_runner.integrators.tableaux import RK4

    low = pack(linear(turbine, pitch, damping).low)[0]
    return low, turbine.parameters["g_ratio"], past, runge_kutta_data(RK4)[:2], STARTING


def network(
    predictors: tuple[Array, Array], correctors: tuple[Array, Array], factors: tuple[int, ...] = ()
) -> tuple[Any, ...]:
    """`network` of the compiled loop: weights of predictor and corrector, those of the plain ones, and the rows that multiply all rows."""
    from fatigue_runner.integrators.correction import pack

    packed = (pack(weights)[0] for weights in (*predictors, *correctors))
    return (*packed, np.array(factors, dtype=np.int64))
