"""Compiled time loop with a learned correction of the local error: enhanced, and guarded (hybrid).

Enhanced: x+ = eta_h(x) + h^(p+1) N. Hybrid (arXiv 2504.05493, algorithm 1, mended): accepted where the corrected result agrees
with that of a method of order p + 1, the fallback; else the fallback is taken. So every step ends within `limit` scaled units of it.
"""

from __future__ import annotations

import numpy as np

from fatigue_runner.compiled import LEAN, njit
from fatigue_runner.integrators.correction import correction
from fatigue_runner.integrators.loops import RING, stages_of_step
from fatigue_runner.integrators.stepping import (
    WIDTH,
    WIND,
    all_fine,
    combine,
    keep,
    mark_diverged,
    note_step,
    wind_at,
    write_output,
)
from fatigue_runner.turbine.generated import kernel
from fatigue_runner.turbine.generated.kernel import LANES

_rhs = kernel.rhs
NORM_MAX, NORM_RMS = 0, 1
STARTING = 32  # substeps of a step before there is a history; with few, the start's error outweighs that of the run (measured)
MOST_ROWS = 512  # of features with their factors, and of a hidden layer


@njit(nogil=True, error_model="numpy", _nrt=False)
def guard(x, fallback, corrected, units, limit, norm, scaled, accepted, discrepancy):
    """x = corrected where its scaled distance from the fallback is within the limit, else the fallback; per lane.

    units = (1 / atol (WIDTH,), rtol / atol (WIDTH,) or nothing). Compiled without fastmath: a comparison with NaN must be false, so
    that a NaN correction is refused. scaled (WIDTH,): room. Loops over whole states with one result each, and halves against each
    other instead of a loop over the states: so they vectorise.
    """
    inverse, relative = units
    if len(relative) == 0:
        for m in range(WIDTH):
            scaled[m] = abs(corrected[m] - fallback[m]) * inverse[m]
    else:
        for m in range(WIDTH):
            scale = 1.0 + max(abs(x[m]), abs(fallback[m])) * relative[m]
            scaled[m] = abs(corrected[m] - fallback[m]) * inverse[m] / scale
    for m in range(WIDTH):
        size = scaled[m]
        scaled[m] = size if size < np.inf else np.inf
    if norm == NORM_RMS:
        for m in range(WIDTH):
            scaled[m] *= scaled[m] * 0.0625
        for half in (8, 4, 2, 1):
            for m in range(half * LANES):
                scaled[m] += scaled[half * LANES + m]
        for j in range(LANES):
            scaled[j] = np.sqrt(scaled[j])
    else:
        for half in (8, 4, 2, 1):
            for m in range(half * LANES):
                size, other = scaled[m], scaled[half * LANES + m]
                scaled[m] = size if size > other else other
    for j in range(LANES):
        before, size = discrepancy[j], scaled[j]
        discrepancy[j] = before if before > size else size
        accepted[j] = accepted[j] & (size <= limit)
    for half in (1, 2, 4, 8):
        for m in range(half * LANES):
            scaled[half * LANES + m] = scaled[m]
    for m in range(WIDTH):
        # both are read first: so the choice is a vector's, not a branch
        good, safe = corrected[m], fallback[m]
        x[m] = good if scaled[m] <= limit else safe


@njit(nogil=True, error_model="numpy", _nrt=False)
def refuse_outside(features, low, high, fallback, x, accepted):
    """x = fallback, not accepted, in lanes where a feature leaves [low, high] (one per feature after the leading 1; nothing: no bounds).

    Compiled without fastmath: NaN lies outside.
    """
    for j in range(LANES):
        inside = True
        for i in range(len(low)):
            value = features[(1 + i) * LANES + j]
            inside = inside and low[i] <= value <= high[i]
        if not inside:
            accepted[j] = False
            for i in range(16):
                x[i * LANES + j] = fallback[i * LANES + j]


@njit(**LEAN)
def fall_back(n, h, now, current, states, k, fallback, substeps, wind, model, clamped, work, out):
    """Result of the fallback from `current`, which is states[now]: more stages on top of the method's own, or smaller steps.

    fallback = (stage table, result table, shared stages, substeps); `substeps` of them; work = (states (3, WIDTH), k, p, stage, slope).
    """
    (s_rows, s_weights, s_counts, c), (b_rows, b_weights, b_count), shared, _ = fallback
    cell_duration, wind_cells, changing = wind
    tables, cells, constants, scratch, row = model
    own, k2, p, stage, slope = work
    if substeps == 0:
        for i in range(shared, len(c)):
            s_rows[i, 0] = now
            combine(states, now, k, s_rows, s_weights, i, s_counts[i], h, stage)
            wind_at((n + c[i]) * h, cell_duration, wind_cells, p)
            _rhs(stage, p, slope, 0, tables, cells, constants, scratch, row, clamped)
            keep(slope, k, RING - 1 + i)
        b_rows[0, 0] = now
        combine(states, now, k, b_rows, b_weights, 0, b_count, h, out)
    else:
        small = h / substeps
        b_rows[0, 0] = 0
        keep(current, own, 0)
        for m in range(WIDTH):
            k2[0, m] = k[now, m]
        for i in range(substeps):
            number = n * substeps + i
            # with constant wind, too: p must hold the wind at the sub-step's start
            wind_at(number * small, cell_duration, wind_cells, p)
            if i > 0:
                _rhs(out, p, slope, 0, tables, cells, constants, scratch, row, clamped)
                keep(slope, k2, 0)
                keep(out, own, 0)
            stages_of_step(
                number, small, 0, own, k2, s_rows, s_weights, s_counts, c, cell_duration, wind_cells, changing,
                tables, cells, constants, scratch, row, clamped, p, stage, slope,
            )  # fmt: skip
            combine(own, 0, k2, b_rows, b_weights, 0, b_count, small, out)


@njit(**LEAN)
def add(plain, defect, out):
    """out = plain + defect"""
    for m in range(WIDTH):
        out[m] = plain[m] + defect[m]


@njit(**LEAN)
def subtract(a, b, out):
    """out = a - b"""
    for m in range(WIDTH):
        out[m] = a[m] - b[m]


@njit(**LEAN)
def move(source, target):
    """target = source"""
    for m in range(WIDTH):
        target[m] = source[m]


@njit(**LEAN)
def keep_largest(defect, largest):
    """largest = max(largest, |defect|)"""
    for m in range(WIDTH):
        largest[m] = max(largest[m], abs(defect[m]))


@njit(**LEAN)
def corrected_steps(
    h, steps, method, network, safety, wind, model, plan, work, rows, status, diverged_at, clamped
):
    """Advance one group by `steps` corrected steps of size h, as `loops.runge_kutta`, and

    method = (stage table, result table, rows of the stage slopes); network as `correction.correction`;
    safety = (hybrid, fallback, `correcting.guard_units`, limit, norm, bounds of the features (low, high)); work =
    `working_arrays`. A network that looks back at earlier steps begins when it can: until then the fallback steps.
    status = (accepted, discrepancy, local error) (n - 1, LANES) are written: the worst since the last step with outputs, in the
    row of a step's first output.
    """
    (s_rows, s_weights, s_counts, c), (b_rows, b_weights, b_count), stage_rows = method
    hybrid, fallback, units, limit, norm, (low, high) = safety
    cell_duration, wind_cells, changing = wind
    tables, cells, constants, scratch, row = model
    out_step, exact, position, velocity = plan
    (
        (states, k, restart, current, stage, slope, plain, fixed, other, defect, largest),
        (p, start, middle),
        buffers,
        (discrepancy, accepted, scaled),
        inner,
    ) = work
    features, hidden = buffers
    now, output, all_diverged, history = 0, 1, False, network[2]

    keep(restart, rows, 0)
    wind_at(0.0, cell_duration, wind_cells, p)
    for m in range(WIND):
        start[m] = p[m]
        middle[m] = p[m]
    _rhs(current, p, slope, 0, tables, cells, constants, scratch, row, clamped)
    keep(slope, k, 0)
    for n in range(steps):
        new = (now + 1) % 3
        at = stages_of_step(
            n, h, now, states, k, s_rows, s_weights, s_counts, c, cell_duration, wind_cells, changing,
            tables, cells, constants, scratch, row, clamped, p, stage, slope,
        )  # fmt: skip
        b_rows[0, 0] = now
        combine(states, now, k, b_rows, b_weights, 0, b_count, h, plain)
        if changing:
            wind_at((n + 0.5) * h, cell_duration, wind_cells, middle)
            if at != 1.0:
                wind_at((n + 1) * h, cell_duration, wind_cells, p)
        stage_rows[0] = now
        correction(current, k, stage_rows, h, start, middle, p, network, features, hidden, defect)
        if hybrid or n < history:
            substeps = STARTING if n < history else fallback[3]
            fall_back(n, h, now, current, states, k, fallback, substeps, wind, model, clamped, inner, other)
            if n < history:
                move(other, current)
            else:
                add(plain, defect, fixed)
                guard(current, other, fixed, units, limit, norm, scaled, accepted, discrepancy)
                if len(low) > 0:
                    refuse_outside(features, low, high, other, current, accepted)
            # the logged error estimate is the embedded one, not the learned one
            subtract(other, plain, defect)
        else:
            add(plain, defect, current)
        keep_largest(defect, largest)
        if not all_fine(current):
            all_diverged = mark_diverged(current, (n + 1) * h, diverged_at, restart)
        keep(current, states, new)
        _rhs(current, p, slope, 0, tables, cells, constants, scratch, row, clamped)
        keep(slope, k, new)
        for m in range(WIND):
            start[m] = p[m]
        now, first = new, output
        while output < len(out_step) and out_step[output] <= n + 1:
            write_output(output, exact, position, velocity, h, states, k, now, rows)
            output += 1
        if output > first:
            note_step((discrepancy, accepted), largest, current, status, first - 1)
        if all_diverged:
            break


def working_arrays(start, slopes, aligned):
    """`work` of `corrected_steps` for the initial states `start` (WIDTH,) and `slopes` rows of k; aligned: copies onto cache lines."""
    wide = [aligned(np.zeros(WIDTH)) for _ in range(7)]  # stage, slope, plain, fixed, other, defect, largest
    states, k = aligned(np.stack([start] * 3)), aligned(np.zeros((slopes, WIDTH)))
    winds = tuple(aligned(np.zeros(WIND)) for _ in range(3))
    buffers = (aligned(np.zeros(MOST_ROWS * LANES)), aligned(np.zeros((2, MOST_ROWS * LANES))))
    inner = (
        np.zeros((3, WIDTH)), aligned(np.zeros_like(k)), np.zeros(WIND), aligned(np.zeros(WIDTH)), aligned(np.zeros(WIDTH)),
    )  # fmt: skip
    judged = (aligned(np.zeros(LANES)), np.ones(LANES, np.bool_), aligned(np.zeros(WIDTH)))
    return (states, k, aligned(start), aligned(start), *wide), winds, buffers, judged, inner
