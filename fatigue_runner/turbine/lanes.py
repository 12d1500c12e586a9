"""Arrays in and out of the lane kernels: padding to whole groups of LANES."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.compiled import njit
from fatigue_runner.turbine.generated import kernel
from fatigue_runner.turbine.generated.kernel import LANES
from fatigue_runner.turbine.model import loads, rhs

if TYPE_CHECKING:
    from fatigue_runner.turbine.turbine import KernelData

Array = NDArray[np.float64]


@njit(nogil=True)
def _evaluate(x, wind, tables, cells, constants, scratch, row, clamped, out):
    for group in range(x.shape[0]):
        rhs(x[group], wind[group], out[group], 0, tables, cells, constants, scratch, row, clamped)


@njit(nogil=True)
def _load_groups(x, wind, derivative, tables, cells, constants, scratch, row, clamped, out):
    for group in range(x.shape[0]):
        loads(
            x[group],
            wind[group],
            derivative[group],
            out[group],
            0,
            tables,
            cells,
            constants,
            scratch,
            row,
            clamped,
        )


def to_groups(columns: Array) -> Array:
    """(k, n) -> (groups, k * LANES); the last group is filled with copies of the last column."""
    k, n = columns.shape
    groups = -(-n // LANES)
    padded = np.concatenate([columns, np.repeat(columns[:, -1:], groups * LANES - n, axis=1)], axis=1)
    return np.ascontiguousarray(padded.reshape(k, groups, LANES).transpose(1, 0, 2)).reshape(
        groups, k * LANES
    )


def from_groups(groups: Array, k: int, n: int) -> Array:
    """(groups, k * LANES) -> (k, n)"""
    return groups.reshape(len(groups), k, LANES).transpose(1, 0, 2).reshape(k, -1)[:, :n]


def work_space() -> tuple[Array, Array, NDArray[np.int64]]:
    """scratch, row (not used any more) and clamped-look-up counters of one kernel call."""
    return np.zeros(LANES), np.zeros(LANES), np.zeros(LANES, np.int64)


def evaluate(data: KernelData, columns: Array, wind: Array) -> tuple[Array, int]:
    """State derivatives (16, n) of states (16, n) under wind (3, n), and the number of clamped table look-ups.

    With the data of a varying pitch, wind is (4, n), the pitch [rad] last.
    """
    n = columns.shape[1]
    x, p = to_groups(columns), to_groups(wind)
    out = np.empty_like(x)
    scratch, row, clamped = work_space()
    _evaluate(x, p, data.tables, data.cells, data.constants, scratch, row, clamped, out)
    return from_groups(out, 16, n), int(clamped.sum())


def load_channels(data: KernelData, state: Array, wind: Array) -> dict[str, Array]:
    """Load channels {name: (n,)} of states (n, 16) under wind (n, 3), or (n, 4) with the data of a varying pitch."""
    n = len(state)
    x, p = to_groups(np.ascontiguousarray(state.T)), to_groups(np.ascontiguousarray(wind.T))
    derivative = np.empty_like(x)
    out = np.empty((len(x), len(kernel.LOADS) * LANES))
    scratch, row, clamped = work_space()
    _evaluate(x, p, data.tables, data.cells, data.constants, scratch, row, clamped, derivative)
    _load_groups(x, p, derivative, data.load_tables, data.cells, data.constants, scratch, row, clamped, out)
    return dict(zip(kernel.LOADS, np.ascontiguousarray(from_groups(out, len(kernel.LOADS), n)), strict=True))
