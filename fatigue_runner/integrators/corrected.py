"""Compiled time stepping with a learned correction of the local error: enhanced, and guarded (hybrid).

Enhanced: x+ = eta_h(x) + h^(p+1) N. Hybrid (arXiv 2504.05493, algorithm 1, mended): accepted where the corrected result agrees with
that of a method of order p + 1, the fallback; else the fallback is taken. So every step ends within `limit` scaled units of it.
"""

from __future__ import annotations

import numpy as np

from fatigue_runner.compiled import FAST, njit
from fatigue_runner.integrators.correction import correction
from fatigue_runner.integrators.stepping import (
    HALF,
    WIDTH,
    WIND,
    diverged,
    interpolate,
    keep,
    mixed_error,
    shift,
    stage_state,
    wind_at,
)
from fatigue_runner.turbine.generated import kernel
from fatigue_runner.turbine.generated.kernel import LANES

_rhs = kernel.rhs
NORM_MAX, NORM_RMS = 0, 1


@njit(nogil=True, error_model="numpy")
def guard(new, fallback, corrected, x, atol, rtol, limit, norm, accepted, discrepancy):
    """new = corrected where its scaled distance from the fallback is within the limit, else the fallback; per lane.

    Compiled without fastmath: a comparison with NaN must be false, so that a NaN correction is refused.
    """
    for j in range(LANES):
        total = 0.0
        bad = False
        for i in range(16):
            m = i * LANES + j
            scale = atol[i] + max(abs(x[m]), abs(fallback[m])) * rtol[i]
            d = abs(corrected[m] - fallback[m]) / scale
            bad = bad or not (d < np.inf)
            total = max(total, d) if norm == NORM_MAX else total + d * d / 16.0
        size = total if norm == NORM_MAX else np.sqrt(total)
        ok = (not bad) and size <= limit
        accepted[j] = accepted[j] and ok
        discrepancy[j] = max(discrepancy[j], size) if not bad else np.inf
        for i in range(16):
            m = i * LANES + j
            new[m] = corrected[m] if ok else fallback[m]


@njit(**FAST)
def fall_back(x, k, method, fallback, h, time, wind, model, clamped, k2, p, stage, out):
    """Result of the fallback from x: more stages on top of the method's own, or smaller steps of the method itself."""
    a, b, c = method
    a2, b2, c2, shared, substeps = fallback
    cell_duration, cells, changing = wind
    tables, cell_count, constants, scratch, row = model
    if substeps == 0:
        for i in range(shared, len(b2)):
            stage_state(x, k, a2[i], i, h, stage)
            wind_at(time + c2[i] * h, cell_duration, cells, p)
            _rhs(stage, p, k[i], 0, tables, cell_count, constants, scratch, row, clamped)
        stage_state(x, k, b2, len(b2), h, out)
        return
    small = h / substeps
    out[:] = x
    for m in range(WIDTH):
        k2[0, m] = k[0, m]
    for n in range(substeps):
        for i in range(0 if n > 0 else 1, len(b)):
            stage_state(out, k2, a[i], i, small, stage)
            wind_at(time + (n + c[i]) * small, cell_duration, cells, p)
            _rhs(stage, p, k2[i], 0, tables, cell_count, constants, scratch, row, clamped)
        stage_state(out, k2, b, len(b), small, stage)
        out[:] = stage


@njit(**FAST)
def corrected_steps(x, method, network, hybrid, fallback, tolerance, h, steps, wind, model, plan, rows, status, diverged_at, clamped):
    """Advance one group by `steps` corrected steps of size h; arguments as `stepping.runge_kutta`, and

    method = (A, b, c) without a shared last stage; network as `correction.correction`; fallback = (A, b, c, shared stages, substeps);
    tolerance = (atol (16,), rtol (16,), limit, norm); status = accepted (n - 1, LANES), discrepancy, local error: written.
    """
    a, b, c = method
    cell_duration, wind_cells, changing = wind
    tables, cells, constants, scratch, row = model
    out_step, exact, position, velocity = plan
    atol, rtol, limit, norm = tolerance
    accepted_out, discrepancy_out, error_out = status
    stages = len(b)
    k, k2 = np.zeros((stages + 4, WIDTH)), np.zeros((stages, WIDTH))
    p, start, middle = np.zeros(WIND), np.zeros(WIND), np.zeros(WIND)
    stage, plain, corrected, new = np.zeros(WIDTH), np.zeros(WIDTH), np.zeros(WIDTH), np.zeros(WIDTH)
    defect, other = np.zeros(WIDTH), np.zeros(WIDTH)
    features, hidden = np.zeros(1024 * LANES), np.zeros((2, 1024 * LANES))
    states, accelerations = np.zeros((3, WIDTH)), np.zeros((3, HALF))
    local_error, discrepancy, bad = np.zeros(LANES), np.zeros(LANES), np.zeros(LANES, np.int64)
    accepted = np.ones(LANES, np.bool_)

    wind_at(0.0, cell_duration, wind_cells, start)
    wind_at(0.0, cell_duration, wind_cells, middle)
    wind_at(0.0, cell_duration, wind_cells, p)
    _rhs(x, p, k[0], 0, tables, cells, constants, scratch, row, clamped)
    keep(states, accelerations, x, k[0])
    rows[0, :] = x
    output = 1
    for n in range(steps):
        time = n * h
        for i in range(1, stages):
            stage_state(x, k, a[i], i, h, stage)
            if changing:
                wind_at(time + c[i] * h, cell_duration, wind_cells, p)
            _rhs(stage, p, k[i], 0, tables, cells, constants, scratch, row, clamped)
        stage_state(x, k, b, stages, h, plain)
        if changing:
            wind_at(time + 0.5 * h, cell_duration, wind_cells, middle)
            wind_at(time + h, cell_duration, wind_cells, p)
        correction(x, k, stages, h, start, middle, p, network, features, hidden, defect)
        for m in range(WIDTH):
            corrected[m] = plain[m] + defect[m]
        if hybrid:
            fall_back(x, k, method, fallback, h, time, wind, model, clamped, k2, p, stage, other)
            guard(new, other, corrected, x, atol, rtol, limit, norm, accepted, discrepancy)
            for m in range(WIDTH):
                defect[m] = other[m] - plain[m]
            if changing:
                wind_at(time + h, cell_duration, wind_cells, p)
        else:
            new[:] = corrected
        mixed_error(defect, plain, local_error)
        diverged(new, (n + 1) * h, diverged_at, x, bad)
        _rhs(new, p, k[0], 0, tables, cells, constants, scratch, row, clamped)
        start[:] = p
        shift(states, accelerations)
        keep(states, accelerations, new, k[0])
        written = False
        while output < len(out_step) and out_step[output] <= n + 1:
            if exact[output]:
                rows[output, :] = new
            else:
                interpolate(position[output], velocity[output], h, states, accelerations, rows[output])
            accepted_out[output - 1, :] = accepted
            discrepancy_out[output - 1, :] = discrepancy
            error_out[output - 1, :] = local_error
            written = True
            output += 1
        if written:
            local_error[:] = 0.0
            discrepancy[:] = 0.0
            accepted[:] = True
        x[:] = new
