"""Compiled pieces of a time step of one group of LANES cases in lockstep; `loops` puts them together.

`LEAN` lets LLVM assume that there is no NaN, so the divergence check compares bits, not numbers. Loops over the state have the
constant length WIDTH and write to one array, so that they vectorise. Whole arrays and row numbers are passed, never rows.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.core import types
from numba.extending import overload

from fatigue_runner.compiled import INLINE, LEAN, njit
from fatigue_runner.integrators.vectors import WIDTH, stage_sum
from fatigue_runner.turbine.generated.kernel import LANES

HALF = 8 * LANES
WIND = 3 * LANES

# No state of this turbine comes near these values; beyond them a case has diverged. Azimuths grow without limit.
STATE_BOUND = 1e4
AZIMUTH_BOUND = 1e9
STATE_BITS, AZIMUTH_BITS = (int(np.float64(bound).view(np.int64)) for bound in (STATE_BOUND, AZIMUTH_BOUND))
MAGNITUDE = 2**63 - 1  # all bits of a double but its sign


@njit(nogil=True, error_model="numpy", _nrt=False)
def all_fine(x):
    """Whether all lanes are within the bounds, compared as integers.

    The magnitudes of doubles are ordered as their bits, infinity and NaN above every number; as doubles, LLVM would assume after
    inlining that what a fastmath loop has stored is no NaN (seen: runs that diverged with NaN and were not marked).
    """
    words = x.view(np.int64)
    outside = 0
    for m in range(6 * LANES):
        outside += 1 if (words[m] & MAGNITUDE) >= STATE_BITS else 0
    for m in range(6 * LANES, 8 * LANES):
        outside += 1 if (words[m] & MAGNITUDE) >= AZIMUTH_BITS else 0
    for m in range(8 * LANES, 16 * LANES):
        outside += 1 if (words[m] & MAGNITUDE) >= STATE_BITS else 0
    return outside == 0


@njit(nogil=True, error_model="numpy", _nrt=False)
def mark_diverged(x, time, diverged_at, restart):
    """Note the time for lanes that left the bounds and put them on their `restart` state, so that they stay finite.

    Returns whether all lanes have diverged by now.
    """
    words = x.view(np.int64)
    count = 0
    for j in range(LANES):
        bad = False
        for i in range(16):
            bound = AZIMUTH_BITS if i == 6 or i == 7 else STATE_BITS
            bad = bad or (words[i * LANES + j] & MAGNITUDE) >= bound
        if bad:
            if diverged_at[j] < 0.0:
                diverged_at[j] = time
            for i in range(16):
                x[i * LANES + j] = restart[i * LANES + j]
        count += 1 if diverged_at[j] >= 0.0 else 0
    return count == LANES


@njit(**LEAN)
def _wind_cells(time, cell_duration, cells, p):
    # 0.3 / 0.1 is 2.9999999999999996: a step time belongs to the cell that begins there
    i = min(max(int(time / cell_duration + 1e-9), 0), cells.shape[0] - 1)
    u = time - i * cell_duration
    for m in range(WIND):
        p[m] = ((cells[i, 3, m] * u + cells[i, 2, m]) * u + cells[i, 1, m]) * u + cells[i, 0, m]


@njit(**LEAN)
def _pitch_cells(time, cell_duration, cells, p):
    i = min(max(int(time / cell_duration + 1e-9), 0), cells.shape[0] - 1)
    u = time - i * cell_duration
    pitch = ((cells[i, 3] * u + cells[i, 2]) * u + cells[i, 1]) * u + cells[i, 0]
    for m in range(WIND, WIND + LANES):
        p[m] = pitch


def _signals(time, cell_duration, cells, p):
    raise NotImplementedError("compiled code only")


@overload(_signals, inline="always")
def _signals_by_type(time, cell_duration, cells, p):
    if isinstance(cells, types.Array):

        def wind(time, cell_duration, cells, p):
            _wind_cells(time, cell_duration, cells, p)

        return wind

    def wind_and_pitch(time, cell_duration, cells, p):
        _wind_cells(time, cell_duration, cells[0], p)
        _pitch_cells(time, cells[1], cells[2], p)

    return wind_and_pitch


@njit(**LEAN)
def wind_at(time, cell_duration, cells, p):
    """Piecewise cubic wind signals: cells (n, 4, WIND) -> p (WIND,).

    Where the pitch varies, cells = (wind cells, duration of the pitch's cells, its cells (n, 4)) and p (WIND + LANES,).
    """
    _signals(time, cell_duration, cells, p)


_combined: Any = stage_sum(None)  # intrinsics, whose first argument numba supplies
_advanced: Any = stage_sum((STATE_BITS, AZIMUTH_BITS))


@njit(**INLINE)
def combine(states, now, k, rows, weights, line, count, h, out):
    """out = states[now] + h sum_j weights[line, j] k[rows[line, j]], j < count."""
    _combined(states, now, k, rows, weights, line, count, h, out, now)


@njit(**INLINE)
def advance(states, now, new, k, rows, weights, line, count, h, out):
    """As `combine`, stored in states[new] too; returns `all_fine(out)`."""
    return _advanced(states, now, k, rows, weights, line, count, h, out, new)


@njit(**LEAN)
def keep(values, table, line):
    """table[line] = values"""
    for m in range(WIDTH):
        table[line, m] = values[m]


@njit(**LEAN)
def move(table, line, to):
    """table[to] = table[line]"""
    for m in range(WIDTH):
        table[to, m] = table[line, m]


@njit(**LEAN)
def largest_error(k, rows, weights, count, h, largest):
    """largest = max(largest, |h sum_j weights[0, j] k[rows[0, j]]|), element by element; at most eight terms."""
    a, p = h * weights[0, 0], rows[0, 0]
    b, q = h * weights[0, 1], rows[0, 1]
    c, r = h * weights[0, 2], rows[0, 2]
    d, s = h * weights[0, 3], rows[0, 3]
    if count <= 4:
        for m in range(WIDTH):
            e = (a * k[p, m] + b * k[q, m]) + (c * k[r, m] + d * k[s, m])
            largest[m] = max(largest[m], abs(e))
    else:
        a2, p2 = h * weights[0, 4], rows[0, 4]
        b2, q2 = h * weights[0, 5], rows[0, 5]
        c2, r2 = h * weights[0, 6], rows[0, 6]
        d2, s2 = h * weights[0, 7], rows[0, 7]
        for m in range(WIDTH):
            e = (a * k[p, m] + b * k[q, m]) + (c * k[r, m] + d * k[s, m])
            f = (a2 * k[p2, m] + b2 * k[q2, m]) + (c2 * k[r2, m] + d2 * k[s2, m])
            largest[m] = max(largest[m], abs(e + f))


@njit(**LEAN)
def scaled_error(largest, x, errors, interval):
    """errors[interval] (LANES,) = largest component of `largest` / (1 + |x|), per lane; `largest` starts anew."""
    for m in range(WIDTH):
        largest[m] /= 1.0 + abs(x[m])
    # halves against each other: a loop over the states inside would be unrolled and not vectorised
    for half in (8, 4, 2, 1):
        for m in range(half * LANES):
            largest[m] = max(largest[m], largest[half * LANES + m])
    for j in range(LANES):
        errors[interval, j] = largest[j]
    for m in range(WIDTH):
        largest[m] = 0.0


@njit(**LEAN)
def note_step(judged, largest, x, status, interval):
    """status = (accepted, discrepancy, local error)[interval] = what has come up since the last note, which starts anew.

    judged = (discrepancy, accepted) (LANES,); see `scaled_error` for the local error.
    """
    discrepancy, accepted = judged
    accepted_out, discrepancy_out, error_out = status
    scaled_error(largest, x, error_out, interval)
    for j in range(LANES):
        accepted_out[interval, j] = accepted[j]
        discrepancy_out[interval, j] = discrepancy[j]
        discrepancy[j] = 0.0
        accepted[j] = True


@njit(**LEAN)
def write_output(output, exact, position, velocity, h, states, k, newest, rows):
    """Write output row `output`: the newest step end, or the Hermite polynomial through the last three.

    states (3, WIDTH), slopes k (.., WIDTH): rings of three step ends, `newest` the last; position, velocity (n, 9): weights of
    value, h slope, h^2 curvature, node by node, for positions and for h times velocities.
    """
    n0, n1, n2 = (newest + 1) % 3, (newest + 2) % 3, newest
    if exact[output]:
        for m in range(WIDTH):
            rows[output, m] = states[n2, m]
    else:
        o = output
        a0, a1, a2 = position[o, 0], position[o, 1] * h, position[o, 2] * h * h
        b0, b1, b2 = position[o, 3], position[o, 4] * h, position[o, 5] * h * h
        c0, c1, c2 = position[o, 6], position[o, 7] * h, position[o, 8] * h * h
        for m in range(HALF):
            rows[o, m] = (
                (a0 * states[n0, m] + a1 * states[n0, HALF + m] + a2 * k[n0, HALF + m])
                + (b0 * states[n1, m] + b1 * states[n1, HALF + m] + b2 * k[n1, HALF + m])
                + (c0 * states[n2, m] + c1 * states[n2, HALF + m] + c2 * k[n2, HALF + m])
            )
        a0, a1, a2 = velocity[o, 0] / h, velocity[o, 1], velocity[o, 2] * h
        b0, b1, b2 = velocity[o, 3] / h, velocity[o, 4], velocity[o, 5] * h
        c0, c1, c2 = velocity[o, 6] / h, velocity[o, 7], velocity[o, 8] * h
        for m in range(HALF):
            rows[o, HALF + m] = (
                (a0 * states[n0, m] + a1 * states[n0, HALF + m] + a2 * k[n0, HALF + m])
                + (b0 * states[n1, m] + b1 * states[n1, HALF + m] + b2 * k[n1, HALF + m])
                + (c0 * states[n2, m] + c1 * states[n2, HALF + m] + c2 * k[n2, HALF + m])
            )
