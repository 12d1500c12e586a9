"""Stage arithmetic in LLVM's vector types: one pass over the state for any number of stages.

From Python loops LLVM needs a check for overlap before every loop, and a function for every number of terms.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

from fatigue_runner.compiled import LEAN  # noqa: F401  # the cache is keyed by all files that name this module
from fatigue_runner.turbine.lane_code import LANES
from fatigue_runner.turbine.model import ModelType

VECTOR = 8  # doubles; LLVM splits a vector where the machine's are shorter
TOGETHER = 8  # vectors whose sums stay in registers while the terms pass by

_WORD, _INDEX = ir.IntType(64), ir.IntType(32)
_SUM, _BITS = ir.VectorType(ir.DoubleType(), VECTOR), ir.VectorType(_WORD, VECTOR)
_MAGNITUDE = 2**63 - 1
# Neither `nnan` nor `ninf`: what is checked may be no number.
_FLAGS = ("contract", "nsz")


# No state of a turbine comes near these values; beyond them a case has diverged. Azimuths grow without limit.
STATE_BOUND, AZIMUTH_BOUND = 1e4, 1e9
# magnitudes of doubles are ordered as these, infinity and NaN above every number
STATE_BITS, AZIMUTH_BITS = (int(np.float64(bound).view(np.int64)) for bound in (STATE_BOUND, AZIMUTH_BOUND))


def stage_sum(checked: bool) -> Callable[..., Any]:
    """An intrinsic (model, states, now, k, rows, weights, line, count, h, out, new):

    out = states[now] + h sum_j weights[line, j] k[rows[line, j]], j < count, count at least 1. Where `checked` it is stored in
    states[new] as well, and the result says whether all of it is within the bounds.
    """
    table, integers = types.Array(types.float64, 2, "C"), types.Array(types.int64, 2, "C")
    flat = types.Array(types.float64, 1, "C")

    def summed(typing_context, model, states, now, k, rows, weights, line, count, h, out, new):
        if not isinstance(model, ModelType):
            return None
        signature = types.boolean(
            model, table, types.int64, table, integers, table, types.int64, types.int64, types.float64, flat, types.int64
        )  # fmt: skip
        layout = model.model.layout

        def codegen(context, builder, sig, args):
            arrays = [
                context.make_array(t)(context, builder, a) if isinstance(t, types.Array) else a
                for t, a in zip(sig.args, args, strict=True)
            ]
            return _Sum(builder, layout, *arrays[1:]).run(checked)

        return signature, codegen

    return intrinsic(summed)


class _Sum:
    def __init__(self, builder, layout, states, now, k, rows, weights, line, count, h, out, new) -> None:
        b = self.builder = builder
        self.width, self.azimuths = layout.size * LANES, (layout.rotor, layout.generator)
        self.k, self.count, self.h, self.out = k.data, count, h, out.data
        self.old = b.gep(states.data, [b.mul(now, _WORD(self.width))])
        self.new = b.gep(states.data, [b.mul(new, _WORD(self.width))])
        first = [b.mul(line, b.extract_value(array.shape, 1)) for array in (rows, weights)]
        self.rows, self.weights = b.gep(rows.data, [first[0]]), b.gep(weights.data, [first[1]])

    def run(self, checked: bool) -> Any:
        b, outside = self.builder, ir.Constant(ir.VectorType(ir.IntType(1), VECTOR), [0] * VECTOR)
        block_size = TOGETHER * VECTOR
        for block in range(0, self.width, block_size):
            places = list(range(block, min(block + block_size, self.width), VECTOR))
            sums = self.sums(places)
            for place, total in zip(places, sums, strict=True):
                value = b.fadd(self.load(self.old, place), b.load(total), flags=_FLAGS)
                self.store(value, self.out, place)
                if checked:
                    self.store(value, self.new, place)
                    bound = AZIMUTH_BITS if place // LANES in self.azimuths else STATE_BITS
                    outside = b.or_(outside, self.beyond(value, bound))
        if not checked:
            return ir.Constant(ir.IntType(1), 1)
        return b.icmp_unsigned("==", b.bitcast(outside, ir.IntType(VECTOR)), ir.IntType(VECTOR)(0))

    def sums(self, places: list[int]) -> list[Any]:
        b = self.builder
        sums = [cgutils.alloca_once(b, _SUM) for _ in places]
        for slot, product in zip(sums, self.products(_WORD(0), places), strict=True):
            b.store(product, slot)
        with cgutils.for_range(b, self.count, start=_WORD(1), intp=_WORD) as loop:
            for slot, product in zip(sums, self.products(loop.index, places), strict=True):
                b.store(b.fadd(b.load(slot), product, flags=_FLAGS), slot)
        return sums

    def products(self, term: Any, places: list[int]) -> list[Any]:
        b = self.builder
        row = b.gep(self.k, [b.mul(b.load(b.gep(self.rows, [term])), _WORD(self.width))])
        weight = b.fmul(self.h, b.load(b.gep(self.weights, [term])))
        single = b.insert_element(ir.Constant(_SUM, ir.Undefined), weight, _INDEX(0))
        mask = ir.Constant(ir.VectorType(_INDEX, VECTOR), [0] * VECTOR)
        splat = b.shuffle_vector(single, ir.Constant(_SUM, ir.Undefined), mask)
        return [b.fmul(splat, self.load(row, place), flags=_FLAGS) for place in places]

    def beyond(self, value: Any, bound: int) -> Any:
        """Whether a magnitude is beyond, compared as integers."""
        b = self.builder
        magnitude = b.and_(b.bitcast(value, _BITS), ir.Constant(_BITS, [_MAGNITUDE] * VECTOR))
        return b.icmp_unsigned(">=", magnitude, ir.Constant(_BITS, [bound] * VECTOR))

    def load(self, base: Any, place: int) -> Any:
        value = self.builder.load(self.pointer(base, place))
        value.align = 8
        return value

    def store(self, value: Any, base: Any, place: int) -> None:
        self.builder.store(value, self.pointer(base, place)).align = 8

    def pointer(self, base: Any, place: int) -> Any:
        return self.builder.bitcast(self.builder.gep(base, [_WORD(place)]), _SUM.as_pointer())
