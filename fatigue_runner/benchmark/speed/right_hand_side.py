"""The compiled right-hand side itself: the one place of the benchmarks that knows how the kernels are called.

Everything else here asks `simulate` and the turbine. Who changes the kernels' arguments changes this file.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from fatigue_runner.compiled import INLINE, njit
from fatigue_runner.integrators.block import aligned
from fatigue_runner.integrators.stepping import wind_at
from fatigue_runner.turbine import model
from fatigue_runner.turbine.generated import kernel
from fatigue_runner.turbine.lanes import LANES, to_groups, work_space

Array = np.ndarray
_rhs = kernel.rhs


def source() -> str:
    """Python source of one evaluation for one lane, as it was generated."""
    return kernel.RHS_CODE.text


def look_ups() -> int:
    """Tables that one evaluation looks up."""
    return kernel.EQUATION_TABLES


def packed() -> Callable[..., None]:
    """Evaluates again and again, at a fixed pitch: see `_repeated`."""
    return _repeated(kernel.rhs)


def pitched() -> Callable[..., None]:
    """The same with a pitch of its own for every lane."""
    return _repeated(model.rhs)


def scalar() -> Callable[..., None]:
    """The same of the same generated source, built for one lane; its look-up remains SIMD across tables."""
    text = inspect.getsource(kernel).replace(f"LANES = {LANES}\n", "LANES = 1\n", 1)
    # without a file there is nothing to cache: it is compiled anew in every benchmark
    text = text.replace("from fatigue_runner.compiled import INLINE, njit", "from numba import njit")
    space: dict[str, Any] = {"INLINE": INLINE, "__name__": "scalar_kernel"}
    exec(compile(text, "<scalar kernel>", "exec"), space)
    return _repeated(space["rhs"])


def _repeated(rhs: Callable[..., None]) -> Callable[..., None]:
    import numba

    @numba.njit(nogil=True)
    def run(
        repeats: int,
        x: Array,
        wind: Array,
        out: Array,
        tables: Any,
        cells: Any,
        constants: Array,
        scratch: Array,
        row: Array,
        clamped: Array,
    ) -> None:
        for _ in range(repeats):
            rhs(x, wind, out, 0, tables, cells, constants, scratch, row, clamped)

    return run


def arguments(
    turbine: Any, states: Array, signals: Array, pitched: bool = False
) -> Sequence[tuple[Any, ...]]:
    """What a repeated evaluation takes after the number of repeats, per group of lanes, in memory of its own as in a simulation.

    states (groups, 16, lanes), signals (groups, 3 or, with the pitch [rad], 4, lanes).
    """
    data = turbine.pitched_kernel_data() if pitched else turbine.kernel_data(0.0)
    tables = data.tables if pitched else aligned(data.tables)
    lanes = states.shape[2]
    return [
        (aligned(x.ravel()), aligned(p.ravel()), aligned(np.zeros(x.size)), tables, data.cells, aligned(data.constants),
         np.zeros(1), np.zeros(1), np.zeros(lanes, np.int64))
        for x, p in zip(states, signals, strict=True)
    ]  # fmt: skip


@njit(nogil=True)
def _slope(t: float, x: Array, wind: Any, work: Any, data: Any) -> Array:
    """f(t, x) (16,) of one case: the same state in every lane, the first one read."""
    cell_duration, block = wind
    state, p, slope, clamped = work
    tables, count, constants, scratch, row = data
    for i in range(16):
        for j in range(LANES):
            state[i * LANES + j] = x[i]
    wind_at(t, cell_duration, block, p)
    _rhs(state, p, slope, 0, tables, count, constants, scratch, row, clamped)
    out = np.empty(16)
    for i in range(16):
        out[i] = slope[i * LANES]
    return out


def of_one_case(turbine: Any, wind: Any, duration: float, pitch: float) -> Callable[[float, Array], Array]:
    """f(t, x) of one case for `duration` [s] at a pitch [rad], compiled; the lanes beside it are wasted."""
    data = turbine.kernel_data(pitch)
    cell_duration, cells = wind.cells(duration)
    block = to_groups(np.ascontiguousarray(cells.reshape(-1, 1))).reshape(len(cells), 4, -1)
    scratch, row, clamped = work_space()
    work = np.zeros(16 * LANES), np.zeros(3 * LANES), np.zeros(16 * LANES), clamped
    given = data.tables, data.cells, data.constants, scratch, row
    return lambda t, x: _slope(t, x, (cell_duration, block), work, given)
