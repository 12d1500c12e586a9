"""Compiled: many independent single steps, and what an accurate integration of the same step gives; for training correctors."""

from __future__ import annotations

import numpy as np

from fatigue_runner.compiled import FAST, LEAN, njit
from fatigue_runner.integrators.correction import features, raw_features
from fatigue_runner.integrators.loops import stages_of_step
from fatigue_runner.integrators.stepping import WIDTH, WIND, combine, keep, wind_at
from fatigue_runner.turbine.generated import kernel

_rhs = kernel.rhs


@njit(**LEAN)
def integrate(x, method, h, first, steps, wind, model, clamped, k, p, stage, slope, states):
    """Plain steps `first` to `first + steps` of size h from x (WIDTH,), which is overwritten; k[0] and k[3:] are the last step's slopes."""
    (s_rows, s_weights, s_counts, c), (b_rows, b_weights, b_count) = method
    cell_duration, wind_cells, changing = wind
    tables, cells, constants, scratch, row = model
    b_rows[0, 0] = 0
    for n in range(first, first + steps):
        keep(x, states, 0)
        wind_at(n * h, cell_duration, wind_cells, p)
        _rhs(x, p, slope, 0, tables, cells, constants, scratch, row, clamped)
        keep(slope, k, 0)
        stages_of_step(
            n, h, 0, states, k, s_rows, s_weights, s_counts, c, cell_duration, wind_cells, changing,
            tables, cells, constants, scratch, row, clamped, p, stage, slope,
        )  # fmt: skip
        combine(states, 0, k, b_rows, b_weights, 0, b_count, h, x)


@njit(**FAST)
def step_samples(
    x,
    pieces,
    piece_duration,
    method,
    stage_rows,
    h,
    accurate,
    substeps,
    ratio,
    model,
    clamped,
    rows,
    raw,
    plain,
    exact,
):
    """One step of `method` from each of the states x (groups, WIDTH) under its own cubic wind pieces (groups, m, 4, WIND).

    Written: rows (groups, n * LANES) what a stage-aware corrector sees, raw (groups, 18 * LANES) what the paper's sees,
    plain (groups, WIDTH) the method's result, exact (groups, WIDTH) that of `substeps` steps of the method `accurate`.
    """
    k = np.zeros((20, WIDTH))
    p, states = np.zeros(WIND), np.zeros((3, WIDTH))
    stage, slope, now = np.zeros(WIDTH), np.zeros(WIDTH), np.zeros(WIDTH)
    start, middle, end = np.zeros(WIND), np.zeros(WIND), np.zeros(WIND)
    piece = np.zeros(pieces.shape[1:])
    for group in range(x.shape[0]):
        piece[:] = pieces[group]
        wind = (piece_duration, piece, True)
        now[:] = x[group]
        integrate(now, method, h, 0, 1, wind, model, clamped, k, p, stage, slope, states)
        plain[group] = now
        wind_at(0.0, piece_duration, piece, start)
        wind_at(0.5 * h, piece_duration, piece, middle)
        wind_at(h, piece_duration, piece, end)
        stage_rows[0] = 0
        features(x[group], k, stage_rows, h, ratio, start, middle, end, rows[group])
        raw_features(x[group], start, raw[group])
        now[:] = x[group]
        integrate(now, accurate, h / substeps, 0, substeps, wind, model, clamped, k, p, stage, slope, states)
        exact[group] = now
