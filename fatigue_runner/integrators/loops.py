"""The compiled time loops: Runge-Kutta and linear multistep, one group of LANES cases in lockstep.

Arguments of both: h [s], steps; method: see `kernel_data`; wind = (cell duration, cells of `wind_at`, changing); model =
(tables, cells, constants, scratch, row); plan = (step, exact, position, velocity) of `output.OutputPlan`; work = (states, k, p,
stage, slope, largest, restart), the initial states (WIDTH,) in states[0]. Written: rows (n, WIDTH); errors (n - 1, LANES) where
the method has an embedded one, the largest since the last step with outputs, in the row of a step's first output;
`diverged_at` (LANES,), -1 or the time; clamped (LANES,).
Both end early when all lanes have diverged.
"""

from __future__ import annotations

from fatigue_runner.compiled import INLINE, LEAN, njit
from fatigue_runner.integrators.stepping import (
    WIDTH,
    advance,
    combine,
    keep,
    largest_error,
    mark_diverged,
    move,
    scaled_error,
    wind_at,
    write_output,
)
from fatigue_runner.turbine import model as turbine_model

_rhs = turbine_model.rhs

# Rows 0 to 2 of `k` are a ring of the slopes at the last three step ends, which the output interpolates; stage i has row 2 + i.
RING = 3


@njit(**INLINE)
def stages_of_step(
    n, h, now, states, k, s_rows, s_weights, s_counts, c, cell_duration, wind_cells, changing,
    tables, cells, constants, scratch, row, clamped, p, stage, slope,
):  # fmt: skip
    """Slopes of one Runge-Kutta step's stages but the first, which stands in k[now]; returns the last stage's time in steps."""
    at, slopes = 0.0, k.reshape(k.size)
    for i in range(1, len(c)):
        s_rows[i, 0] = now  # stage 0 is the first term everywhere, its row changes from step to step
        combine(states, now, k, s_rows, s_weights, i, s_counts[i], h, stage)
        if changing and c[i] != at:
            at = c[i]
            wind_at((n + at) * h, cell_duration, wind_cells, p)
        _rhs(stage, p, slopes, (RING - 1 + i) * WIDTH, tables, cells, constants, scratch, row, clamped)
    return at


@njit(**LEAN)
def runge_kutta(h, steps, method, wind, model, plan, work, rows, errors, diverged_at, clamped):
    """Advance one group with a Runge-Kutta method; see the module."""
    (s_rows, s_weights, s_counts, c), (b_rows, b_weights, b_count), (e_rows, e_weights, e_count) = method
    cell_duration, wind_cells, changing = wind
    tables, cells, constants, scratch, row = model
    out_step, exact, position, velocity = plan
    states, k, p, stage, _slope, largest, restart = work
    now, output, all_diverged, slopes = 0, 1, False, k.reshape(k.size)

    keep(restart, rows, 0)
    wind_at(0.0, cell_duration, wind_cells, p)
    _rhs(restart, p, slopes, 0, tables, cells, constants, scratch, row, clamped)
    for n in range(steps):
        at = stages_of_step(
            n, h, now, states, k, s_rows, s_weights, s_counts, c, cell_duration, wind_cells, changing,
            tables, cells, constants, scratch, row, clamped, p, stage, _slope,
        )  # fmt: skip
        new = (now + 1) % 3
        b_rows[0, 0] = now
        if not advance(states, now, new, k, b_rows, b_weights, 0, b_count, h, stage):
            all_diverged = mark_diverged(stage, (n + 1) * h, diverged_at, restart)
            keep(stage, states, new)
        if changing and at != 1.0:
            wind_at((n + 1) * h, cell_duration, wind_cells, p)
        _rhs(stage, p, slopes, new * WIDTH, tables, cells, constants, scratch, row, clamped)
        if e_count > 0:
            # the error's terms begin with this step's first slope and the next one's
            e_rows[0, 0], e_rows[0, 1] = now, new
            largest_error(k, e_rows, e_weights, e_count, h, largest)
        now, first = new, output
        while output < len(out_step) and out_step[output] <= n + 1:
            write_output(output, exact, position, velocity, h, states, k, now, rows)
            if e_count > 0 and output == first:
                scaled_error(largest, stage, errors, output - 1)
            output += 1
        if all_diverged:
            break


@njit(**LEAN)
def multistep(h, steps, method, wind, model, plan, work, rows, errors, diverged_at, clamped):
    """Advance one group with an Adams method, started with a Runge-Kutta method; see the module."""
    (s_rows, s_weights, s_counts, c), (b_rows, b_weights, b_count), (order, weights, correcting, oldest) = (
        method
    )
    cell_duration, wind_cells, changing = wind
    tables, cells, constants, scratch, row = model
    out_step, exact, position, velocity = plan
    states, k, p, stage, _slope, _largest, restart = work
    now, output, all_diverged, starting = 0, 1, False, weights.shape[1] - 1
    slopes = k.reshape(k.size)

    keep(restart, rows, 0)
    wind_at(0.0, cell_duration, wind_cells, p)
    _rhs(restart, p, slopes, 0, tables, cells, constants, scratch, row, clamped)
    for n in range(steps):
        at = 0.0
        back1, back2 = (now + 2) % 3, (now + 1) % 3
        new = back2
        if n < starting:
            at = stages_of_step(
                n, h, now, states, k, s_rows, s_weights, s_counts, c, cell_duration, wind_cells, changing,
                tables, cells, constants, scratch, row, clamped, p, stage, _slope,
            )  # fmt: skip
            b_rows[0, 0] = now
            fine = advance(states, now, new, k, b_rows, b_weights, 0, b_count, h, stage)
        else:
            order[0, 0], order[0, 1], order[0, 2], order[0, 3] = now, back1, back2, oldest
            fine = advance(states, now, new, k, order, weights, 0, 4, h, stage)
            if correcting:
                if changing:
                    at = 1.0
                    wind_at((n + 1) * h, cell_duration, wind_cells, p)
                _rhs(stage, p, slopes, (oldest + 1) * WIDTH, tables, cells, constants, scratch, row, clamped)
                order[1, 0], order[1, 1], order[1, 2], order[1, 3] = oldest + 1, now, back1, back2
                fine = advance(states, now, new, k, order, weights, 1, 4, h, stage)
        if not fine:
            all_diverged = mark_diverged(stage, (n + 1) * h, diverged_at, restart)
            keep(stage, states, new)
        if changing and at != 1.0:
            wind_at((n + 1) * h, cell_duration, wind_cells, p)
        # the slope two steps back becomes the oldest; its place in the ring is the newest one's
        move(k, new, oldest)
        _rhs(stage, p, slopes, new * WIDTH, tables, cells, constants, scratch, row, clamped)
        now = new
        while output < len(out_step) and out_step[output] <= n + 1:
            write_output(output, exact, position, velocity, h, states, k, now, rows)
            output += 1
        if all_diverged:
            break
