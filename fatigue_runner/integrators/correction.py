"""Compiled: the learned defect of a Runge-Kutta step, chosen by the type of the map's data (see `protocol`).

What a map sees are rows [n][LANES], flat, as everywhere in the lane kernels. A new kind of map is a NamedTuple and a function that is
registered for it, as the two below are.
"""

from __future__ import annotations

import math

import numpy as np

from fatigue_runner.compiled import INLINE, LEAN, njit
from fatigue_runner.integrators.choice import compiled_for
from fatigue_runner.integrators.dense import BLOCK, dense_rows, multiply
from fatigue_runner.integrators.protocol import RawNetworkData, StageMapData
from fatigue_runner.layout import Layout
from fatigue_runner.turbine.lane_code import LANES
from fatigue_runner.turbine.model import constant, first_order, freedoms, rotor, rows, width, wind_signals


def stage_part(layout: Layout) -> int:
    """Rows of one stage: accelerations, of the shaft's twist in place of the generator's, and first-order slopes."""
    return layout.freedoms + len(layout.first_order)


def fixed_rows(layout: Layout) -> int:
    """Rows before the stages: 1, the relative state, wind at start, middle and end, sine and cosine of the azimuth."""
    return 1 + layout.relative_size + 3 * len(layout.wind) + 2


def raw_rows(layout: Layout) -> int:
    """1, the state as it is, the wind speed: what the paper's network sees."""
    return 1 + layout.size + 1


_first_stage = constant(fixed_rows)
_stage_part = constant(stage_part)
_first_wind = constant(lambda layout: 1 + layout.relative_size)
_raw_rows = constant(raw_rows)


@njit(**LEAN)
def features(model, x, k, stage_rows, h, ratio, start, middle, end, rows):
    """Rows of `corrector.features.stage_aware`: x the state, the stage slopes k[stage_rows], wind at three times."""
    inverse = 1.0 / ratio
    n, drive, more = freedoms(model), rotor(model), first_order(model)
    slip = 2 * n - 2
    for j in range(LANES):
        rows[j] = 1.0
        rows[(1 + drive) * LANES + j] = x[drive * LANES + j] - x[(drive + 1) * LANES + j] * inverse
        rows[(1 + slip) * LANES + j] = x[(n + drive) * LANES + j] - x[(n + drive + 1) * LANES + j] * inverse
    for m in range(drive * LANES):
        rows[LANES + m] = x[m]
    for m in range((n - 1) * LANES):
        rows[n * LANES + m] = x[n * LANES + m]
    for m in range(more * LANES):
        rows[(2 + slip) * LANES + m] = x[2 * n * LANES + m]
    wind, signals = _first_wind(model), wind_signals(model)
    for m in range(signals * LANES):
        rows[wind * LANES + m] = start[m]
        rows[(wind + signals) * LANES + m] = middle[m]
        rows[(wind + 2 * signals) * LANES + m] = end[m]
    turn = wind + 3 * signals
    for j in range(LANES):
        phi = x[drive * LANES + j]
        turns = math.floor(phi * 0.15915494309189535 + 0.5)
        q = (phi - turns * 6.283185307179586) * 0.25
        y = q * q
        # Taylor series to 1e-12 on a quarter of a turn's half: a corrector needs no more
        sine = q * (1.0 + y * (-1 / 6 + y * (1 / 120 + y * (-1 / 5040 + y * (1 / 362880 - y / 39916800)))))
        cosine = 1.0 + y * (-0.5 + y * (1 / 24 + y * (-1 / 720 + y * (1 / 40320 - y / 3628800))))
        double = 2.0 * sine * cosine
        cosine = 1.0 - 2.0 * sine * sine
        rows[turn * LANES + j] = 2.0 * double * cosine
        rows[(turn + 1) * LANES + j] = 1.0 - 2.0 * double * double
    for i in range(len(stage_rows)):
        s = stage_rows[i]
        # unsigned: numba's check for negative places keeps LLVM from vectorising
        first = np.uint64((_first_stage(model) + _stage_part(model) * i) * LANES)
        for m in range((n - 1) * LANES):
            rows[first + np.uint64(m)] = h * k[s, n * LANES + m]
        for j in range(LANES):
            slipping = k[s, (n + drive) * LANES + j] - k[s, (n + drive + 1) * LANES + j] * inverse
            rows[first + np.uint64((n - 1) * LANES + j)] = h * slipping
        for m in range(more * LANES):
            rows[first + np.uint64(n * LANES + m)] = h * k[s, 2 * n * LANES + m]


@njit(**LEAN)
def _remember(model, stages, history, rows):
    """Move the last step's first-stage rows behind the stages, before `features` overwrites them; older ones one place on."""
    part = _stage_part(model) * LANES
    first = _first_stage(model) * LANES + part * stages
    for m in range(first + part * history - 1, first + part - 1, -1):
        rows[m] = rows[m - part]
    if history > 0:
        for m in range(part):
            rows[first + m] = rows[_first_stage(model) * LANES + m]


@njit(**LEAN)
def raw_features(model, x, start, values):
    """Rows of the paper's network: 1, state, hub-height wind speed at the step's start."""
    for j in range(LANES):
        values[j] = 1.0
        values[(1 + rows(model)) * LANES + j] = start[j]
    for m in range(width(model)):
        values[LANES + m] = x[m]


IDENTITY, RELU, ISRU = 0, 1, 2  # activations


@njit(**LEAN)
def _activate(values, count, kind):
    """Apply an activation to `count` rows and append a row of ones for the next layer's bias."""
    size = count * LANES
    if kind == RELU:
        for m in range(size):
            values[m] = max(values[m], 0.0)
    elif kind == ISRU:
        # x / sqrt(1 + x^2): smooth, bounded, and made of vector instructions
        for m in range(size):
            values[m] = values[m] / math.sqrt(1.0 + values[m] * values[m])
    for j in range(LANES):
        values[size + j] = 1.0


@njit(**LEAN)
def _add_network(model, values, count, learned, hidden, out):
    """out += the network of `count` rows."""
    place, sizes = 0, learned.sizes
    layers = len(sizes) - 1
    for layer in range(layers):
        n_in = count if layer == 0 else sizes[layer] + 1
        blocks = (sizes[layer + 1] + BLOCK - 1) // BLOCK
        size = blocks * BLOCK * n_in
        source = values if layer == 0 else hidden[(layer - 1) % 2]
        dense_rows(source, learned.net[place : place + size], n_in, sizes[layer + 1], hidden[layer % 2])
        place += size
        if layer < layers - 1:
            _activate(hidden[layer % 2], sizes[layer + 1], learned.activation)
    last = hidden[(layers - 1) % 2]
    for m in range(width(model)):
        out[m] += last[m]


@njit(**LEAN)
def _clear(model, out):
    for m in range(width(model)):
        out[m] = 0.0


def correction(learned, model, x, k, stage_rows, h, start, middle, end, seen, hidden, out):
    """out = the learned defect of a step from x with the stage slopes k[stage_rows], under wind at its start, middle and end. Stub.

    seen: rows that the map sees, kept from step to step; hidden (2, ..): room for layers; out: room for whole blocks of `dense`.
    """
    raise NotImplementedError("compiled code only")


@compiled_for(correction, StageMapData)
@njit(**INLINE)
def _stage_map(learned, model, x, k, stage_rows, h, start, middle, end, seen, hidden, out):
    _remember(model, len(stage_rows), learned.history, seen)
    features(model, x, k, stage_rows, h, learned.ratio, start, middle, end, seen)
    count = _first_stage(model) + _stage_part(model) * (len(stage_rows) + learned.history)
    inputs = count
    if len(learned.factors) > 0:
        multiply(count, learned.factors, seen)
        inputs = (1 + len(learned.factors)) * count
    if len(learned.linear) > 0:
        dense_rows(seen, learned.linear, inputs, rows(model), out)
    else:
        _clear(model, out)
    if len(learned.net) > 0:
        _add_network(model, seen, count, learned, hidden, out)


@compiled_for(correction, RawNetworkData)
@njit(**INLINE)
def _raw_network(learned, model, x, k, stage_rows, h, start, middle, end, seen, hidden, out):
    raw_features(model, x, start, seen)
    _clear(model, out)
    _add_network(model, seen, _raw_rows(model), learned, hidden, out)
