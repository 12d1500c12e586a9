"""From the rows of a group, as the time loop writes them, to a series for each case and channel, with wind and loads at the same times.

One pass over rows that are still in the cache: what the kernels make of LANES cases at a time is laid out by case and channel, a tile
of rows after the other, since one number of each would touch a cache line of each.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic
from numpy.typing import DTypeLike, NDArray

from fatigue_runner.compiled import LEAN, njit
from fatigue_runner.integrators.memory import empty
from fatigue_runner.integrators.signals import signals_at
from fatigue_runner.turbine.lane_code import LANES, VECTOR, transposed
from fatigue_runner.turbine.model import loads, rows, width

Array = NDArray[np.float64]

TILE = 2 * VECTOR  # rows


class Series(NamedTuple):
    """Of the cases of a group, in full length: state (cases, size, n), wind (cases, rows, n), loads (cases, channels, n) of either
    precision; per output interval accepted, discrepancy, errors (cases, n - 1)."""

    state: Array
    wind: Array
    loads: NDArray[Any]
    accepted: NDArray[np.bool_]
    discrepancy: Array
    errors: Array


class Room(NamedTuple):
    """For one time: states x (width,); for a tile: the winds (TILE, rows * LANES) and the loads (TILE * channels * LANES,)."""

    x: Array
    wind: Array
    loads: Array


def make_series(cases: int, n: int, size: int, winds: int, channels: int, load_type: DTypeLike) -> Series:
    """Room for `cases` cases of n output times."""
    return Series(
        empty((cases, size, n)),
        empty((cases, winds, n)),
        empty((cases, channels, n), load_type),
        empty((cases, n - 1), np.bool_),
        empty((cases, n - 1)),
        empty((cases, n - 1)),
    )


def make_room(size: int, winds: int, channels: int, aligned: object) -> Room:
    """For states of `size` rows, `winds` rows of wind; aligned: copies onto cache lines."""
    assert callable(aligned)
    shapes = (size * LANES,), (TILE, winds * LANES), (TILE * channels * LANES,)
    return Room(*(aligned(np.zeros(shape)) for shape in shapes))


def _transposition(
    typing_context: Any,
    source: Any,
    place: Any,
    stride: Any,
    target: Any,
    target_place: Any,
    target_stride: Any,
) -> Any:
    """VECTOR rows of VECTOR numbers, `stride` apart, become as many rows of the target, whose type they are rounded to; places in the
    arrays' memory."""
    if not (isinstance(source, types.Array) and isinstance(target, types.Array)):
        return None
    whole = types.int64
    signature = types.void(source, whole, whole, target, whole, whole)
    wide = ir.DoubleType()
    kind = wide if target.dtype == types.float64 else ir.FloatType()

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        arrays = [context.make_array(sig.args[i])(context, builder, args[i]).data for i in (0, 3)]

        def pointer(array: Any, base: Any, step: Any, i: int, number: Any) -> Any:
            at = builder.add(base, builder.mul(step, ir.Constant(step.type, i)))
            return builder.bitcast(builder.gep(array, [at]), ir.VectorType(number, VECTOR).as_pointer())

        found = []
        for i in range(VECTOR):
            found.append(builder.load(pointer(arrays[0], args[1], args[2], i, wide)))
            found[-1].align = 8
        for i, row in enumerate(transposed(builder, found)):
            if kind is not wide:
                row = builder.fptrunc(row, ir.VectorType(kind, VECTOR))
            stored = builder.store(row, pointer(arrays[1], args[4], args[5], i, kind))
            stored.align = 8 if kind is wide else 4
        return context.get_dummy_value()

    return signature, codegen


_transpose: Any = intrinsic(_transposition)  # its first argument is numba's


@njit(**LEAN)
def _lay_out(
    table: Array, place: int, stride: int, count: int, channels: int, series: NDArray[Any], first: int
) -> None:
    """series[case, channel, first + t] = table[place + t stride + channel LANES + case], places in the table's memory; t < count."""
    cases, n = series.shape[0], series.shape[2]
    flat = table.reshape(-1)
    for channel in range(channels):
        for case in range(0, cases, VECTOR):
            for t in range(0, count, VECTOR):
                begin = place + t * stride + channel * LANES + case
                if case + VECTOR <= cases and t + VECTOR <= count:
                    _transpose(
                        table,
                        begin,
                        stride,
                        series,
                        (case * channels + channel) * n + first + t,
                        channels * n,
                    )
                else:
                    for i in range(min(VECTOR, cases - case)):
                        for j in range(min(VECTOR, count - t)):
                            series[case + i, channel, first + t + j] = flat[begin + j * stride + i]


@njit(**LEAN)
def add_rows(
    model: Any, time: Array, first: int, begin: int, end: int, plan: Any, out: Any, signals: Any, data: Any, room: Room, series: Series
) -> None:  # fmt: skip
    """Lay out rows `begin` to before `end` of `out` as the outputs from number `first` on.

    time (n,) [s]; plan: `output.PlanArrays`, whose rows those of `out` are; out: `stepper.Output`; data: `KernelArrays` for the loads.
    """
    channels, winds = series.loads.shape[1], series.wind.shape[1]
    line = begin
    while line < end:
        count = min(TILE, end - line)
        at = first + line - begin
        for t in range(count):
            signals_at(model, time[at + t], signals)
            for m in range(width(model)):
                room.x[m] = out.rows[line + t, m]
            loads(model, room.x, signals.p, signals.u, room.loads, t * channels * LANES, data)
            for m in range(winds * LANES):
                room.wind[t, m] = signals.p[m]
        _lay_out(out.rows, line * width(model), width(model), count, rows(model), series.state, at)
        _lay_out(room.wind, 0, winds * LANES, count, winds, series.wind, at)
        _lay_out(room.loads, 0, channels * LANES, count, channels, series.loads, at)
        line += count
    # the loops note a step's figures once, in the row of its first output
    noted = begin - 1
    for line in range(begin, end):
        if line > 0:
            if noted < 0 or plan.step[line] != plan.step[line - 1]:
                noted = line - 1
            at = first + line - begin - 1
            for case in range(series.accepted.shape[0]):
                series.accepted[case, at] = out.accepted[noted, case]
                series.discrepancy[case, at] = out.discrepancy[noted, case]
                series.errors[case, at] = out.errors[noted, case]
