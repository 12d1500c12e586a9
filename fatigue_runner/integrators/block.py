"""Run a block of cases that share turbine, method, step and pitch: winds in, trajectories out."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.errors import InputError
from fatigue_runner.integrators.correcting import Correcting, prepare, prepare_exponential
from fatigue_runner.integrators.exponential import ExponentialRungeKutta, matrices
from fatigue_runner.integrators.exponential_adams import ExponentialAdams
from fatigue_runner.integrators.methods import Method
from fatigue_runner.integrators.methods import method as find_method
from fatigue_runner.integrators.multistep import LinearMultistep
from fatigue_runner.integrators.output import OutputPlan, plan_output
from fatigue_runner.integrators.pitch import PitchSeries
from fatigue_runner.integrators.tableaux import ButcherTableau
from fatigue_runner.trajectory import Trajectory

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine

Array = NDArray[np.float64]

clock = time.perf_counter  # of `wall_time`; benchmarks on a busy machine count the thread's CPU time instead


def simulate_block(
    turbine: Turbine,
    method: str,
    step: float,
    winds: Sequence[Any],
    initial: Array,
    duration: float,
    output_step: float | None = None,
    pitch: float | PitchSeries = 0.0,
    corrector: Any = None,
    mode: str = "enhanced",
) -> list[Trajectory]:
    """Simulate n cases in lockstep, SIMD across cases; a case's result does not depend on the others.

    step, duration, output_step [s] (None: output at every step); winds: n wind sources; initial (n, 16); pitch [rad]: a number
    or a PitchSeries, which is the same for all cases and not for correctors and exponential methods.
    `corrector`: a corrector.Corrector of this turbine, method and step; `mode`: enhanced, or hybrid, which guards it. The last step
    ends at or after `duration`. Raises InputError for impossible numbers.
    """
    found = find_method(method)
    for name, value in (("step", step), ("duration", duration), ("output step", output_step)):
        if value is not None and not (value > 0 and np.isfinite(value)):
            raise InputError(f"{name} must be a positive number of seconds, got {value}")
    initial = np.asarray(initial, float)
    if initial.shape != (len(winds), 16):
        raise InputError(
            f"initial must have shape ({len(winds)}, 16), one state per wind, got {initial.shape}"
        )
    steps = int(np.ceil(duration / step - 1e-9))
    plan = plan_output(duration, step, steps, output_step, found.order)
    exponential = isinstance(found, ExponentialAdams | ExponentialRungeKutta)
    if isinstance(pitch, PitchSeries) and (corrector is not None or exponential):
        what = found.name if corrector is None else f"corrector {corrector.name}"
        raise InputError(
            f"{what} is made for one pitch; with a pitch that varies in time use a Runge-Kutta or Adams method "
            "without corrector"
        )
    correcting = None
    if isinstance(found, ExponentialAdams):
        assert not isinstance(pitch, PitchSeries)
        correcting = prepare_exponential(corrector, turbine, found, step, mode, pitch)
    elif corrector is not None:
        if not isinstance(found, ButcherTableau):
            raise InputError(
                f"a corrector needs a Runge-Kutta or an exponential Adams method, {method} is none"
            )
        correcting = prepare(corrector, turbine, found, step, mode)
    return _run(turbine, found, correcting, step, steps, winds, initial, plan, pitch)


@dataclass
class _Group:
    """What the loop left of one group: rows (n, 16 * LANES), errors (n - 1, LANES), per lane: diverged_at, clamped.

    `rows` is written anew by the next group.
    """

    rows: Array
    errors: Array
    diverged_at: Array
    clamped: NDArray[np.int64]
    accepted: NDArray[np.bool_]
    discrepancy: Array
    wall: float


def aligned(values: NDArray[Any]) -> NDArray[Any]:
    """A copy that begins on a cache line: loads of whole vectors across two lines cost 5 to 10 % of a step (measured)."""
    room = np.empty(values.nbytes + 64, np.uint8)
    begin = -room.ctypes.data % 64
    out = room[begin : begin + values.nbytes].view(values.dtype).reshape(values.shape)
    out[...] = values
    return out


_kept = threading.local()
_MOST_KEPT = 2**27  # bytes


def _output_rows(count: int, width: int) -> Array:
    """(count, width) to write output to, the same memory again and again: a new page costs as much as a step (measured)."""
    size = count * width
    rows: Array | None = getattr(_kept, "rows", None)
    if rows is None or len(rows) < size:
        rows = np.empty(size)
        _kept.rows = rows if rows.nbytes <= _MOST_KEPT else None
    return rows[:size].reshape(count, width)


def _run(turbine, method, correcting, step, steps, winds, initial, plan, pitch) -> list[Trajectory]:
    from fatigue_runner.turbine.lanes import LANES, to_groups
    from fatigue_runner.wind import stack_cells

    varying = isinstance(pitch, PitchSeries)
    pitch_cells = pitch.cells(turbine, steps * step) if varying else None
    data = turbine.pitched_kernel_data() if varying else turbine.kernel_data(pitch)
    prepared = _prepare(turbine, method, step, pitch)
    cell_duration, cells = stack_cells(winds, float(plan.time[-1]))
    groups = to_groups(np.ascontiguousarray(initial.T))
    # one group's cells: (n_cells, 4, 3 * LANES)
    blocks = to_groups(cells.reshape(-1, len(winds))).reshape(len(groups), len(cells), 4, -1)
    out: list[Trajectory] = []
    for number, (x, wind_cells) in enumerate(zip(groups, blocks, strict=True)):
        wind = (cell_duration, wind_cells, pitch_cells)
        group = _run_group(prepared, correcting, step, steps, x, wind, data, plan)
        lanes = min(LANES, len(winds) - number * LANES)
        states = np.ascontiguousarray(group.rows.reshape(-1, 16, LANES).transpose(2, 0, 1)[:lanes])
        for lane in range(lanes):
            out.append(
                _trajectory(
                    turbine,
                    method,
                    correcting,
                    step,
                    steps,
                    winds[number * LANES + lane],
                    states[lane],
                    group,
                    lane,
                    lanes,
                    plan,
                    pitch,
                )
            )
    return out


def _prepare(turbine: Turbine, method: Method, step: float, pitch: Any) -> tuple[Any, Any, int]:
    """The compiled loop of a method, what it reads of the method, and the rows of slopes that it keeps."""
    from fatigue_runner.integrators import loops
    from fatigue_runner.integrators.kernel_data import multistep_data, runge_kutta_data, slope_rows

    if isinstance(method, ExponentialAdams):
        from fatigue_runner.integrators.loops_exponential_adams import exponential_adams

        return exponential_adams, None, 3
    if isinstance(method, ExponentialRungeKutta):
        # compiled only where it is used, as the corrected loop
        from fatigue_runner.integrators.loops_exponential import exponential

        return exponential, matrices(turbine, step, pitch), 3
    if isinstance(method, LinearMultistep):
        return loops.multistep, multistep_data(method), slope_rows(method)
    assert isinstance(method, ButcherTableau)
    # a corrector's fallback of the next order has one more stage
    return loops.runge_kutta, runge_kutta_data(method), slope_rows(method) + 1


def _run_group(
    prepared: tuple[Any, Any, int],
    correcting: Correcting | None,
    step,
    steps,
    x,
    wind,
    data,
    plan: OutputPlan,
) -> _Group:
    from numba import typeof

    from fatigue_runner.turbine.lanes import LANES, work_space

    advance, method_data, slopes = prepared
    cell_duration, cells, pitch_cells = wind
    changing = pitch_cells is not None or bool(np.any(cells[:, 1:])) or len(cells) > 1
    scratch, row, clamped = (aligned(a) for a in work_space())
    # (1, n) tables of a varying pitch are large, and aligned from the start
    tables = aligned(data.tables) if data.tables.ndim == 1 else data.tables
    model = (tables, data.cells, data.constants, scratch, row)
    # a lane that is no number would stay so: it runs on from rest, its result is not used
    fine = np.isfinite(x.reshape(16, LANES)).all(axis=0)
    start = np.where(np.tile(fine, 16), x, 0.0)
    width = len(x)
    states = aligned(np.stack([start, start, start]))
    flat = [aligned(np.zeros(width)) for _ in range(3)]  # stage, slope, largest error
    k = aligned(np.zeros((slopes, width)))
    work = (states, k, aligned(np.zeros((3 if pitch_cells is None else 4) * LANES)), *flat, aligned(start))
    group = _Group(
        _output_rows(len(plan.time), width),
        np.full((len(plan.time) - 1, LANES), np.nan),
        np.where(fine, -1.0, 0.0),
        clamped,
        np.ones((len(plan.time) - 1, LANES), np.bool_),
        np.full((len(plan.time) - 1, LANES), np.nan),
        0.0,
    )
    plan_data = (plan.step, plan.exact, plan.position, plan.velocity)
    all_cells = aligned(cells) if pitch_cells is None else (aligned(cells), *pitch_cells)
    wind_data = (cell_duration, all_cells, changing)
    if correcting is None:
        loop: Any = advance
        arguments: tuple[Any, ...] = (
            step, steps, method_data, wind_data, model, plan_data, work, group.rows, group.errors, group.diverged_at, clamped
        )  # fmt: skip
    else:
        loop, own_work = correcting.loop(start, len(k), aligned)
        arguments = (
            step, steps, correcting.method, correcting.network, correcting.safety, wind_data, model, plan_data,
            own_work, group.rows, (group.accepted, group.discrepancy, group.errors), group.diverged_at, clamped,
        )  # fmt: skip
    if not loop.signatures:
        # a process compiles a loop once, or loads it from the cache: that is no time of the integration
        loop.compile(tuple(typeof(argument) for argument in arguments))
    begin = clock()
    loop(*arguments)
    group.wall = clock() - begin
    # the loops note a step's figures once, in the row of its first output
    noted = np.searchsorted(plan.step[1:], plan.step[1:])
    group.errors = group.errors[noted]
    group.accepted = group.accepted[noted]
    group.discrepancy = group.discrepancy[noted]
    group.rows[0] = x
    return group


def _trajectory(
    turbine, method, correcting, step, steps, wind, state, group: _Group, lane, lanes, plan: OutputPlan, pitch
) -> Trajectory:
    n, diverged_at = len(plan.time), float(group.diverged_at[lane])
    if diverged_at >= 0:
        # outputs between two step ends need both: the last one that does not lie after the last good step end
        n = max(int(np.searchsorted(plan.time, diverged_at - step * (1 - 1e-9))), 1)
        steps = round(diverged_at / step)
    hybrid = correcting is not None and correcting.hybrid
    # copies: a slice would keep the whole block's memory alive
    time_points, state, error = plan.time[:n].copy(), state[:n].copy(), group.errors[: n - 1, lane].copy()
    signals = wind.at(time_points)
    return Trajectory(
        time=time_points,
        state=state,
        wind=signals,
        loads=turbine.loads(
            state, signals, pitch.at(time_points) if isinstance(pitch, PitchSeries) else pitch
        ),
        accepted=group.accepted[: n - 1, lane].copy(),
        discrepancy=group.discrepancy[: n - 1, lane].copy() if hybrid else np.full(n - 1, np.nan),
        threshold=np.full(n - 1, correcting.limit if hybrid else np.nan),
        local_error=error,
        steps=steps,
        evaluations=method.evaluations(steps) + (correcting.extra_evaluations(steps) if correcting else 0),
        clamped_lookups=int(group.clamped[lane]),
        wall_time=group.wall / lanes,
        diverged_at=diverged_at if diverged_at >= 0 else None,
    )


def warm_up(method: str = "heun") -> None:
    """Compile the kernels that `method` needs, or load them from the cache, before workers need them."""
    from fatigue_runner.turbine import load_turbine
    from fatigue_runner.wind import ConstantWind

    simulate_block(load_turbine("nrel5mw"), method, 0.01, [ConstantWind(8.0)], np.zeros((1, 16)) + 1e-3, 0.02)
