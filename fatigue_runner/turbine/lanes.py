"""Arrays in and out of the lane kernels: what a kernel reads of a turbine, and padding to whole groups of LANES."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.compiled import njit
from fatigue_runner.turbine.lane_code import LANES
from fatigue_runner.turbine.model import KernelArrays, Model, loads, rhs

Array = NDArray[np.float64]


@dataclass(frozen=True)
class KernelData:
    """What the kernels of `model` read for one turbine: constants, and the cells of the equations' tables and of all."""

    model: Model
    constants: Array
    tables: Array
    make_load_tables: Callable[[], Array]
    cells: int

    @cached_property
    def load_tables(self) -> Array:
        """Cells of all tables: made when loads are asked for, since they can take 50 MB."""
        return self.make_load_tables()

    def arrays(self, clamped: NDArray[np.int64]) -> KernelArrays:
        """For `model.rhs`; clamped (LANES,) counts look-ups outside the tables."""
        return KernelArrays(self.tables, self.cells, self.constants, clamped)

    def load_arrays(self, clamped: NDArray[np.int64]) -> KernelArrays:
        """For `model.loads`."""
        return KernelArrays(self.load_tables, self.cells, self.constants, clamped)


@njit(nogil=True)
def _evaluate(model: Any, x: Array, wind: Array, control: Array, data: KernelArrays, out: Array) -> None:
    for group in range(x.shape[0]):
        rhs(model, x[group], wind[group], control[group], out[group], 0, data)


@njit(nogil=True)
def _load_groups(model: Any, x: Array, wind: Array, control: Array, data: KernelArrays, out: Array) -> None:
    for group in range(x.shape[0]):
        loads(model, x[group], wind[group], control[group], out[group], 0, data)


def to_groups(columns: Array) -> Array:
    """(k, n) -> (groups, k * LANES); the last group is filled with copies of the last column."""
    k, n = columns.shape
    groups = -(-n // LANES)
    if groups * LANES > n:
        columns = np.concatenate([columns, np.repeat(columns[:, -1:], groups * LANES - n, axis=1)], axis=1)
    return np.ascontiguousarray(columns.reshape(k, groups, LANES).transpose(1, 0, 2)).reshape(
        groups, k * LANES
    )


def from_groups(groups: Array, k: int, n: int) -> Array:
    """(groups, k * LANES) -> (k, n)"""
    return groups.reshape(len(groups), k, LANES).transpose(1, 0, 2).reshape(k, -1)[:, :n]


def aligned(values: NDArray[Any]) -> NDArray[Any]:
    """A copy that begins on a cache line: loads of whole vectors across two lines cost 5 to 10 % of a step (measured)."""
    room = np.empty(values.nbytes + 64, np.uint8)
    begin = -room.ctypes.data % 64
    out = room[begin : begin + values.nbytes].view(values.dtype).reshape(values.shape)
    out[...] = values
    return out


def counters() -> NDArray[np.int64]:
    """(LANES,) of look-ups outside the tables."""
    return np.zeros(LANES, np.int64)


def _controls(control: Array | None, n: int) -> Array:
    return np.zeros((0, n)) if control is None else control


def evaluate(
    data: KernelData, columns: Array, wind: Array, control: Array | None = None
) -> tuple[Array, int]:
    """State derivatives (k, n) of states (k, n) under wind and control signals (m, n), and the number of clamped table look-ups."""
    n = columns.shape[1]
    x, p, u = to_groups(columns), to_groups(wind), to_groups(_controls(control, n))
    out, clamped = np.empty_like(x), counters()
    _evaluate(data.model, x, p, u, data.arrays(clamped), out)
    return from_groups(out, len(columns), n), int(clamped.sum())


def load_channels(
    data: KernelData, state: Array, wind: Array, control: Array | None = None
) -> dict[str, Array]:
    """Load channels {name: (n,)} of states (n, k) under wind and control signals (n, m)."""
    names, n = data.model.generated.LOADS, len(state)
    x, p = to_groups(np.ascontiguousarray(state.T)), to_groups(np.ascontiguousarray(wind.T))
    u = to_groups(np.ascontiguousarray(_controls(None if control is None else control.T, n)))
    out = np.empty((len(x), len(names) * LANES))
    _load_groups(data.model, x, p, u, data.load_arrays(counters()), out)
    return dict(zip(names, np.ascontiguousarray(from_groups(out, len(names), n)), strict=True))
