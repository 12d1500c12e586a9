"""Compiled: the rows that a step in multi-blade coordinates sees, made from states, winds and slopes of LANES cases.

Blades stand in multi-blade coordinates at the azimuth of the step's start. Nonlinear parts are kept blade by blade and turned in
every step.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba.extending import overload

from fatigue_runner.compiled import INLINE, LEAN, njit
from fatigue_runner.integrators.multi_blade import STATE_ROW
from fatigue_runner.layout import BLADES, TRIPLE, WIND
from fatigue_runner.turbine.lane_code import LANES
from fatigue_runner.turbine.model import constant, first_order, freedoms, rotor, wind_signals

SIN60 = math.sqrt(0.75)
EVERY_WIND = len(WIND)  # speed and two shears; signals of a layout's own follow

relative_rows = constant(lambda layout: layout.relative_size)
first_harmonic = constant(lambda layout: layout.first_harmonic)
part_size = constant(lambda layout: layout.freedoms + len(layout.first_order))


def _sets(model):
    raise NotImplementedError("compiled code only")


@overload(_sets, inline="always")
def _sets_of_model(model) -> Any:
    first = model.model.layout.blade_sets
    return lambda model: first


@njit(**LEAN)
def sine_cosine(model, x, turned):
    """turned (2, LANES) = sine and cosine of the azimuth in the state x."""
    for j in range(LANES):
        phi = x[rotor(model) * LANES + j]
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
def relative(model, x, inverse, rows, to):
    """Rows `to` on: deflections, twist, rates, rate of twist, first-order states, blade by blade."""
    n, drive = freedoms(model), rotor(model)
    slip = 2 * n - 2
    for m in range(drive * LANES):
        rows[to * LANES + m] = x[m]
    for m in range((n - 1) * LANES):
        rows[(to + n - 1) * LANES + m] = x[n * LANES + m]
    for j in range(LANES):
        rows[(to + drive) * LANES + j] = x[drive * LANES + j] - x[(drive + 1) * LANES + j] * inverse
        rows[(to + slip) * LANES + j] = x[(n + drive) * LANES + j] - x[(n + drive + 1) * LANES + j] * inverse
    for m in range(first_order(model) * LANES):
        rows[(to + slip + 1) * LANES + m] = x[2 * n * LANES + m]


@njit(**LEAN)
def state_rows(model, x, turned, inverse, rows):
    """The first rows: 1, then the relative state."""
    for j in range(LANES):
        rows[j] = 1.0
    relative(model, x, inverse, rows, STATE_ROW)
    for first in _sets(model):
        to_fixed(x, first, turned, rows, STATE_ROW + first)
        to_fixed(x, freedoms(model) + first, turned, rows, STATE_ROW + freedoms(model) - 1 + first)


@njit(**LEAN)
def wind_rows(model, p, rows, to):
    """Wind speed, and the wind that the shears add at the rotor's edge; other signals as they are."""
    for j in range(LANES):
        v = p[j]
        rows[to * LANES + j] = v
        rows[(to + 1) * LANES + j] = v * p[LANES + j]
        rows[(to + 2) * LANES + j] = v * p[2 * LANES + j]
    for m in range(EVERY_WIND * LANES, wind_signals(model) * LANES):
        rows[to * LANES + m] = p[m]


@njit(**LEAN)
def _thrice(model, x, ahead, turned, turn):
    """turn = sine and cosine of three times the azimuth `ahead` [s] of the state x, whose own are `turned`; then 0 and 1, twice."""
    for j in range(LANES):
        d = x[(freedoms(model) + rotor(model)) * LANES + j] * ahead
        y = d * d
        # Taylor series: a rotor turns by a small angle in a step
        sine = d * (1.0 + y * (-1 / 6 + y * (1 / 120 - y / 5040)))
        cosine = 1.0 + y * (-0.5 + y * (1 / 24 - y / 720))
        s = turned[j] * cosine + turned[LANES + j] * sine
        c = turned[LANES + j] * cosine - turned[j] * sine
        turn[j] = s * (3.0 - 4.0 * s * s)
        turn[LANES + j] = c * (4.0 * c * c - 3.0)
        turn[2 * LANES + j] = 0.0
        turn[3 * LANES + j] = 1.0


@njit(**LEAN)
def _clear(rows, to):
    place = np.uint64(to * LANES)
    for m in range(BLADES * LANES):
        rows[place + np.uint64(m)] = 0.0


@njit(**LEAN)
def _add_triple(p, first, turn, rows, to):
    """Add harmonics 3k + 1, 3k + 2, 3k + 3, whose amplitudes are the rows `first` on of p; turn: sine and cosine of 3 azimuths, of 3k."""
    place, c1 = np.uint64(to * LANES), np.uint64(first * LANES)
    lanes = np.uint64(LANES)
    for i in range(LANES):
        j = np.uint64(i)
        s3, c3 = turn[j], turn[lanes + j]
        s, c = turn[2 * lanes + j], turn[3 * lanes + j]
        s_next, c_next = s * c3 + c * s3, c * c3 - s * s3
        a, b = p[c1 + j], p[c1 + lanes + j]
        e, f = p[c1 + 2 * lanes + j], p[c1 + 3 * lanes + j]
        g, h = p[c1 + 4 * lanes + j], p[c1 + 5 * lanes + j]
        rows[place + j] += g * c_next + h * s_next
        rows[place + lanes + j] += (a * c + b * s) + (e * c_next + f * s_next)
        rows[place + 2 * lanes + j] += (b * c - a * s) + (e * s_next - f * c_next)
        turn[2 * lanes + j], turn[3 * lanes + j] = s_next, c_next


@njit(**INLINE)
def harmonic_rows(model, x, ahead, p, turned, turn, rows, to):
    """Rows `to` on = mean, cosine and sine part over the blades of the azimuthal harmonics in p [m/s], felt where the blades stand `ahead`
    [s] of the state x at its speed; turned: sine and cosine of the azimuth in x; turn: room."""
    first = first_harmonic(model)
    _thrice(model, x, ahead, turned, turn)
    _clear(rows, to)
    for triple in range((len(p) // LANES - first) // (2 * TRIPLE)):
        _add_triple(p, first + 2 * TRIPLE * triple, turn, rows, to)


@njit(**LEAN)
def part_rows(model, ring, line, turned, rows, to):
    """Rows `to` on = nonlinear part `line` of the ring, turned; unsigned places: numba's check for negative ones costs the vectors."""
    place = np.uint64(to * LANES)
    for m in range(part_size(model) * LANES):
        rows[place + np.uint64(m)] = ring[line, m]
    for first in _sets(model):
        for j in range(LANES):
            one, two, three = (
                ring[line, first * LANES + j],
                ring[line, (first + 1) * LANES + j],
                ring[line, (first + 2) * LANES + j],
            )
            along = (2.0 * one - two - three) * (1.0 / 3.0)
            across = (two - three) * (2.0 / 3.0 * SIN60)
            sine, cosine = turned[j], turned[LANES + j]
            rows[place + np.uint64(first * LANES + j)] = (one + two + three) * (1.0 / 3.0)
            rows[place + np.uint64((first + 1) * LANES + j)] = cosine * along - sine * across
            rows[place + np.uint64((first + 2) * LANES + j)] = sine * along + cosine * across


@njit(**LEAN)
def _add_rows(x, change, first, count, out):
    """out = x + change in `count` rows from `first` on."""
    for m in range(first * LANES, (first + count) * LANES):
        out[m] = x[m] + change[m]


@njit(**LEAN)
def _add_blades(x, change, turned, row, out):
    """out = x + change in three rows, the change given in multi-blade coordinates."""
    first = row * LANES
    for j in range(LANES):
        sine, cosine = turned[j], turned[LANES + j]
        mean = change[first + j]
        c, s = change[first + LANES + j], change[first + 2 * LANES + j]
        along, across = cosine * c + sine * s, SIN60 * (cosine * s - sine * c)
        out[first + j] = x[first + j] + (mean + along)
        out[first + LANES + j] = x[first + LANES + j] + (mean - 0.5 * along + across)
        out[first + 2 * LANES + j] = x[first + 2 * LANES + j] + (mean - 0.5 * along - across)


@njit(**LEAN)
def advanced(model, x, change, turned, out):
    """out = x + change, the change given in multi-blade coordinates."""
    n = freedoms(model)
    _add_rows(x, change, 0, 2 * n + first_order(model), out)
    for first in _sets(model):
        _add_blades(x, change, turned, first, out)
        _add_blades(x, change, turned, n + first, out)


@njit(**LEAN)
def nonlinear_part(model, slope, product, inverse, ring, line):
    """ring[line] = accelerations and first-order slopes without their linear part `product`; the twist's in the generator's place."""
    n = freedoms(model)
    for m in range(part_size(model) * LANES):
        ring[line, m] = slope[n * LANES + m] - product[m]
    for j in range(LANES):
        twist = slope[(2 * n - 2) * LANES + j] - slope[(2 * n - 1) * LANES + j] * inverse
        ring[line, (n - 1) * LANES + j] = twist - product[(n - 1) * LANES + j]


@njit(**LEAN)
def shifted_slope(model, slope, shift, ratio, k, line):
    """k[line] = accelerations and first-order slopes in `slope`, moved by the linear part's `shift`; the output interpolates with them."""
    n = freedoms(model)
    for m in range(part_size(model) * LANES):
        k[line, n * LANES + m] = slope[n * LANES + m] + shift[m]
    for j in range(LANES):
        change = ratio * (shift[(n - 2) * LANES + j] - shift[(n - 1) * LANES + j])
        k[line, (2 * n - 1) * LANES + j] = slope[(2 * n - 1) * LANES + j] + change


@njit(nogil=True, error_model="numpy", _nrt=False)
def forget_infinite(ring):
    """Nonlinear parts of a lane that has diverged must not reach it again after its restart: a strict function, NaN counts."""
    for line in range(ring.shape[0]):
        for m in range(ring.shape[1]):
            if not abs(ring[line, m]) < 1e30:
                ring[line, m] = 0.0
