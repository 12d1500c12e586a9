"""Compiled pieces of a time step of one group of LANES cases in lockstep; `stepper` and the families put them together.

`LEAN` lets LLVM assume that there is no NaN, so the divergence check compares bits, not numbers. Loops over the state have a length
that is constant for a model and write to one array, so that they vectorise. Whole arrays and row numbers are passed, never rows.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fatigue_runner.compiled import INLINE, LEAN, njit
from fatigue_runner.integrators.vectors import AZIMUTH_BITS, STATE_BITS, stage_sum
from fatigue_runner.turbine.lane_code import LANES
from fatigue_runner.turbine.model import first_order, freedoms, padded_rows, rotor, rows, width

MAGNITUDE = 2**63 - 1  # all bits of a double but its sign


@njit(nogil=True, error_model="numpy", _nrt=False)
def all_fine(model, x):
    """Whether all lanes are within the bounds, compared as integers.

    As doubles, LLVM would assume after inlining that what a fastmath loop has stored is no NaN (seen: runs that diverged with NaN
    and were not marked).
    """
    words = x.view(np.int64)
    outside = 0
    for m in range(rotor(model) * LANES):
        outside += 1 if (words[m] & MAGNITUDE) >= STATE_BITS else 0
    for m in range(rotor(model) * LANES, freedoms(model) * LANES):
        outside += 1 if (words[m] & MAGNITUDE) >= AZIMUTH_BITS else 0
    for m in range(freedoms(model) * LANES, width(model)):
        outside += 1 if (words[m] & MAGNITUDE) >= STATE_BITS else 0
    return outside == 0


@njit(nogil=True, error_model="numpy", _nrt=False)
def mark_diverged(model, x, time, diverged_at, restart):
    """Note the time for lanes that left the bounds and put them on their `restart` state, so that they stay finite.

    Returns whether all lanes have diverged by now.
    """
    words = x.view(np.int64)
    count = 0
    for j in range(LANES):
        bad = False
        for i in range(rows(model)):
            bound = AZIMUTH_BITS if rotor(model) <= i < freedoms(model) else STATE_BITS
            bad = bad or (words[i * LANES + j] & MAGNITUDE) >= bound
        if bad:
            if diverged_at[j] < 0.0:
                diverged_at[j] = time
            for i in range(rows(model)):
                x[i * LANES + j] = restart[i * LANES + j]
        count += 1 if diverged_at[j] >= 0.0 else 0
    return count == LANES


_combined: Any = stage_sum(False)  # intrinsics, whose first argument numba supplies
_advanced: Any = stage_sum(True)


@njit(**INLINE)
def combine(model, states, now, k, rows, weights, line, count, h, out):
    """out = states[now] + h sum_j weights[line, j] k[rows[line, j]], j < count."""
    _combined(model, states, now, k, rows, weights, line, count, h, out, now)


@njit(**INLINE)
def combine_new(model, states, now, new, k, rows, weights, line, count, h, out):
    """As `combine`, stored in states[new] too; returns `all_fine(out)`."""
    return _advanced(model, states, now, k, rows, weights, line, count, h, out, new)


@njit(**LEAN)
def keep(model, values, table, line):
    """table[line] = values"""
    for m in range(width(model)):
        table[line, m] = values[m]


@njit(**LEAN)
def move_line(model, table, line, to):
    """table[to] = table[line]"""
    for m in range(width(model)):
        table[to, m] = table[line, m]


@njit(**LEAN)
def move(model, source, target):
    """target = source"""
    for m in range(width(model)):
        target[m] = source[m]


@njit(**LEAN)
def add(model, a, b, out):
    """out = a + b"""
    for m in range(width(model)):
        out[m] = a[m] + b[m]


@njit(**LEAN)
def subtract(model, a, b, out):
    """out = a - b"""
    for m in range(width(model)):
        out[m] = a[m] - b[m]


@njit(**LEAN)
def keep_largest(model, values, largest):
    """largest = max(largest, |values|)"""
    for m in range(width(model)):
        largest[m] = max(largest[m], abs(values[m]))


@njit(**LEAN)
def keep_largest_distance(model, a, b, largest):
    """largest = max(largest, |a - b|)"""
    for m in range(width(model)):
        largest[m] = max(largest[m], abs(a[m] - b[m]))


@njit(**LEAN)
def largest_error(model, k, rows, weights, count, h, largest):
    """largest = max(largest, |h sum_j weights[0, j] k[rows[0, j]]|), element by element; at most eight terms."""
    a, p = h * weights[0, 0], rows[0, 0]
    b, q = h * weights[0, 1], rows[0, 1]
    c, r = h * weights[0, 2], rows[0, 2]
    d, s = h * weights[0, 3], rows[0, 3]
    if count <= 4:
        for m in range(width(model)):
            e = (a * k[p, m] + b * k[q, m]) + (c * k[r, m] + d * k[s, m])
            largest[m] = max(largest[m], abs(e))
    else:
        a2, p2 = h * weights[0, 4], rows[0, 4]
        b2, q2 = h * weights[0, 5], rows[0, 5]
        c2, r2 = h * weights[0, 6], rows[0, 6]
        d2, s2 = h * weights[0, 7], rows[0, 7]
        for m in range(width(model)):
            e = (a * k[p, m] + b * k[q, m]) + (c * k[r, m] + d * k[s, m])
            f = (a2 * k[p2, m] + b2 * k[q2, m]) + (c2 * k[r2, m] + d2 * k[s2, m])
            largest[m] = max(largest[m], abs(e + f))


@njit(**LEAN)
def scaled_error(model, largest, x, errors, interval):
    """errors[interval] (LANES,) = largest component of `largest` / (1 + |x|), per lane; `largest` starts anew.

    largest (padded_rows * LANES,): a power of two of rows, those beyond the state stay zero.
    """
    for m in range(width(model)):
        largest[m] /= 1.0 + abs(x[m])
    # halves against each other: a loop over the states inside would be unrolled and not vectorised
    half = padded_rows(model) // 2
    while half > 0:
        for m in range(half * LANES):
            largest[m] = max(largest[m], largest[half * LANES + m])
        half //= 2
    for j in range(LANES):
        errors[interval, j] = largest[j]
    for m in range(padded_rows(model) * LANES):
        largest[m] = 0.0


@njit(**LEAN)
def note_step(model, judged, largest, x, out, interval):
    """out.accepted, discrepancy, errors [interval] = what has come up since the last note, which starts anew.

    judged = (discrepancy, accepted) (LANES,); see `scaled_error` for the local error.
    """
    discrepancy, accepted = judged
    scaled_error(model, largest, x, out.errors, interval)
    for j in range(LANES):
        out.accepted[interval, j] = accepted[j]
        out.discrepancy[interval, j] = discrepancy[j]
        discrepancy[j] = 0.0
        accepted[j] = True


@njit(**LEAN)
def write_output(model, output, plan, h, states, k, newest, rows):
    """Write output row `output`: the newest step end, or the Hermite polynomial through the last three.

    states (3, width), slopes k (.., width): rings of three step ends, `newest` the last; plan: `output.PlanArrays`.
    """
    n0, n1, n2 = (newest + 1) % 3, (newest + 2) % 3, newest
    o, line, half = output, plan.line[output], freedoms(model) * LANES
    if plan.exact[o]:
        for m in range(width(model)):
            rows[o, m] = states[n2, m]
    else:
        w = plan.position
        a0, a1, a2 = w[line, 0], w[line, 1] * h, w[line, 2] * h * h
        b0, b1, b2 = w[line, 3], w[line, 4] * h, w[line, 5] * h * h
        c0, c1, c2 = w[line, 6], w[line, 7] * h, w[line, 8] * h * h
        for m in range(half):
            rows[o, m] = (
                (a0 * states[n0, m] + a1 * states[n0, half + m] + a2 * k[n0, half + m])
                + (b0 * states[n1, m] + b1 * states[n1, half + m] + b2 * k[n1, half + m])
                + (c0 * states[n2, m] + c1 * states[n2, half + m] + c2 * k[n2, half + m])
            )
        w = plan.velocity
        a0, a1, a2 = w[line, 0] / h, w[line, 1], w[line, 2] * h
        b0, b1, b2 = w[line, 3] / h, w[line, 4], w[line, 5] * h
        c0, c1, c2 = w[line, 6] / h, w[line, 7], w[line, 8] * h
        for m in range(half):
            rows[o, half + m] = (
                (a0 * states[n0, m] + a1 * states[n0, half + m] + a2 * k[n0, half + m])
                + (b0 * states[n1, m] + b1 * states[n1, half + m] + b2 * k[n1, half + m])
                + (c0 * states[n2, m] + c1 * states[n2, half + m] + c2 * k[n2, half + m])
            )
        if first_order(model) > 0:
            w = plan.first_order
            a0, a1, b0 = w[line, 0], w[line, 1] * h, w[line, 2]
            b1, c0, c1 = w[line, 3] * h, w[line, 4], w[line, 5] * h
            for m in range(2 * half, width(model)):
                rows[o, m] = (
                    (a0 * states[n0, m] + a1 * k[n0, m])
                    + (b0 * states[n1, m] + b1 * k[n1, m])
                    + (c0 * states[n2, m] + c1 * k[n2, m])
                )
