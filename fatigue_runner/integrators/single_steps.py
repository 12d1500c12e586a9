"""Compiled: plain Runge-Kutta steps outside of the time loop: fallbacks and starts of other methods, and samples for training."""

from __future__ import annotations

import numpy as np

from fatigue_runner.compiled import FAST, INLINE, njit
from fatigue_runner.integrators.correction import features, raw_features
from fatigue_runner.integrators.runge_kutta import stages_of_step
from fatigue_runner.integrators.signals import Signals, signals_at
from fatigue_runner.integrators.stepping import combine, keep
from fatigue_runner.turbine.model import rhs, width


@njit(**INLINE)
def integrate(model, x, stages, result, h, first, steps, signals, data, states, k, stage, slope):
    """Plain steps `first` to `first + steps` of size h from x (width,), which is overwritten; k[0] and k[3:] are the last step's slopes."""
    result.rows[0, 0] = 0
    for n in range(first, first + steps):
        keep(model, x, states, 0)
        signals_at(model, n * h, signals)
        rhs(model, x, signals.p, signals.u, slope, 0, data)
        keep(model, slope, k, 0)
        stages_of_step(model, stages, n, h, 0, states, k, signals, data, stage)
        combine(model, states, 0, k, result.rows, result.weights, 0, result.terms, h, x)


@njit(**FAST)
def step_samples(
    model, x, pieces, piece_duration, method, stage_rows, h, accurate, substeps, ratio, data, rows, raw, plain, exact
):  # fmt: skip
    """One step of `method` from each of the states x (groups, width) under its own cubic wind pieces (groups, m, 4, signals * LANES).

    Written: rows (groups, n * LANES) what a stage-aware corrector sees, raw (groups, k * LANES) what the paper's sees,
    plain (groups, width) the method's result, exact (groups, width) that of `substeps` steps of the method `accurate`.
    """
    size, blown = width(model), pieces.shape[3]
    k, states = np.zeros((20, size)), np.zeros((3, size))
    stage, slope, now = np.zeros(size), np.zeros(size), np.zeros(size)
    start, middle, end = np.zeros(blown), np.zeros(blown), np.zeros(blown)
    piece, p, u = np.zeros(pieces.shape[1:]), np.zeros(blown), np.zeros(0)
    for group in range(x.shape[0]):
        piece[:] = pieces[group]
        now[:] = x[group]
        signals = Signals(piece_duration, piece, True, None, p, u)
        integrate(model, now, method.stages, method.result, h, 0, 1, signals, data, states, k, stage, slope)
        plain[group] = now
        signals_at(model, 0.0, Signals(piece_duration, piece, True, None, start, u))
        signals_at(model, 0.5 * h, Signals(piece_duration, piece, True, None, middle, u))
        signals_at(model, h, Signals(piece_duration, piece, True, None, end, u))
        stage_rows[0] = 0
        features(model, x[group], k, stage_rows, h, ratio, start, middle, end, rows[group])
        raw_features(model, x[group], start, raw[group])
        now[:] = x[group]
        integrate(
            model, now, accurate.stages, accurate.result, h / substeps, 0, substeps, signals, data, states, k, stage, slope
        )  # fmt: skip
        exact[group] = now
