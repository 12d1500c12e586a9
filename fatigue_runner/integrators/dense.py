"""Compiled products of a matrix with the rows of all lanes: dense layers, and rows times rows.

Rows are [n][LANES], flat, as everywhere in the lane kernels. All lanes may share a matrix, or each have its own (`of_lanes`); the
products have the same bits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

from fatigue_runner.compiled import INLINE, LEAN, njit
from fatigue_runner.turbine.lane_code import LANES

BLOCK = 8  # outputs of a dense layer that are summed up side by side
VECTOR = 8  # doubles in a vector; LLVM splits it where the machine's are shorter


def product(each: bool) -> Callable[..., Any]:
    """An intrinsic (rows, weights, inputs, blocks, out): out = weights . rows for all lanes; rows (inputs, LANES), weights from `pack`, of
    `each` lane its own or the same for all, out (8 blocks, LANES), all flat.

    Written in LLVM's vector types: eight outputs of all lanes stay in registers while the inputs pass by, a shared weight is one
    broadcast. From Python loops LLVM spills the broadcasts, which costs four times as much (measured: 110 instead of 25 ns a lane
    for 59 inputs and 16 outputs).
    """

    @intrinsic
    def dense(typing_context, rows, weights, inputs, blocks, out):
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
                        aligned(builder.load(at(row, builder.add(place, word(p * VECTOR)))))
                        for p in range(parts)
                    ]
                    base = builder.add(first_weight, builder.mul(feature.index, block_size))
                    for o in range(BLOCK):
                        there = builder.add(base, word(o))
                        if each:
                            first = builder.mul(there, lanes)
                            by = [
                                aligned(builder.load(at(weight, builder.add(first, word(p * VECTOR)))))
                                for p in range(parts)
                            ]
                        else:
                            w = builder.load(builder.gep(weight, [there]))
                            undefined = ir.Constant(vector, ir.Undefined)
                            single = builder.insert_element(undefined, w, ir.IntType(32)(0))
                            mask = ir.Constant(ir.VectorType(ir.IntType(32), VECTOR), [0] * VECTOR)
                            by = [builder.shuffle_vector(single, undefined, mask)] * parts
                        for p in range(parts):
                            slot = sums[o * parts + p]
                            # contract: one fused multiply-add
                            product = builder.fmul(by[p], x[p], flags=("contract",))
                            builder.store(
                                builder.fadd(builder.load(slot), product, flags=("contract",)), slot
                            )
                target = builder.mul(builder.mul(block.index, block_size), lanes)
                for i, slot in enumerate(sums):
                    aligned(
                        builder.store(builder.load(slot), at(result, builder.add(target, word(i * VECTOR))))
                    )
            return context.get_dummy_value()

        return signature, codegen

    return dense


_shared: Any = product(False)  # their first argument is supplied by numba
_own: Any = product(True)


@njit(**INLINE)
def dense_rows(rows, weights, inputs, outputs, out):
    """out = weights . rows; inputs, outputs: numbers of rows; `out` has room for whole blocks of outputs."""
    blocks = (outputs + BLOCK - 1) // BLOCK
    if len(weights) > blocks * BLOCK * inputs:
        _own(rows, weights, inputs, blocks, out)
    else:
        _shared(rows, weights, inputs, blocks, out)


def blocks_of(outputs: int) -> int:
    """Blocks in which `dense` makes that many outputs."""
    return -(-outputs // BLOCK)


def pack(weights: np.ndarray) -> tuple[np.ndarray, int]:
    """(n_out, n_in) weights in the order that `dense` reads, outputs padded to whole blocks; and the number of blocks."""
    n_out, n_in = weights.shape
    blocks = blocks_of(n_out)
    padded = np.zeros((blocks * BLOCK, n_in))
    padded[:n_out] = weights
    return np.ascontiguousarray(padded.reshape(blocks, BLOCK, n_in).transpose(0, 2, 1)).ravel(), blocks


def of_lanes(make: Callable[[float], Sequence[np.ndarray]], points: Sequence[float]) -> list[np.ndarray]:
    """Packed weights for the lanes' points, of each what `make` gives for one: shared where all lanes have one point, else lane by lane."""
    made = {point: make(point) for point in points}
    if len(made) == 1:
        return list(made[points[0]])
    return [np.stack(each, axis=-1).ravel() for each in zip(*(made[point] for point in points), strict=True)]


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
