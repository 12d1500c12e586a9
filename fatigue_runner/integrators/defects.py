"""Compiled: many independent single steps, and what an accurate integration of the same step gives; for training correctors."""

from __future__ import annotations

import numpy as np

from fatigue_runner.compiled import FAST, njit
from fatigue_runner.integrators.correction import FIXED_ROWS, features
from fatigue_runner.integrators.stepping import WIDTH, WIND, stage_state, wind_at
from fatigue_runner.turbine.generated import kernel
from fatigue_runner.turbine.generated.kernel import LANES

_rhs = kernel.rhs


@njit(**FAST)
def integrate(x, method, h, start, steps, cells, model, clamped, k, p, stage):
    """`steps` plain steps of size h from time `start` [s] of the cubic wind piece `cells` (1, 4, WIND); x is overwritten."""
    a, b, c = method
    tables, cell_count, constants, scratch, row = model
    stages = len(b)
    for n in range(steps):
        for i in range(stages):
            stage_state(x, k, a[i], i, h, stage)
            wind_at(start + (n + c[i]) * h, 1e9, cells, p)
            _rhs(stage, p, k[i], 0, tables, cell_count, constants, scratch, row, clamped)
        stage_state(x, k, b, stages, h, stage)
        x[:] = stage


@njit(**FAST)
def step_samples(x, cells, method, h, accurate, substeps, ratio, model, clamped, rows, plain, exact):
    """One step of `method` from each of the states x (groups, WIDTH) under its own cubic wind piece (groups, 4, WIND).

    Written: rows (groups, n, LANES) what a corrector sees, plain (groups, WIDTH) the method's result, exact (groups, WIDTH) that of
    `substeps` steps of the method `accurate`.
    """
    a, b, c = method
    stages = len(b)
    k = np.zeros((16, WIDTH))
    p, stage = np.zeros(WIND), np.zeros(WIDTH)
    start, middle, end = np.zeros(WIND), np.zeros(WIND), np.zeros(WIND)
    flat = np.zeros((FIXED_ROWS + 8 * stages) * LANES)
    piece = np.zeros((1, 4, WIND))
    for group in range(x.shape[0]):
        piece[0] = cells[group]
        plain[group] = x[group]
        integrate(plain[group], (a, b, c), h, 0.0, 1, piece, model, clamped, k, p, stage)
        wind_at(0.0, 1e9, piece, start)
        wind_at(0.5 * h, 1e9, piece, middle)
        wind_at(h, 1e9, piece, end)
        features(x[group], k, stages, h, ratio, start, middle, end, flat)
        for i in range(len(flat)):
            rows[group, i // LANES, i % LANES] = flat[i]
        exact[group] = x[group]
        integrate(exact[group], accurate, h / substeps, 0.0, substeps, piece, model, clamped, k, p, stage)
