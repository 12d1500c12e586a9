"""Compiled pieces of a corrected step: what a corrector sees of a step, and dense layers over lanes.

Rows are [n][LANES], flat, as everywhere in the lane kernels.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

from fatigue_runner.compiled import FAST, LEAN, njit
from fatigue_runner.turbine.generated.kernel import LANES

BLOCK = 8  # outputs of a dense layer that are summed up side by side
VECTOR = 8  # doubles in a vector; LLVM splits it where the machine's are shorter

# rows before the stage accelerations: 1, six deflections, shaft twist, eight velocities, wind at start, middle and end, sin, cos
FIXED_ROWS = 27


@njit(**LEAN)
def features(x, k, stage_rows, h, ratio, start, middle, end, rows):
    """Rows of `corrector.features.names(stages)`: x (16, LANES), the stage slopes k[stage_rows], wind at three times."""
    inverse = 1.0 / ratio
    for j in range(LANES):
        rows[j] = 1.0
        rows[7 * LANES + j] = x[6 * LANES + j] - x[7 * LANES + j] * inverse
        rows[15 * LANES + j] = x[14 * LANES + j] - x[15 * LANES + j] * inverse
    for m in range(6 * LANES):
        rows[LANES + m] = x[m]
    for m in range(7 * LANES):
        rows[8 * LANES + m] = x[8 * LANES + m]
    for m in range(3 * LANES):
        rows[16 * LANES + m] = start[m]
        rows[19 * LANES + m] = middle[m]
        rows[22 * LANES + m] = end[m]
    for j in range(LANES):
        phi = x[6 * LANES + j]
        turns = math.floor(phi * 0.15915494309189535 + 0.5)
        q = (phi - turns * 6.283185307179586) * 0.25
        y = q * q
        # Taylor series to 1e-12 on a quarter of a turn's half: a corrector needs no more
        sine = q * (1.0 + y * (-1 / 6 + y * (1 / 120 + y * (-1 / 5040 + y * (1 / 362880 - y / 39916800)))))
        cosine = 1.0 + y * (-0.5 + y * (1 / 24 + y * (-1 / 720 + y * (1 / 40320 - y / 3628800))))
        double = 2.0 * sine * cosine
        cosine = 1.0 - 2.0 * sine * sine
        rows[25 * LANES + j] = 2.0 * double * cosine
        rows[26 * LANES + j] = 1.0 - 2.0 * double * double
    for i in range(len(stage_rows)):
        s = stage_rows[i]
        # unsigned: numba's check for negative places keeps LLVM from vectorising
        first = np.uint64((FIXED_ROWS + 8 * i) * LANES)
        for m in range(7 * LANES):
            rows[first + np.uint64(m)] = h * k[s, 8 * LANES + m]
        for j in range(LANES):
            slip = k[s, 14 * LANES + j] - k[s, 15 * LANES + j] * inverse
            rows[first + np.uint64(7 * LANES + j)] = h * slip


@njit(**LEAN)
def remember(stages, history, rows):
    """Move the last step's first-stage rows behind the stages, before `features` overwrites them; older ones one place on."""
    first = (FIXED_ROWS + 8 * stages) * LANES
    for m in range(first + 8 * LANES * history - 1, first + 8 * LANES - 1, -1):
        rows[m] = rows[m - 8 * LANES]
    if history > 0:
        for m in range(8 * LANES):
            rows[first + m] = rows[FIXED_ROWS * LANES + m]


@intrinsic
def dense(typing_context, rows, weights, inputs, blocks, out):
    """out = weights . rows for all lanes: rows (inputs, LANES), weights from `pack`, out (8 blocks, LANES), all flat.

    Written in LLVM's vector types: eight outputs of all lanes stay in registers while the inputs pass by, each weight is one
    broadcast. From Python loops LLVM spills the broadcasts, which costs four times as much (measured: 110 instead of 25 ns a lane
    for 59 inputs and 16 outputs).
    """
    array = types.Array(types.float64, 1, "C")
    signature = types.void(array, array, types.int64, types.int64, array)
    vector = ir.VectorType(ir.DoubleType(), VECTOR)
    parts = LANES // VECTOR

    def codegen(context, builder, sig, args):
        def data(i):
            return context.make_array(sig.args[i])(context, builder, args[i]).data

        def at(pointer, index):
            return builder.bitcast(builder.gep(pointer, [index]), vector.as_pointer())

        def aligned(value):
            value.align = 8
            return value

        word = ir.IntType(64)
        row, weight, result = data(0), data(1), data(4)
        count = args[2]
        lanes, block_size = word(LANES), word(BLOCK)
        with cgutils.for_range(builder, args[3]) as block:
            sums = [cgutils.alloca_once(builder, vector) for _ in range(BLOCK * parts)]
            for slot in sums:
                builder.store(ir.Constant(vector, [0.0] * VECTOR), slot)
            first_weight = builder.mul(builder.mul(block.index, count), block_size)
            with cgutils.for_range(builder, count) as feature:
                place = builder.mul(feature.index, lanes)
                x = [
                    aligned(builder.load(at(row, builder.add(place, word(p * VECTOR))))) for p in range(parts)
                ]
                base = builder.add(first_weight, builder.mul(feature.index, block_size))
                for o in range(BLOCK):
                    w = builder.load(builder.gep(weight, [builder.add(base, word(o))]))
                    undefined = ir.Constant(vector, ir.Undefined)
                    single = builder.insert_element(undefined, w, ir.IntType(32)(0))
                    mask = ir.Constant(ir.VectorType(ir.IntType(32), VECTOR), [0] * VECTOR)
                    splat = builder.shuffle_vector(single, undefined, mask)
                    for p in range(parts):
                        slot = sums[o * parts + p]
                        # contract: one fused multiply-add
                        product = builder.fmul(splat, x[p], flags=("contract",))
                        builder.store(builder.fadd(builder.load(slot), product, flags=("contract",)), slot)
            target = builder.mul(builder.mul(block.index, block_size), lanes)
            for i, slot in enumerate(sums):
                aligned(builder.store(builder.load(slot), at(result, builder.add(target, word(i * VECTOR)))))
        return context.get_dummy_value()

    return signature, codegen


_dense: Any = dense  # its first argument is supplied by numba


def pack(weights: np.ndarray) -> tuple[np.ndarray, int]:
    """(n_out, n_in) weights in the order that `dense` reads, outputs padded to whole blocks; and the number of blocks."""
    n_out, n_in = weights.shape
    blocks = -(-n_out // BLOCK)
    padded = np.zeros((blocks * BLOCK, n_in))
    padded[:n_out] = weights
    return np.ascontiguousarray(padded.reshape(blocks, BLOCK, n_in).transpose(0, 2, 1)).ravel(), blocks


@intrinsic
def times_row(typing_context, rows, first, count, factor):
    """rows[first : first + count] = rows[: count] times row `factor`, all (LANES,); in vector types, since LLVM cannot know that the
    rows of one array do not overlap (measured: 16 instead of 2 ns a lane for 59 rows)."""
    array = types.Array(types.float64, 1, "C")
    signature = types.void(array, types.int64, types.int64, types.int64)
    vector = ir.VectorType(ir.DoubleType(), VECTOR)

    def codegen(context, builder, sig, args):
        data = context.make_array(sig.args[0])(context, builder, args[0]).data
        word = ir.IntType(64)
        lanes = word(LANES)

        def at(index):
            return builder.bitcast(builder.gep(data, [index]), vector.as_pointer())

        def place(row, part):
            return builder.add(builder.mul(row, lanes), word(part * VECTOR))

        parts = range(LANES // VECTOR)
        by = [builder.load(at(place(args[3], p))) for p in parts]
        for value in by:
            value.align = 8
        with cgutils.for_range(builder, args[2]) as row:
            for p in parts:
                value = builder.load(at(place(row.index, p)))
                value.align = 8
                target = at(place(builder.add(args[1], row.index), p))
                builder.store(builder.fmul(value, by[p]), target).align = 8
        return context.get_dummy_value()

    return signature, codegen


_times_row: Any = times_row  # its first argument is supplied by numba


@njit(**LEAN)
def multiply(count, factors, rows):
    """Append rows 0..count times row `factors[i]`, for every i."""
    for f in range(len(factors)):
        _times_row(rows, (f + 1) * count, count, factors[f])


RAW_ROWS = 18  # 1, the 16 states as they are, the wind speed: what the paper's network sees
IDENTITY, RELU, ISRU = 0, 1, 2  # activations


@njit(**LEAN)
def raw_features(x, start, rows):
    """Rows of the paper's network: 1, state, hub-height wind speed at the step's start."""
    for j in range(LANES):
        rows[j] = 1.0
        rows[17 * LANES + j] = start[j]
    for m in range(16 * LANES):
        rows[LANES + m] = x[m]


@njit(**LEAN)
def activate(values, count, kind):
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


@njit(**FAST)
def correction(x, k, stage_rows, h, start, middle, end, network, rows, hidden, out):
    """out (16, LANES) = linear part of the features plus a network of the features: the learned defect of the step.

    network = (raw, ratio, history, factors, linear weights, net weights, sizes, activation): the linear part sees all rows, and all
    rows times each row of `factors`; `history` earlier steps' first stages follow the stages, `rows` must be kept between steps;
    weights as `pack` orders them, one layer after the other; sizes = outputs of the layers behind a 0; empty where there is no such part.
    """
    raw, ratio, history, factors, linear, net, sizes, activation = network
    if raw:
        raw_features(x, start, rows)
        count = RAW_ROWS
    else:
        remember(len(stage_rows), history, rows)
        features(x, k, stage_rows, h, ratio, start, middle, end, rows)
        count = FIXED_ROWS + 8 * (len(stage_rows) + history)
    inputs = count
    if len(factors) > 0:
        multiply(count, factors, rows)
        inputs = (1 + len(factors)) * count
    if len(linear) > 0:
        _dense(rows, linear, inputs, 2, out)  # type: ignore[call-arg]  # numba passes the typing context
    else:
        for m in range(16 * LANES):
            out[m] = 0.0
    if len(net) > 0:
        place = 0
        layers = len(sizes) - 1
        for layer in range(layers):
            n_in = count if layer == 0 else sizes[layer] + 1
            blocks = (sizes[layer + 1] + BLOCK - 1) // BLOCK
            size = blocks * BLOCK * n_in
            source = rows if layer == 0 else hidden[(layer - 1) % 2]
            _dense(source, net[place : place + size], n_in, blocks, hidden[layer % 2])  # type: ignore[call-arg]  # numba passes the typing context
            place += size
            if layer < layers - 1:
                activate(hidden[layer % 2], sizes[layer + 1], activation)
        last = hidden[(layers - 1) % 2]
        for m in range(16 * LANES):
            out[m] += last[m]
