"""Exponential Runge-Kutta methods: the turbine's linear part is integrated exactly, the stages see only the rest (`linear_part`).

Krogstad's stages in terms of f and of differences, so that only displacements within the step meet A:
    a = x + h/2 phi_1(hA/2) f_1                     d_i = f_i - f_1 - A (x_i - x) = g_i - g_1
    b = a + h phi_2(hA/2) d_a                       c = x + h phi_1(hA) f_1 + 2 h phi_2(hA) d_b
    x+ = x + h phi_1(hA) f_1 + h phi_2(hA) (2 d_a + 2 d_b - d_c) + 4 h phi_3(hA) (d_c - d_a - d_b)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.caches import kept_with
from fatigue_runner.compiled import INLINE, LEAN, njit
from fatigue_runner.integrators.choice import compiled_for
from fatigue_runner.integrators.contract import Aligned, Lanes, Prepared, Task
from fatigue_runner.integrators.dense import blocks_of, dense_rows, of_lanes, pack
from fatigue_runner.integrators.linear_part import (
    LINEARISED_AT,
    linear_part,
    linearisation_point,
    phi_functions,
)
from fatigue_runner.integrators.signals import signals_at
from fatigue_runner.integrators.stepper import RING, advance, begin, finish, note, recover
from fatigue_runner.integrators.stepping import add, all_fine, keep
from fatigue_runner.turbine.lane_code import LANES
from fatigue_runner.turbine.model import rhs, rows, width

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ExponentialRungeKutta:
    """Krogstad's method of order 4 with four stages."""

    name: str
    order: int
    source: str
    evaluations_per_step: int

    family = "exponential-runge-kutta"
    varying_pitch = False
    correctable = False

    def evaluations(self, steps: int) -> int:
        """Of a run of `steps` steps, with the initial slope."""
        return 1 + steps * self.evaluations_per_step

    def growth(self, z: NDArray[np.complex128]) -> Array | None:
        """None: what is linear is exact, so that the rest decides; `stability_limit` tries it out."""
        return None

    def prepare(self, task: Task) -> Prepared:
        """See `contract.Method`."""
        padded = blocks_of(task.layout.size) * 8 * LANES

        def arrays(lanes: Lanes, aligned: Aligned) -> ExponentialArrays:
            points = [linearisation_point(task.turbine, speed) for speed in lanes.speeds]
            parts = of_lanes(lambda point: matrices(task.turbine, task.step, task.pitch, point), points)
            return ExponentialArrays(*parts, *(aligned(np.zeros(padded)) for _ in range(9)))

        return Prepared(arrays, RING, self.evaluations)


ETDRK4 = ExponentialRungeKutta(
    "etdrk4", 4,
    "Krogstad (2005), doi:10.1016/j.jcp.2004.08.006, ETDRK4-B, after Cox & Matthews (2002), doi:10.1006/jcph.2002.6995",
    4,
)  # fmt: skip


@kept_with(256)
def matrices(turbine: Turbine, step: float, pitch: float, point: float = LINEARISED_AT) -> tuple[Array, ...]:
    """A at a linearisation point, then h/2 phi_1(hA/2), h phi_1(hA), h phi_2(hA/2), h phi_2(hA), h phi_3(hA), as `dense` reads them."""
    a = linear_part(turbine, pitch, point)
    half, full = phi_functions(a * step / 2, 2), phi_functions(a * step, 3)
    parts = (a, step / 2 * half[1], step * full[1], step * half[2], step * full[2], step * full[3])
    return tuple(pack(part)[0] for part in parts)


class ExponentialArrays(NamedTuple):
    """The matrices of `matrices`, then room (rows in whole blocks of `dense`)."""

    linear: Array
    half1: Array
    full1: Array
    half2: Array
    full2: Array
    full3: Array
    first: Array
    along: Array
    moved: Array
    product: Array
    moved_a: Array
    d_a: Array
    d_b: Array
    d_c: Array
    x: Array


@njit(**LEAN)
def _rest(model, slope, first, product, out):
    """out = slope - first - product, the change of the part that is not linear."""
    for m in range(width(model)):
        out[m] = slope[m] - first[m] - product[m]


@njit(**LEAN)
def _third_stage(model, along, product, moved):
    for m in range(width(model)):
        moved[m] = along[m] + 2.0 * product[m]


@njit(**LEAN)
def _differences(model, d_a, d_b, d_c, moved):
    for m in range(width(model)):
        moved[m] = 2.0 * (d_a[m] + d_b[m]) - d_c[m]
        d_c[m] = 4.0 * (d_c[m] - (d_a[m] + d_b[m]))


@njit(**LEAN)
def _result(model, x, along, product, last, out):
    for m in range(width(model)):
        out[m] = x[m] + (along[m] + (product[m] + last[m]))


@njit(**LEAN)
def _copy_line(model, table, line, out):
    for m in range(width(model)):
        out[m] = table[line, m]


@compiled_for(begin, ExponentialArrays)
@njit(**INLINE)
def _begin(method, model, h, signals, data, ring):
    rhs(model, ring.restart, signals.p, signals.u, method.first, 0, data)
    keep(model, method.first, ring.k, 0)


@compiled_for(recover, ExponentialArrays)
@njit(**INLINE)
def _recover(method):
    pass


@compiled_for(advance, ExponentialArrays)
@njit(**INLINE)
def _advance(method, model, n, h, now, new, signals, data, ring):
    m, x, stage, slope, count = method, method.x, ring.current, ring.slope, rows(model)
    _copy_line(model, ring.states, now, x)
    if signals.changing:
        signals_at(model, (n + 0.5) * h, signals)
    dense_rows(m.first, m.half1, count, count, m.moved_a)
    add(model, x, m.moved_a, stage)
    rhs(model, stage, signals.p, signals.u, slope, 0, data)
    dense_rows(m.moved_a, m.linear, count, count, m.product)
    _rest(model, slope, m.first, m.product, m.d_a)
    dense_rows(m.d_a, m.half2, count, count, m.product)
    add(model, m.moved_a, m.product, m.moved)
    add(model, x, m.moved, stage)
    rhs(model, stage, signals.p, signals.u, slope, 0, data)
    dense_rows(m.moved, m.linear, count, count, m.product)
    _rest(model, slope, m.first, m.product, m.d_b)
    if signals.changing:
        signals_at(model, (n + 1) * h, signals)
    dense_rows(m.first, m.full1, count, count, m.along)
    dense_rows(m.d_b, m.full2, count, count, m.product)
    _third_stage(model, m.along, m.product, m.moved)
    add(model, x, m.moved, stage)
    rhs(model, stage, signals.p, signals.u, slope, 0, data)
    dense_rows(m.moved, m.linear, count, count, m.product)
    _rest(model, slope, m.first, m.product, m.d_c)
    _differences(model, m.d_a, m.d_b, m.d_c, m.moved)
    dense_rows(m.moved, m.full2, count, count, m.product)
    dense_rows(m.d_c, m.full3, count, count, m.d_a)
    _result(model, x, m.along, m.product, m.d_a, stage)
    keep(model, stage, ring.states, new)
    return all_fine(model, stage)


@compiled_for(finish, ExponentialArrays)
@njit(**INLINE)
def _finish(method, model, n, h, now, new, wanted, signals, data, ring):
    rhs(model, ring.current, signals.p, signals.u, method.first, 0, data)
    keep(model, method.first, ring.k, new)


@compiled_for(note, ExponentialArrays)
@njit(**INLINE)
def _note(method, model, ring, out, interval):
    pass
