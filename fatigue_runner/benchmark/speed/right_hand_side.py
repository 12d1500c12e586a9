"""The compiled right-hand side itself: the one place of the benchmarks that knows how the kernels are called.

Everything else here asks `simulate` and the turbine. Who changes the kernels' arguments changes this file.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Sequence
from types import ModuleType
from typing import Any

import numpy as np

from fatigue_runner.compiled import INLINE, njit
from fatigue_runner.integrators.signals import Signals, signals_at
from fatigue_runner.turbine.generated import kernel, pitched
from fatigue_runner.turbine.lane_code import HEADER, LANES
from fatigue_runner.turbine.lanes import aligned, counters, to_groups
from fatigue_runner.turbine.model import rhs as rhs_of
from fatigue_runner.wind import stack_cells

Array = np.ndarray


def source(generated: ModuleType = kernel) -> str:
    """Python source of one evaluation for one lane, as it was generated."""
    return str(generated.RHS_CODE.text)


def look_ups(generated: ModuleType = kernel) -> int:
    """Tables that one evaluation looks up."""
    return int(generated.EQUATION_TABLES)


def packed() -> Callable[..., None]:
    """Evaluates again and again, at a fixed pitch: see `_repeated`."""
    return _repeated(kernel.rhs)


def packed_of(turbine: Any, harmonics: bool = False) -> Callable[..., None]:
    """The same with the equations of another turbine, or of one that operates; harmonics: those that take azimuthal ones."""
    return _repeated(turbine.kernel_data(0.0, harmonics).model.generated.rhs)


def varying() -> Callable[..., None]:
    """The same with a pitch of its own for every lane."""
    return _repeated(pitched.rhs)


def scalar() -> Callable[..., None]:
    """The same of the same generated source, built for one lane; its look-up remains SIMD across tables."""
    text = inspect.getsource(kernel).replace("import LANES, Code", "import Code", 1)
    # without a file there is nothing to cache: it is compiled anew in every benchmark
    text = text.replace("from fatigue_runner.compiled import INLINE, njit", "from numba import njit")
    space: dict[str, Any] = {"LANES": 1, "INLINE": INLINE, "__name__": "scalar_kernel"}
    exec(compile(text, "<scalar kernel>", "exec"), space)
    return _repeated(space["rhs"])


def _repeated(rhs: Callable[..., None]) -> Callable[..., None]:
    import numba

    @numba.njit(nogil=True)
    def run(
        repeats: int, x: Array, wind: Array, control: Array, out: Array, tables: Array, cells: int, constants: Array, clamped: Array,
    ) -> None:  # fmt: skip
        for _ in range(repeats):
            rhs(x, wind, control, out, 0, tables, cells, constants, clamped)

    return run


def arguments(
    turbine: Any, states: Array, wind: Array, pitch: Array | None = None
) -> Sequence[tuple[Any, ...]]:
    """What a repeated evaluation takes after the number of repeats, per group of lanes, in memory of its own as in a simulation.

    states (groups, size, lanes), wind (groups, 3 or more, lanes), pitch [rad] (groups, 1, lanes) where it varies.
    """
    more = wind.shape[1] > len(turbine.layout.wind)
    data = turbine.kernel_data(0.0, more) if pitch is None else turbine.pitched_kernel_data(more)
    tables = aligned(data.tables) if pitch is None else data.tables
    lanes = states.shape[2]
    controls = np.zeros((len(states), 0, lanes)) if pitch is None else pitch
    return [
        (*(aligned(a.ravel()) for a in (x, p, u)), aligned(np.zeros(x.size)), tables, data.cells, aligned(data.constants),
         np.zeros(lanes, np.int64))
        for x, p, u in zip(states, wind, controls, strict=True)
    ]  # fmt: skip


def interpreted(turbine: Any) -> Callable[[Any, Any], list[float]]:
    """(state, wind) -> slopes of one case at pitch 0, by the interpreter: the very lines that the compiled kernel is made of, and its
    tables, in Python's own numbers."""
    data = turbine.kernel_data(0.0)
    code = data.model.generated.RHS_CODE
    first, per_unit = (float(value) for value in data.tables[:2])
    values = data.tables[HEADER:].reshape(-1, 4, code.width)[:, :, : len(code.tables)].tolist()
    last = len(values) - 1

    def look_up(place: float) -> list[float]:
        at = (place - first) * per_unit
        number = min(max(int(at), 0), last)
        u = min(max(at - number, 0.0), 1.0)
        one, two, three, four = values[number]
        return [((d * u + c) * u + b) * u + a for a, b, c, d in zip(one, two, three, four, strict=True)]

    lines = []
    for line in code.text.splitlines():
        lines.append(f"    {line}")
        if line.startswith(f"{code.place} = "):
            lines.append(f"    {', '.join(f'c_{name}' for name in code.tables)} = look_up({code.place})")
    text = "\n".join(
        ["def f(x, wind):", f"    out = [0.0] * {data.model.layout.size}", *lines, "    return out"]
    )
    space: dict[str, Any] = {
        "floor": math.floor, "sqrt": math.sqrt, "look_up": look_up, "constants": data.constants.tolist(), "clamped": [0],
    }  # fmt: skip
    exec(compile(text, "<interpreted right-hand side>", "exec"), space)
    found: Callable[[Any, Any], list[float]] = space["f"]
    return found


@njit(nogil=True)
def _slope(model: Any, t: float, x: Array, signals: Any, state: Array, slope: Array, data: Any) -> Array:
    """f(t, x) of one case: the same state in every lane, the first one read."""
    for i in range(len(x)):
        for j in range(LANES):
            state[i * LANES + j] = x[i]
    signals_at(model, t, signals)
    rhs_of(model, state, signals.p, signals.u, slope, 0, data)
    out = np.empty(len(x))
    for i in range(len(x)):
        out[i] = slope[i * LANES]
    return out


def of_one_case(turbine: Any, wind: Any, duration: float, pitch: float) -> Callable[[float, Array], Array]:
    """f(t, x) of one case for `duration` [s] at a pitch [rad], compiled; the lanes beside it are wasted."""
    data = turbine.kernel_data(pitch, harmonics=turbine.layout.beyond(wind.channels))
    layout = data.model.layout
    cell_duration, cells = stack_cells([wind], duration, layout)
    block = to_groups(np.ascontiguousarray(cells.reshape(-1, 1))).reshape(len(cells), 4, -1)
    signals = Signals(cell_duration, block, True, None, np.zeros(block.shape[2]), np.zeros(0))
    state, slope = np.zeros(layout.size * LANES), np.zeros(layout.size * LANES)
    given = data.arrays(counters())
    return lambda t, x: _slope(data.model, t, x, signals, state, slope, given)
