"""Runge-Kutta methods with a learned correction of the local error: enhanced, and guarded (hybrid).

Enhanced: x+ = eta_h(x) + h^(p+1) N. Hybrid: accepted where the corrected result agrees with that of the fallback, a method of order
p + 1 that shares the stages or smaller steps of the same method; else the fallback is taken (see `guard`).
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.compiled import INLINE, LEAN, njit
from fatigue_runner.errors import InputError
from fatigue_runner.integrators.choice import compiled_for
from fatigue_runner.integrators.contract import Aligned, Lanes, Prepared, Task
from fatigue_runner.integrators.correction import correction
from fatigue_runner.integrators.dense import blocks_of
from fatigue_runner.integrators.guard import GuardUnits, guard, guard_units, norm_of, refuse_outside
from fatigue_runner.integrators.protocol import StepCorrector
from fatigue_runner.integrators.runge_kutta import (
    Stages,
    Sum,
    Tableau,
    nothing_to_forget,
    result_of,
    runge_kutta_arrays,
    slope_rows,
    stage_rows,
    stages_of,
    stages_of_step,
)
from fatigue_runner.integrators.signals import Signals, signals_at
from fatigue_runner.integrators.stepper import RING, advance, begin, finish, note, recover
from fatigue_runner.integrators.stepping import (
    add,
    all_fine,
    combine,
    keep,
    keep_largest,
    move,
    note_step,
    subtract,
)
from fatigue_runner.turbine.lane_code import LANES
from fatigue_runner.turbine.model import rhs, width, wind_signals

Array = NDArray[np.float64]

STARTING = 32  # substeps of a step before there is a history; with few, the start's error outweighs that of the run (measured)
MOST_ROWS = 512  # of features with their factors, and of a hidden layer


class Correctable(Tableau, Protocol):
    """A tableau that may share its stages with that of the next order."""

    @property
    def shared_by(self) -> Tableau | None: ...

    def evaluations(self, steps: int) -> int: ...


class Fallback(NamedTuple):
    """The method that a refused step takes: the stages from `shared` on come on top of the method's own; or `substeps` steps of it."""

    stages: Stages
    result: Sum
    shared: int
    substeps: int


class Tested(NamedTuple):
    """The hybrid's acceptance test; low, high: bounds of the rows that the map sees behind the leading 1, or nothing."""

    hybrid: bool
    units: GuardUnits
    limit: float
    norm: int
    low: Array
    high: Array


class Room(NamedTuple):
    """plain, fixed, other, defect: states; start, middle: winds; seen, hidden: the map's; inner_...: the fallback's substeps."""

    plain: Array
    fixed: Array
    other: Array
    defect: Array
    start: Array
    middle: Array
    seen: Array
    hidden: Array
    judged: tuple[Array, NDArray[np.bool_]]
    scaled: Array
    inner_states: Array
    inner_k: Array
    inner_wind: Array
    inner_stage: Array
    inner_slope: Array


class CorrectedArrays(NamedTuple):
    """A map that looks back at `history` steps begins when it can: until then the fallback steps."""

    stages: Stages
    result: Sum
    stage_rows: NDArray[np.int64]
    learned: Any
    history: int
    fallback: Fallback
    tested: Tested
    room: Room


def prepare(method: Correctable, task: Task, corrector: StepCorrector) -> Prepared:
    """A Runge-Kutta method with a corrector. Raises CorrectorError where that does not fit."""
    stages = method.evaluations_per_step
    corrector.bind(task.turbine, method.name, task.step)
    judge, own = corrector.guard, runge_kutta_arrays(method)
    if judge.substeps == 0:
        fallback, extra = _sharing(method, corrector.name)
    else:
        # tables of its own: the step writes the current slope's row into them
        fallback = Fallback(stages_of(method), result_of(method), 0, judge.substeps)
        extra = judge.substeps * stages - 1
    limit, hybrid = float(judge.limit), task.mode == "hybrid"
    bounds = np.array(judge.low), np.array(judge.high)

    def arrays(lanes: Lanes, aligned: Aligned) -> CorrectedArrays:
        room = _room(lanes.start, len(lanes.signals.p), task, slope_rows(method), aligned)
        units = guard_units(judge.atol, judge.rtol)
        tested = Tested(hybrid, units, limit, norm_of(judge), *bounds)
        learned = corrector.map_data(task.turbine, task.pitch)
        return CorrectedArrays(
            own.stages, own.result, stage_rows(stages), learned, corrector.history, fallback, tested, room
        )

    def evaluations(steps: int) -> int:
        begun = min(steps, corrector.history)
        more = (steps - begun) * extra if hybrid else 0
        return method.evaluations(steps) + begun * (STARTING * stages - 1) + more

    return Prepared(arrays, slope_rows(method), evaluations, limit if hybrid else np.nan)


def _sharing(method: Correctable, name: str) -> tuple[Fallback, int]:
    """The fallback that shares the method's stages, and the evaluations that it costs beside."""
    other = method.shared_by
    if other is None:
        raise InputError(
            f"corrector {name}: {method.name} shares its stages with no method; its guard needs substeps"
        )
    stages = method.evaluations_per_step
    return Fallback(stages_of(other), result_of(other), stages, 0), other.evaluations_per_step - stages


def _room(start: Array, blown: int, task: Task, slopes: int, aligned: Aligned) -> Room:
    layout, width_ = task.layout, len(start)
    padded = 8 * blocks_of(layout.size) * LANES
    zeros = {
        "plain": width_, "fixed": width_, "other": width_, "defect": padded, "start": blown, "middle": blown,
        "seen": MOST_ROWS * LANES, "scaled": (1 << (layout.size - 1).bit_length()) * LANES,
        "inner_wind": blown, "inner_stage": width_, "inner_slope": width_,
    }  # fmt: skip
    return Room(
        **{name: aligned(np.zeros(size)) for name, size in zeros.items()},
        hidden=aligned(np.zeros((2, MOST_ROWS * LANES))),
        judged=(aligned(np.zeros(LANES)), np.ones(LANES, np.bool_)),
        inner_states=np.zeros((3, width_)),
        inner_k=aligned(np.zeros((slopes, width_))),
    )


# --- the step ---


@njit(**LEAN)
def _copy_wind(model, p, out):
    for m in range(wind_signals(model) * LANES):
        out[m] = p[m]


@njit(**LEAN)
def _first_slope_of(model, k, now, out):
    for m in range(width(model)):
        out[0, m] = k[now, m]


@njit(**LEAN)
def _fall_back(model, n, h, now, fallback, substeps, signals, data, ring, room):
    """room.other = result of the fallback from ring.current, which is ring.states[now]."""
    stages, result, k, c = fallback.stages, fallback.result, ring.k, fallback.stages.c
    if substeps == 0:
        for i in range(fallback.shared, len(c)):
            stages.rows[i, 0] = now
            combine(
                model, ring.states, now, k, stages.rows, stages.weights, i, stages.counts[i], h, room.inner_stage
            )  # fmt: skip
            inner = Signals(
                signals.cell_duration, signals.cells, signals.changing, signals.control, room.inner_wind, signals.u
            )  # fmt: skip
            signals_at(model, (n + c[i]) * h, inner)
            rhs(model, room.inner_stage, inner.p, inner.u, room.inner_slope, 0, data)
            keep(model, room.inner_slope, k, RING - 1 + i)
        result.rows[0, 0] = now
        combine(model, ring.states, now, k, result.rows, result.weights, 0, result.terms, h, room.other)
    else:
        small, own, k2, out = h / substeps, room.inner_states, room.inner_k, room.other
        inner = Signals(
            signals.cell_duration, signals.cells, signals.changing, signals.control, room.inner_wind, signals.u
        )  # fmt: skip
        result.rows[0, 0] = 0
        keep(model, ring.current, own, 0)
        _first_slope_of(model, k, now, k2)
        for i in range(substeps):
            number = n * substeps + i
            # with constant wind, too: p must hold the wind at the sub-step's start
            signals_at(model, number * small, inner)
            if i > 0:
                rhs(model, out, inner.p, inner.u, room.inner_slope, 0, data)
                keep(model, room.inner_slope, k2, 0)
                keep(model, out, own, 0)
            stages_of_step(model, stages, number, small, 0, own, k2, inner, data, room.inner_stage)
            combine(model, own, 0, k2, result.rows, result.weights, 0, result.terms, small, out)


@compiled_for(begin, CorrectedArrays)
@njit(**INLINE)
def _begin(method, model, h, signals, data, ring):
    _copy_wind(model, signals.p, method.room.start)
    _copy_wind(model, signals.p, method.room.middle)
    rhs(model, ring.current, signals.p, signals.u, ring.slope, 0, data)
    keep(model, ring.slope, ring.k, 0)


compiled_for(recover, CorrectedArrays)(nothing_to_forget)


@compiled_for(advance, CorrectedArrays)
@njit(**INLINE)
def _advance(method, model, n, h, now, new, signals, data, ring):
    room, tested, result, current = method.room, method.tested, method.result, ring.current
    # stages are made in a room of their own: the map sees the step's start
    at = stages_of_step(model, method.stages, n, h, now, ring.states, ring.k, signals, data, ring.slope)
    result.rows[0, 0] = now
    combine(model, ring.states, now, ring.k, result.rows, result.weights, 0, result.terms, h, room.plain)
    if signals.changing:
        inner = Signals(
            signals.cell_duration, signals.cells, signals.changing, signals.control, room.middle, signals.u
        )
        signals_at(model, (n + 0.5) * h, inner)
        if at != 1.0:
            signals_at(model, (n + 1) * h, signals)
    method.stage_rows[0] = now
    correction(
        method.learned, model, current, ring.k, method.stage_rows, h, room.start, room.middle, signals.p, room.seen, room.hidden,
        room.defect,
    )  # fmt: skip
    if tested.hybrid or n < method.history:
        substeps = STARTING if n < method.history else method.fallback.substeps
        _fall_back(model, n, h, now, method.fallback, substeps, signals, data, ring, room)
        if n < method.history:
            move(model, room.other, current)
        else:
            add(model, room.plain, room.defect, room.fixed)
            guard(
                model, current, room.other, room.fixed, tested.units, tested.limit, tested.norm, room.scaled, room.judged
            )  # fmt: skip
            if len(tested.low) > 0:
                refuse_outside(model, room.seen, tested.low, tested.high, room.other, current, room.judged[1])
        # the logged error estimate is the embedded one, not the learned one
        subtract(model, room.other, room.plain, room.defect)
    else:
        add(model, room.plain, room.defect, current)
    keep_largest(model, room.defect, ring.largest)
    keep(model, current, ring.states, new)
    return all_fine(model, current)


@compiled_for(finish, CorrectedArrays)
@njit(**INLINE)
def _finish(method, model, n, h, now, new, wanted, signals, data, ring):
    rhs(model, ring.current, signals.p, signals.u, ring.slope, 0, data)
    keep(model, ring.slope, ring.k, new)
    _copy_wind(model, signals.p, method.room.start)


@compiled_for(note, CorrectedArrays)
@njit(**INLINE)
def _note(method, model, ring, out, interval):
    note_step(model, method.room.judged, ring.largest, ring.current, out, interval)
