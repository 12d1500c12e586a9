"""Compiled time stepping of one group of LANES cases in lockstep.

`fastmath` lets LLVM assume that there is no NaN, so the divergence check is a function of its own without it, compared
against a bound. Loops over the state have the constant length WIDTH, so that they vectorise.
"""

from __future__ import annotations

import numpy as np

from fatigue_runner.compiled import FAST, njit
from fatigue_runner.turbine.generated import kernel
from fatigue_runner.turbine.generated.kernel import LANES

_rhs = kernel.rhs
WIDTH = 16 * LANES
HALF = 8 * LANES
WIND = 3 * LANES

# No state of this turbine comes near these values; beyond them a case has diverged. Azimuths grow without limit.
STATE_BOUND = 1e4
AZIMUTH_BOUND = 1e9


@njit(nogil=True, error_model="numpy")
def diverged(x, time, diverged_at, previous, bad):
    """Mark lanes whose state left the bounds or is no number, and put them back so that they stay finite."""
    for j in range(LANES):
        bad[j] = 0
    for i in range(16):
        bound = AZIMUTH_BOUND if i == 6 or i == 7 else STATE_BOUND
        for j in range(LANES):
            # a comparison with NaN is false, so a NaN counts as bad
            bad[j] |= 0 if abs(x[i * LANES + j]) < bound else 1
    if bad.any():
        for j in range(LANES):
            if bad[j]:
                if diverged_at[j] < 0.0:
                    diverged_at[j] = time
                for i in range(16):
                    x[i * LANES + j] = previous[i * LANES + j]


@njit(**FAST)
def wind_at(time, cell_duration, cells, p):
    """Piecewise cubic wind signals: cells (n, 4, WIND) -> p (WIND,)."""
    # 0.3 / 0.1 is 2.9999999999999996: a step time belongs to the cell that begins there
    i = min(max(int(time / cell_duration + 1e-9), 0), cells.shape[0] - 1)
    u = time - i * cell_duration
    for m in range(WIND):
        p[m] = ((cells[i, 3, m] * u + cells[i, 2, m]) * u + cells[i, 1, m]) * u + cells[i, 0, m]


@njit(**FAST)
def stage_state(x, k, weights, count, h, out):
    """out = x + h sum_j weights[j] k[j]"""
    for m in range(WIDTH):
        out[m] = x[m]
    for j in range(count):
        a = h * weights[j]
        if a != 0.0:
            for m in range(WIDTH):
                out[m] += a * k[j, m]


@njit(**FAST)
def mixed_error(difference, x, local_error):
    """local_error = max(local_error, max over states of |difference| / (1 + |x|)), per lane."""
    for i in range(16):
        for j in range(LANES):
            e = abs(difference[i * LANES + j]) / (1.0 + abs(x[i * LANES + j]))
            local_error[j] = max(local_error[j], e)


@njit(**FAST)
def interpolate(position, velocity, h, states, accelerations, out):
    """One output row from three step ends: states (3, WIDTH), accelerations (3, HALF)."""
    for m in range(HALF):
        out[m] = 0.0
        out[HALF + m] = 0.0
    for node in range(3):
        for part in range(3):
            a = position[3 * node + part] * h**part
            b = velocity[3 * node + part] * h ** (part - 1.0)
            if a == 0.0 and b == 0.0:
                continue
            for m in range(HALF):
                value = accelerations[node, m] if part == 2 else states[node, part * HALF + m]
                out[m] += a * value
                out[HALF + m] += b * value


@njit(**FAST)
def shift(states, accelerations):
    """Make room for a new step end at row 2."""
    for node in range(2):
        for m in range(WIDTH):
            states[node, m] = states[node + 1, m]
        for m in range(HALF):
            accelerations[node, m] = accelerations[node + 1, m]


@njit(**FAST)
def keep(states, accelerations, x, slope):
    """Store state and acceleration at the newest step end."""
    for m in range(WIDTH):
        states[2, m] = x[m]
    for m in range(HALF):
        accelerations[2, m] = slope[HALF + m]


@njit(**FAST)
def runge_kutta(x, method, h, steps, wind, model, plan, rows, errors, diverged_at, clamped):
    """Advance one group by `steps` steps of size h.

    x (WIDTH,) in and out; method = (A, b, error weights, c, last stage shared); wind = (cell duration, cells, changing);
    model = (tables, cells, constants, scratch, row); plan = (step, exact, position, velocity) of `output.OutputPlan`;
    rows (n, WIDTH) are written; errors (n - 1, LANES) too where the method has an embedded one: the largest of the steps of
    each output interval; `diverged_at` (LANES,) is -1 or the time.
    """
    a, b, e, c, shared = method
    cell_duration, wind_cells, changing = wind
    tables, cells, constants, scratch, row = model
    out_step, exact, position, velocity = plan
    stages = len(b)
    computed = stages - 1 if shared else stages
    k = np.zeros((stages, WIDTH))
    p, stage, new = np.zeros(WIND), np.zeros(WIDTH), np.zeros(WIDTH)
    states, accelerations = np.zeros((3, WIDTH)), np.zeros((3, HALF))
    local_error, bad = np.zeros(LANES), np.zeros(LANES, np.int64)
    embedded = False
    for i in range(stages):
        embedded = embedded or e[i] != 0.0

    wind_at(0.0, cell_duration, wind_cells, p)
    _rhs(x, p, k[0], 0, tables, cells, constants, scratch, row, clamped)
    keep(states, accelerations, x, k[0])
    rows[0, :] = x
    output = 1
    for n in range(steps):
        for i in range(1, computed):
            stage_state(x, k, a[i], i, h, stage)
            if changing:
                wind_at((n + c[i]) * h, cell_duration, wind_cells, p)
            _rhs(stage, p, k[i], 0, tables, cells, constants, scratch, row, clamped)
        stage_state(x, k, b, computed, h, new)
        diverged(new, (n + 1) * h, diverged_at, x, bad)
        if embedded:
            for m in range(WIDTH):
                stage[m] = 0.0
            stage_state(stage, k, e, computed, h, stage)
        if changing:
            wind_at((n + 1) * h, cell_duration, wind_cells, p)
        _rhs(new, p, k[0], 0, tables, cells, constants, scratch, row, clamped)
        if embedded:
            if shared:
                for m in range(WIDTH):
                    stage[m] += h * e[stages - 1] * k[0, m]
            mixed_error(stage, new, local_error)
        shift(states, accelerations)
        keep(states, accelerations, new, k[0])
        written = False
        while output < len(out_step) and out_step[output] <= n + 1:
            if exact[output]:
                rows[output, :] = new
            else:
                interpolate(position[output], velocity[output], h, states, accelerations, rows[output])
            if embedded:
                errors[output - 1, :] = local_error
            written = True
            output += 1
        if written:
            local_error[:] = 0.0
        x[:] = new
