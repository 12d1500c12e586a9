"""The compiled time loop of the exponential Runge-Kutta method; arguments as in `loops`.

Krogstad's stages in terms of f and of differences, so that only displacements within the step meet A:
    a = x + h/2 phi_1(hA/2) f_1                     d_i = f_i - f_1 - A (x_i - x) = g_i - g_1
    b = a + h phi_2(hA/2) d_a                       c = x + h phi_1(hA) f_1 + 2 h phi_2(hA) d_b
    x+ = x + h phi_1(hA) f_1 + h phi_2(hA) (2 d_a + 2 d_b - d_c) + 4 h phi_3(hA) (d_c - d_a - d_b)
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fatigue_runner.compiled import FAST, njit
from fatigue_runner.integrators import correction
from fatigue_runner.integrators.stepping import (
    WIDTH,
    all_fine,
    keep,
    mark_diverged,
    wind_at,
    write_output,
)
from fatigue_runner.turbine.generated import kernel

_rhs = kernel.rhs
dense: Any = correction.dense  # an intrinsic, whose first argument numba supplies
BLOCKS = 2  # of eight outputs


@njit(**FAST)
def add(x, y, out):
    """out = x + y"""
    for m in range(WIDTH):
        out[m] = x[m] + y[m]


@njit(**FAST)
def rest(slope, first, a, moved, product, out):
    """out = slope - first - A moved, the change of the part that is not linear."""
    dense(moved, a, 16, BLOCKS, product)
    for m in range(WIDTH):
        out[m] = slope[m] - first[m] - product[m]


@njit(**FAST)
def exponential(h, steps, method, wind, model, plan, work, rows, errors, diverged_at, clamped):
    """Advance one group; method = (A, h/2 phi_1(hA/2), h phi_1(hA), h phi_2(hA/2), h phi_2(hA), h phi_3(hA)), packed."""
    linear, half1, full1, half2, full2, full3 = method
    cell_duration, wind_cells, changing = wind
    tables, cells, constants, scratch, row = model
    out_step, exact, position, velocity = plan
    states, k, p, stage, slope, _largest, restart = work
    first, x, along = np.zeros(WIDTH), np.zeros(WIDTH), np.zeros(WIDTH)
    moved, product = np.zeros(WIDTH), np.zeros(WIDTH)
    moved_a, d_a, d_b, d_c = np.zeros(WIDTH), np.zeros(WIDTH), np.zeros(WIDTH), np.zeros(WIDTH)
    now, output, all_diverged = 0, 1, False

    keep(restart, rows, 0)
    for m in range(WIDTH):
        x[m] = restart[m]
    wind_at(0.0, cell_duration, wind_cells, p)
    _rhs(x, p, first, 0, tables, cells, constants, scratch, row, clamped)
    keep(first, k, 0)
    for n in range(steps):
        if changing:
            wind_at((n + 0.5) * h, cell_duration, wind_cells, p)
        dense(first, half1, 16, BLOCKS, moved_a)
        add(x, moved_a, stage)
        _rhs(stage, p, slope, 0, tables, cells, constants, scratch, row, clamped)
        rest(slope, first, linear, moved_a, product, d_a)
        dense(d_a, half2, 16, BLOCKS, product)
        add(moved_a, product, moved)
        add(x, moved, stage)
        _rhs(stage, p, slope, 0, tables, cells, constants, scratch, row, clamped)
        rest(slope, first, linear, moved, product, d_b)
        if changing:
            wind_at((n + 1) * h, cell_duration, wind_cells, p)
        dense(first, full1, 16, BLOCKS, along)
        dense(d_b, full2, 16, BLOCKS, product)
        for m in range(WIDTH):
            moved[m] = along[m] + 2.0 * product[m]
        add(x, moved, stage)
        _rhs(stage, p, slope, 0, tables, cells, constants, scratch, row, clamped)
        rest(slope, first, linear, moved, product, d_c)
        for m in range(WIDTH):
            moved[m] = 2.0 * (d_a[m] + d_b[m]) - d_c[m]
            d_c[m] = 4.0 * (d_c[m] - (d_a[m] + d_b[m]))
        dense(moved, full2, 16, BLOCKS, product)
        dense(d_c, full3, 16, BLOCKS, d_a)
        for m in range(WIDTH):
            stage[m] = x[m] + (along[m] + (product[m] + d_a[m]))
        if not all_fine(stage):
            all_diverged = mark_diverged(stage, (n + 1) * h, diverged_at, restart)
        now = (now + 1) % 3
        keep(stage, states, now)
        for m in range(WIDTH):
            x[m] = stage[m]
        _rhs(x, p, first, 0, tables, cells, constants, scratch, row, clamped)
        keep(first, k, now)
        while output < len(out_step) and out_step[output] <= n + 1:
            write_output(output, exact, position, velocity, h, states, k, now, rows)
            output += 1
        if all_diverged:
            break
