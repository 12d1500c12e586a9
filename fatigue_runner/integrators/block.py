"""Run a block of cases that share turbine, integrator and time grid of the wind, group by group of LANES."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from fatigue_runner.errors import InputError
from fatigue_runner.integrators import stepper
from fatigue_runner.integrators.contract import Lanes, Method, Prepared, Task
from fatigue_runner.integrators.output import OutputPlan, plan_output
from fatigue_runner.integrators.pitch import PitchSeries, first_pitch
from fatigue_runner.integrators.series import Series, add_rows, make_room, make_series
from fatigue_runner.integrators.signals import PitchCells, Signals
from fatigue_runner.integrators.stepper import Output, Place, room
from fatigue_runner.stopwatch import stage
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
    load_type: DTypeLike


@dataclass
class _Group:
    """What was left of one group, for its `cases` of LANES: diverged_at, clamped, extra evaluations (LANES,); wall [s]."""

    series: Series
    diverged_at: Array
    clamped: NDArray[np.int64]
    extra: NDArray[np.int64]
    wall: float


_LARGE = 2**20  # bytes
# Output rows between two calls of the time loop: enough that a call costs nothing, few enough that they stay in the cache.
_ROWS = 512


def make_block(
    turbine: Turbine, method: Method, step: float, duration: float, output_step: float | None,
    pitch: float | PitchSeries, corrector: Any, mode: str, harmonics: bool, load_type: DTypeLike = np.float64,
) -> Block:  # fmt: skip
    """The method made ready; harmonics: whether the winds have azimuthal ones; load_type: of the load channels.

    The last step ends at or after `duration` [s].

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
    return Block(turbine, method, step, steps, plan, pitch, data, method.prepare(task), load_type)


def run_block(block: Block, winds: Sequence[WindSource], initial: Array) -> list[Trajectory]:
    """The trajectories of winds that share a time grid, from initial (n, size); one does not depend on the others.

    Raises InputError where a wind is too short.
    """
    layout, end = block.data.model.layout, float(block.plan.time[-1])
    control: Any = None
    if isinstance(block.pitch, PitchSeries):
        control = PitchCells(*block.pitch.cells(block.turbine.pitch_range, block.steps * block.step))
    with stage("wind"):
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
        # the last group is filled with copies of its last case
        speeds = tuple(wind.mean_speed for wind in here) + (here[-1].mean_speed,) * (LANES - len(here))
        group = _run_group(block, x, signals, speeds, len(here))
        out += [_trajectory(block, wind, group, lane) for lane, wind in enumerate(here)]
    return out


def _run_group(block: Block, x: Array, signals: Signals, speeds: tuple[float, ...], cases: int) -> _Group:
    """Advance the group from x (width,) in pieces, so that memory does not grow with what the kernel writes for all of LANES."""
    plan, data, size = block.plan, block.data, block.data.model.layout.size
    # a lane that is no number would stay so: it runs on from rest, its result is not used
    fine = np.isfinite(x.reshape(size, LANES)).all(axis=0)
    start = np.where(np.tile(fine, size), x, 0.0)
    clamped = aligned(counters())
    # tables of a varying pitch are large, and aligned from the start
    tables = aligned(data.tables) if data.tables.nbytes < _LARGE else data.tables
    n, rows = len(plan.time), min(_ROWS, len(plan.time)) + plan.most_in_a_step
    out = Output(
        rows=aligned(np.empty((rows, len(x)))),
        accepted=np.ones((rows, LANES), np.bool_),
        discrepancy=np.full((rows, LANES), np.nan),
        errors=np.full((rows, LANES), np.nan),
        diverged_at=np.where(fine, -1.0, 0.0),
    )
    method = block.prepared.arrays(Lanes(start, signals, speeds), aligned)
    ring = room(start, block.prepared.slopes, 1 << (size - 1).bit_length(), aligned)
    place = Place(np.zeros(1, np.int64), np.ones(1, np.int64))
    channels, winds, of_loads = (
        len(data.model.generated.LOADS),
        len(signals.p) // LANES,
        data.load_arrays(counters()),
    )
    series, own_room = (
        make_series(cases, n, size, winds, channels, block.load_type),
        make_room(size, winds, channels, aligned),
    )
    arrays = data.arrays(clamped)._replace(tables=tables)
    run, lay_out = stepper.run, add_rows
    begin, first, gone, wall = 0, 1, False, 0.0
    while begin < block.steps and not gone:
        # up to the step after which the rows are full, with all outputs that are known by then
        last = min(first + _ROWS, n) - 1
        end = block.steps if last == n - 1 else int(plan.step[last])
        known = int(np.searchsorted(plan.step, end, side="right"))
        part = plan.part(first - 1, known + 1)
        place.output[0] = 1
        steps = (
            method, data.model, block.step, begin, end, signals, arrays, ring, place, part, out,
        )  # fmt: skip
        if begin == 0:
            _compile(run, steps)
        started = clock()
        with stage("integration"):
            gone = run(*steps)
        wall += clock() - started
        new = 1
        if begin == 0:
            out.rows[0], new = x, 0
        written = (
            data.model, plan.time, first - 1 + new, new, int(place.output[0]), part, out, signals,
            of_loads, own_room, series,
        )  # fmt: skip
        if begin == 0:
            _compile(lay_out, written)
        with stage("loads"):
            lay_out(*written)
        begin, first = end, known
    extra = counters() if block.prepared.extra is None else block.prepared.extra(method)
    return _Group(series, out.diverged_at, clamped, extra, wall)


def _compile(function: Any, arguments: tuple[Any, ...]) -> None:
    """Compile for these arguments, or load it from the cache, as a process does once: that is no time of the integration."""
    from numba import typeof

    types = tuple(typeof(argument) for argument in arguments)
    if types not in function.overloads:
        function.compile(types)


def _trajectory(block: Block, wind: WindSource, group: _Group, lane: int) -> Trajectory:
    plan, step, steps, series = block.plan, block.step, block.steps, group.series
    n, diverged_at = len(plan.time), float(group.diverged_at[lane])
    if diverged_at >= 0:
        # outputs between two step ends need both: the last one that does not lie after the last good step end
        n = max(int(np.searchsorted(plan.time, diverged_at - step * (1 - 1e-9))), 1)
        steps = round(diverged_at / step)
    limit, layout, turbine = block.prepared.limit, block.data.model.layout, block.turbine
    time_points, own = plan.time[:n].copy(), series.state[lane, :, :n].T
    pitch = block.pitch.at(time_points) if isinstance(block.pitch, PitchSeries) else block.pitch
    named = dict(zip(block.data.model.generated.LOADS, series.loads[lane, :, :n], strict=True))
    loads = turbine.completed(named, own, pitch)
    blown = series.wind[lane, layout.wind_rows(wind.channels), :n].T
    seen = () if turbine.controller is None else turbine.controller.seen
    return Trajectory(
        time=time_points,
        state=own,
        wind=blown,
        loads=loads,
        accepted=series.accepted[lane, : n - 1],
        discrepancy=np.broadcast_to(np.nan, n - 1) if np.isnan(limit) else series.discrepancy[lane, : n - 1],
        threshold=np.broadcast_to(limit, n - 1),
        local_error=series.errors[lane, : n - 1],
        steps=steps,
        evaluations=block.prepared.evaluations(steps) + int(group.extra[lane]),
        clamped_lookups=int(group.clamped[lane]),
        wall_time=group.wall / len(series.state),
        diverged_at=diverged_at if diverged_at >= 0 else None,
        states=layout.states,
        wind_signals=wind.channels,
        pitch=loads["blade_pitch"],
        control={name: own[:, layout.row(name)] for name in layout.names[2 * layout.freedoms :]}
        | turbine.observed(own),
        control_signals=seen,
    )
