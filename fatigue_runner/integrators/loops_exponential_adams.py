"""The compiled time loop of the exponential Adams methods, plain, corrected by a learned matrix, and guarded (hybrid).

What a step sees are rows [n][LANES], flat, in the order of `exponential_adams`; blades in multi-blade coordinates at the azimuth of the
step's start. Nonlinear parts are kept blade by blade and turned in every step.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from fatigue_runner.compiled import LEAN, njit
from fatigue_runner.integrators import correction
from fatigue_runner.integrators.corrected import guard, move, subtract
from fatigue_runner.integrators.correction import multiply
from fatigue_runner.integrators.defects import integrate
from fatigue_runner.integrators.exponential_adams import PARTS, PAST_ROW, STATE_ROW, WIND_ROW
from fatigue_runner.integrators.stepping import (
    HALF,
    WIDTH,
    WIND,
    all_fine,
    keep,
    mark_diverged,
    note_step,
    wind_at,
    write_output,
)
from fatigue_runner.turbine.generated import kernel
from fatigue_runner.turbine.generated.kernel import LANES

_rhs = kernel.rhs
dense: Any = correction.dense  # an intrinsic, whose first argument numba supplies
BLOCKS = 2  # of eight outputs
PART = PARTS * LANES
SIN60 = math.sqrt(0.75)


@njit(**LEAN)
def sine_cosine(x, turned):
    """turned (2, LANES) = sine and cosine of the azimuth in the state x."""
    for j in range(LANES):
        phi = x[6 * LANES + j]
        turns = math.floor(phi * 0.15915494309189535 + 0.5)
        q = (phi - turns * 6.283185307179586 - turns * 2.4492935982947064e-16) * 0.25
        y = q * q
        # Taylor series to rounding on an eighth of a turn, doubled twice
        sine = 1 / 1307674368000 * y - 1 / 6227020800
        sine = ((((-sine * y - 1 / 39916800) * y + 1 / 362880) * y - 1 / 5040) * y + 1 / 120) * y - 1 / 6
        sine = q + q * y * sine
        cosine = 1 / 20922789888000 * y - 1 / 87178291200
        cosine = (
            (((cosine * y + 1 / 479001600) * y - 1 / 3628800) * y + 1 / 40320) * y - 1 / 720
        ) * y + 1 / 24
        cosine = 1.0 - 0.5 * y + y * y * cosine
        double = 2.0 * sine * cosine
        cosine = 1.0 - 2.0 * sine * sine
        turned[j] = 2.0 * double * cosine
        turned[LANES + j] = 1.0 - 2.0 * double * double


@njit(**LEAN)
def to_fixed(values, first, turned, rows, to):
    """Rows `to` on = mean, cosine and sine part of the three blades' rows of `values` from `first` on."""
    for j in range(LANES):
        one = values[first * LANES + j]
        two = values[(first + 1) * LANES + j]
        three = values[(first + 2) * LANES + j]
        along = (2.0 * one - two - three) * (1.0 / 3.0)
        across = (two - three) * (2.0 / 3.0 * SIN60)
        sine, cosine = turned[j], turned[LANES + j]
        rows[to * LANES + j] = (one + two + three) * (1.0 / 3.0)
        rows[(to + 1) * LANES + j] = cosine * along - sine * across
        rows[(to + 2) * LANES + j] = sine * along + cosine * across


@njit(**LEAN)
def state_rows(x, turned, inverse, rows):
    """Rows 0 to 15: 1, deflections, shaft twist, rates, rate of twist."""
    for j in range(LANES):
        rows[j] = 1.0
        rows[7 * LANES + j] = x[6 * LANES + j] - x[7 * LANES + j] * inverse
        rows[15 * LANES + j] = x[14 * LANES + j] - x[15 * LANES + j] * inverse
    for m in range(2 * LANES):
        rows[STATE_ROW * LANES + m] = x[m]
        rows[8 * LANES + m] = x[8 * LANES + m]
        rows[13 * LANES + m] = x[13 * LANES + m]
    for j in range(LANES):
        rows[6 * LANES + j] = x[5 * LANES + j]
    to_fixed(x, 2, turned, rows, 3)
    to_fixed(x, 10, turned, rows, 10)


@njit(**LEAN)
def wind_row(p, rows, to):
    """Wind speed, and the wind that the shears add at the rotor's edge."""
    for j in range(LANES):
        v = p[j]
        rows[to * LANES + j] = v
        rows[(to + 1) * LANES + j] = v * p[LANES + j]
        rows[(to + 2) * LANES + j] = v * p[2 * LANES + j]


@njit(**LEAN)
def part_rows(ring, line, turned, rows, to):
    """Rows `to` on = nonlinear part `line` of the ring, turned; unsigned places: numba's check for negative ones costs the vectors."""
    first = np.uint64(to * LANES)
    for m in range(2 * LANES):
        rows[first + np.uint64(m)] = ring[line, m]
    for m in range(3 * LANES):
        rows[first + np.uint64(5 * LANES + m)] = ring[line, 5 * LANES + m]
    for j in range(LANES):
        one, two, three = ring[line, 2 * LANES + j], ring[line, 3 * LANES + j], ring[line, 4 * LANES + j]
        along = (2.0 * one - two - three) * (1.0 / 3.0)
        across = (two - three) * (2.0 / 3.0 * SIN60)
        sine, cosine = turned[j], turned[LANES + j]
        rows[first + np.uint64(2 * LANES + j)] = (one + two + three) * (1.0 / 3.0)
        rows[first + np.uint64(3 * LANES + j)] = cosine * along - sine * across
        rows[first + np.uint64(4 * LANES + j)] = sine * along + cosine * across


@njit(**LEAN)
def advanced(x, change, turned, out):
    """out = x + change, the change given in multi-blade coordinates."""
    for m in range(2 * LANES):
        out[m] = x[m] + change[m]
    for m in range(5 * LANES):
        out[5 * LANES + m] = x[5 * LANES + m] + change[5 * LANES + m]
    for m in range(3 * LANES):
        out[13 * LANES + m] = x[13 * LANES + m] + change[13 * LANES + m]
    for b in range(2):
        first = (2 + 8 * b) * LANES
        for j in range(LANES):
            sine, cosine = turned[j], turned[LANES + j]
            mean = change[first + j]
            c, s = change[first + LANES + j], change[first + 2 * LANES + j]
            along, across = cosine * c + sine * s, SIN60 * (cosine * s - sine * c)
            out[first + j] = x[first + j] + (mean + along)
            out[first + LANES + j] = x[first + LANES + j] + (mean - 0.5 * along + across)
            out[first + 2 * LANES + j] = x[first + 2 * LANES + j] + (mean - 0.5 * along - across)


@njit(**LEAN)
def relative(x, inverse, rows):
    """rows (15, LANES): deflections, twist, rates, rate of twist, blade by blade."""
    for m in range(6 * LANES):
        rows[m] = x[m]
    for m in range(7 * LANES):
        rows[7 * LANES + m] = x[8 * LANES + m]
    for j in range(LANES):
        rows[6 * LANES + j] = x[6 * LANES + j] - x[7 * LANES + j] * inverse
        rows[14 * LANES + j] = x[14 * LANES + j] - x[15 * LANES + j] * inverse


@njit(**LEAN)
def nonlinear_part(slope, product, inverse, ring, line):
    """ring[line] = the accelerations in `slope` without their linear part `product`; the twist's in place of the generator's."""
    for m in range(7 * LANES):
        ring[line, m] = slope[HALF + m] - product[m]
    for j in range(LANES):
        twist = slope[14 * LANES + j] - slope[15 * LANES + j] * inverse
        ring[line, 7 * LANES + j] = twist - product[7 * LANES + j]


@njit(**LEAN)
def shifted_slope(slope, shift, ratio, k, line):
    """k[line] = accelerations in `slope`, moved by the linear part's `shift`; the output interpolates with them."""
    for m in range(7 * LANES):
        k[line, HALF + m] = slope[HALF + m] + shift[m]
    for j in range(LANES):
        change = ratio * (shift[6 * LANES + j] - shift[7 * LANES + j])
        k[line, 15 * LANES + j] = slope[15 * LANES + j] + change


@njit(**LEAN)
def keep_largest_distance(a, b, largest):
    """largest = max(largest, |a - b|)"""
    for m in range(WIDTH):
        largest[m] = max(largest[m], abs(a[m] - b[m]))


@njit(nogil=True, error_model="numpy", _nrt=False)
def forget_infinite(ring):
    """Nonlinear parts of a lane that has diverged must not reach it again after its restart: a strict function, NaN counts."""
    for line in range(ring.shape[0]):
        for m in range(ring.shape[1]):
            if not abs(ring[line, m]) < 1e30:
                ring[line, m] = 0.0


@njit(**LEAN)
def exponential_adams(
    h, steps, method, network, safety, wind, model, plan, work, rows, status, diverged_at, clamped
):
    """Advance one group; method, network, safety as `exponential_adams.loop_data`, `network` and (hybrid, the guard's
    units for predictor and corrector, limit, norm): both the predictor's and the corrector's learned part are guarded.

    work = `working_arrays`; status = (accepted, discrepancy, local error) (n - 1, LANES), the worst since the last step with
    outputs, in the row of a step's first output; the local error is the distance of the predictor's result from the corrector's.
    The rest as in `loops`.
    """
    low, ratio, past, starting, substeps = method
    ahead_weights, plain_ahead_weights, weights, plain_weights, factors = network
    hybrid, ahead_units, units, limit, norm = safety
    cell_duration, wind_cells, changing = wind
    tables, cells, constants, scratch, row = model
    out_step, exact, position, velocity = plan
    (
        (states, k, restart, current, slope, ahead, fixed, other, change, largest),
        (p, start, middle),
        (seen, ring, turned, rel, product),
        (discrepancy, accepted, scaled),
        inner,
    ) = work
    inner_k, inner_p, inner_stage, inner_slope, inner_states = inner
    inverse = 1.0 / ratio
    new_row = PAST_ROW + PARTS * past
    count = new_row + PARTS
    inputs = count * (1 + len(factors))
    now, newest, output, all_diverged = 0, 0, 1, False

    keep(restart, rows, 0)
    wind_at(0.0, cell_duration, wind_cells, p)
    for m in range(WIND):
        start[m] = p[m]
        middle[m] = p[m]
    _rhs(current, p, slope, 0, tables, cells, constants, scratch, row, clamped)
    keep(slope, k, 0)
    relative(current, inverse, rel)
    dense(rel, low, 15, 1, product)
    nonlinear_part(slope, product, inverse, ring, 0)
    for n in range(steps):
        new, line = (now + 1) % 3, (newest + 1) % (past + 1)
        if changing:
            wind_at((n + 0.5) * h, cell_duration, wind_cells, middle)
            wind_at((n + 1) * h, cell_duration, wind_cells, p)
        if n < past - 1:
            integrate(
                current, starting, h / substeps, n * substeps, substeps, wind, model, clamped,
                inner_k, inner_p, inner_stage, inner_slope, inner_states,
            )  # fmt: skip
            move(current, ahead)
        else:
            sine_cosine(current, turned)
            state_rows(current, turned, inverse, seen)
            wind_row(start, seen, WIND_ROW)
            wind_row(middle, seen, WIND_ROW + 3)
            wind_row(p, seen, WIND_ROW + 6)
            for i in range(past):
                part_rows(ring, (newest - i) % (past + 1), turned, seen, PAST_ROW + PARTS * i)
            dense(seen, ahead_weights, new_row, BLOCKS, change)
            if hybrid:
                # a wrong place of the evaluation would spoil the fallback, too
                advanced(current, change, turned, fixed)
                dense(seen, plain_ahead_weights, new_row, BLOCKS, change)
                advanced(current, change, turned, other)
                guard(ahead, other, fixed, ahead_units, limit, norm, scaled, accepted, discrepancy)
            else:
                advanced(current, change, turned, ahead)
        _rhs(ahead, p, slope, 0, tables, cells, constants, scratch, row, clamped)
        relative(ahead, inverse, rel)
        dense(rel, low, 15, 1, product)
        nonlinear_part(slope, product, inverse, ring, line)
        if n >= past - 1:
            part_rows(ring, line, turned, seen, new_row)
            if len(factors) > 0:
                multiply(count, factors, seen)
            dense(seen, weights, inputs, BLOCKS, change)
            advanced(current, change, turned, fixed)
            if hybrid:
                dense(seen, plain_weights, count, BLOCKS, change)
                advanced(current, change, turned, other)
                guard(current, other, fixed, units, limit, norm, scaled, accepted, discrepancy)
            else:
                move(fixed, current)
            keep_largest_distance(current, ahead, largest)
        if not all_fine(current):
            all_diverged = mark_diverged(current, (n + 1) * h, diverged_at, restart)
            forget_infinite(ring)
        keep(current, states, new)
        # the output interpolates through three step ends at most
        if output < len(out_step) and out_step[output] <= n + 3:
            subtract(current, ahead, change)
            relative(change, inverse, rel)
            dense(rel, low, 15, 1, product)
            shifted_slope(slope, product, ratio, k, new)
        for m in range(WIND):
            start[m] = p[m]
        now, newest, first = new, line, output
        while output < len(out_step) and out_step[output] <= n + 1:
            write_output(output, exact, position, velocity, h, states, k, now, rows)
            output += 1
        if output > first:
            note_step((discrepancy, accepted), largest, current, status, first - 1)
        if all_diverged:
            break


def working_arrays(start, past, inputs, aligned):
    """`work` of the loop for the initial states `start` (WIDTH,), `past` nonlinear parts and `inputs` rows seen; aligned: copies onto
    cache lines."""
    wide = [aligned(np.zeros(WIDTH)) for _ in range(6)]  # slope, ahead, fixed, other, change, largest
    states, k = aligned(np.stack([start] * 3)), aligned(np.zeros((3, WIDTH)))
    winds = tuple(aligned(np.zeros(WIND)) for _ in range(3))
    ring = aligned(np.zeros((past + 1, PART)))
    seen, turned, rel, product = (aligned(np.zeros(size * LANES)) for size in (inputs, 2, 15, PARTS))
    buffers = (seen, ring, turned, rel, product)
    inner = (
        aligned(np.zeros((6, WIDTH))), aligned(np.zeros(WIND)), aligned(np.zeros(WIDTH)), aligned(np.zeros(WIDTH)),
        aligned(np.zeros((3, WIDTH))),
    )  # fmt: skip
    judged = (aligned(np.zeros(LANES)), np.ones(LANES, np.bool_), aligned(np.zeros(WIDTH)))
    return (states, k, aligned(start), aligned(start), *wide), winds, buffers, judged, inner
