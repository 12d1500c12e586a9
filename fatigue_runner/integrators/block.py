"""Run a block of cases that share turbine, integrator and time grid of the wind, group by group of LANES."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.errors import InputError
from fatigue_runner.integrators import stepper
from fatigue_runner.integrators.contract import Lanes, Method, Prepared, Task
from fatigue_runner.integrators.output import OutputPlan, plan_output
from fatigue_runner.integrators.pitch import PitchSeries, first_pitch
from fatigue_runner.integrators.signals import PitchCells, Signals
from fatigue_runner.integrators.stepper import Output, room
from fatigue_runner.trajectory import Trajectory
from fatigue_runner.turbine.lane_code import LANES
from fatigue_runner.turbine.lanes import KernelData, aligned, counters, to_groups
from fatigue_runner.wind import stack_cells

if TYPE_CHECKING:
    from collections.abc import Sequence

    from fatigue_runner.turbine import Turbine
    from fatigue_runner.wind import WindSource

Array = NDArray[np.float64]

clock = time.perf_counter  # of `wall_time`; benchmarks on a busy machine count the thread's CPU time instead


@dataclass(frozen=True)
class Block:
    """What all groups of a block share."""

    turbine: Turbine
    method: Method
    step: float
    steps: int
    plan: OutputPlan
    pitch: float | PitchSeries
    data: KernelData
    prepared: Prepared


@dataclass
class _Group:
    """What the loop left of one group: `out` is written anew by the next; clamped, extra evaluations (LANES,); wall [s]."""

    out: Output
    clamped: NDArray[np.int64]
    extra: NDArray[np.int64]
    wall: float


_kept = threading.local()
_MOST_KEPT = 2**27  # bytes
_LARGE = 2**20  # bytes


def _output_rows(count: int, width: int) -> Array:
    """(count, width) to write output to, the same memory again and again: a new page costs as much as a step (measured)."""
    size = count * width
    rows: Array | None = getattr(_kept, "rows", None)
    if rows is None or len(rows) < size:
        rows = np.empty(size)
        _kept.rows = rows if rows.nbytes <= _MOST_KEPT else None
    return rows[:size].reshape(count, width)


def make_block(
    turbine: Turbine, method: Method, step: float, duration: float, output_step: float | None,
    pitch: float | PitchSeries, corrector: Any, mode: str, harmonics: bool,
) -> Block:  # fmt: skip
    """The method made ready; harmonics: whether the winds have azimuthal ones. The last step ends at or after `duration` [s].

    Raises InputError for impossible numbers, and where method, corrector and pitch do not go together.
    """
    for name, value in (("duration", duration), ("output step", output_step)):
        if value is not None and not (value > 0 and np.isfinite(value)):
            raise InputError(f"{name} must be a positive number of seconds, got {value}")
    varying = isinstance(pitch, PitchSeries)
    if varying and (corrector is not None or not method.varying_pitch):
        what = method.name if corrector is None else f"corrector {corrector.name}"
        raise InputError(
            f"{what} is made for one pitch; with a pitch that varies in time use a Runge-Kutta or Adams method "
            "without corrector"
        )
    if corrector is not None and not method.correctable:
        raise InputError(
            f"a corrector needs a Runge-Kutta or an exponential Adams method, {method.name} is none"
        )
    steps = int(np.ceil(duration / step - 1e-9))
    plan = plan_output(duration, step, steps, output_step, method.order)
    start = first_pitch(pitch)
    data = turbine.pitched_kernel_data(harmonics) if varying else turbine.kernel_data(start, harmonics)
    task = Task(turbine, data.model.layout, step, start, corrector, mode)
    return Block(turbine, method, step, steps, plan, pitch, data, method.prepare(task))


def run_block(block: Block, winds: Sequence[WindSource], initial: Array) -> list[Trajectory]:
    """The trajectories of winds that share a time grid, from initial (n, size); one does not depend on the others.

    Raises InputError where a wind is too short.
    """
    layout, end = block.data.model.layout, float(block.plan.time[-1])
    control: Any = None
    if isinstance(block.pitch, PitchSeries):
        control = PitchCells(*block.pitch.cells(block.turbine.pitch_range, block.steps * block.step))
    cell_duration, cells = stack_cells(winds, end, layout)
    groups = to_groups(np.ascontiguousarray(initial.T))
    # one group's cells: (n_cells, 4, signals * LANES)
    blocks = to_groups(cells.reshape(-1, len(winds))).reshape(len(groups), len(cells), 4, -1)
    out: list[Trajectory] = []
    for number, (x, own) in enumerate(zip(groups, blocks, strict=True)):
        changing = control is not None or bool(np.any(own[:, 1:])) or len(own) > 1
        p, u = np.zeros(own.shape[2]), np.zeros(len(layout.control) * LANES)
        signals = Signals(cell_duration, aligned(own), changing, control, aligned(p), aligned(u))
        here = winds[number * LANES : (number + 1) * LANES]
        lanes = len(here)
        # the last group is filled with copies of its last case
        speeds = tuple(wind.mean_speed for wind in here) + (here[-1].mean_speed,) * (LANES - lanes)
        group = _run_group(block, x, signals, speeds)
        rows = group.out.rows.reshape(-1, layout.size, LANES)
        states = np.ascontiguousarray(rows.transpose(2, 0, 1)[:lanes])
        for lane in range(lanes):
            out.append(_trajectory(block, here[lane], states[lane], group, lane, lanes))
    return out


def _run_group(block: Block, x: Array, signals: Signals, speeds: tuple[float, ...]) -> _Group:
    from numba import typeof

    plan, data, size = block.plan, block.data, block.data.model.layout.size
    # a lane that is no number would stay so: it runs on from rest, its result is not used
    fine = np.isfinite(x.reshape(size, LANES)).all(axis=0)
    start = np.where(np.tile(fine, size), x, 0.0)
    clamped = aligned(counters())
    # tables of a varying pitch are large, and aligned from the start
    tables = aligned(data.tables) if data.tables.nbytes < _LARGE else data.tables
    intervals = len(plan.time) - 1
    out = Output(
        rows=_output_rows(len(plan.time), len(x)),
        accepted=np.ones((intervals, LANES), np.bool_),
        discrepancy=np.full((intervals, LANES), np.nan),
        errors=np.full((intervals, LANES), np.nan),
        diverged_at=np.where(fine, -1.0, 0.0),
    )
    method = block.prepared.arrays(Lanes(start, signals, speeds), aligned)
    arguments = (
        method, data.model, block.step, block.steps, signals, data.arrays(clamped)._replace(tables=tables),
        room(start, block.prepared.slopes, 1 << (size - 1).bit_length(), aligned), plan.arrays, out,
    )  # fmt: skip
    run: Any = stepper.run  # a dispatcher, which no type checker sees
    types = tuple(typeof(argument) for argument in arguments)
    if types not in run.overloads:
        # a process compiles a loop once, or loads it from the cache: that is no time of the integration
        run.compile(types)
    begin = clock()
    run(*arguments)
    wall = clock() - begin
    # the loops note a step's figures once, in the row of its first output
    noted = np.searchsorted(plan.step[1:], plan.step[1:])
    told = out._replace(
        accepted=out.accepted[noted], discrepancy=out.discrepancy[noted], errors=out.errors[noted]
    )
    out.rows[0] = x
    extra = counters() if block.prepared.extra is None else block.prepared.extra(method)
    return _Group(told, clamped, extra, wall)


def _trajectory(
    block: Block, wind: WindSource, state: Array, group: _Group, lane: int, lanes: int
) -> Trajectory:
    plan, step, steps, out = block.plan, block.step, block.steps, group.out
    n, diverged_at = len(plan.time), float(out.diverged_at[lane])
    if diverged_at >= 0:
        # outputs between two step ends need both: the last one that does not lie after the last good step end
        n = max(int(np.searchsorted(plan.time, diverged_at - step * (1 - 1e-9))), 1)
        steps = round(diverged_at / step)
    limit = block.prepared.limit
    # copies: a slice would keep the whole block's memory alive
    time_points, own = plan.time[:n].copy(), state[:n].copy()
    error, distance = out.errors[: n - 1, lane].copy(), out.discrepancy[: n - 1, lane].copy()
    signals, turbine = wind.at(time_points), block.turbine
    pitch = block.pitch.at(time_points) if isinstance(block.pitch, PitchSeries) else block.pitch
    loads = turbine.loads(own, signals, pitch, wind.channels)
    layout = block.data.model.layout
    seen = () if turbine.controller is None else turbine.controller.seen
    return Trajectory(
        time=time_points,
        state=own,
        wind=signals,
        loads=loads,
        accepted=out.accepted[: n - 1, lane].copy(),
        discrepancy=np.full(n - 1, np.nan) if np.isnan(limit) else distance,
        threshold=np.full(n - 1, limit),
        local_error=error,
        steps=steps,
        evaluations=block.prepared.evaluations(steps) + int(group.extra[lane]),
        clamped_lookups=int(group.clamped[lane]),
        wall_time=group.wall / lanes,
        diverged_at=diverged_at if diverged_at >= 0 else None,
        states=block.data.model.layout.states,
        wind_signals=wind.channels,
        pitch=loads["blade_pitch"],
        control={name: own[:, layout.row(name)].copy() for name in layout.names[2 * layout.freedoms :]}
        | turbine.observed(own),
        control_signals=seen,
    )
