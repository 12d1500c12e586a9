"""A ladder of steps: what a corrected step's guard refuses is made anew in corrected steps of half the size, a quarter, ...

Each lane takes the largest step whose guard accepts it, and RK4 where none does. The group makes what any of its lanes needs, and a lane
takes over its own alone, so that its result does not depend on its neighbours. An exponential Adams method looks back; where there
was no step of a smaller rung before, its earlier nonlinear parts are evaluated at states between the last step ends, by the Hermite
polynomial through three of them. So every step begins on the largest rung anew, without a memory of what was refused before.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.compiled import INLINE, LEAN, njit
from fatigue_runner.integrators.choice import compiled_for
from fatigue_runner.integrators.contract import Aligned
from fatigue_runner.integrators.exponential_steps import (
    ExponentialAdamsArrays,
    Room,
    Tested,
    advance_adams,
    begin_adams,
    copy_line,
    copy_wind,
    correct,
    evaluations_of_refused,
    finer,
    finish_adams,
    keep_part,
    note_adams,
    predict,
    recover_adams,
    set_all,
)
from fatigue_runner.integrators.multi_blade_rows import part_size
from fatigue_runner.integrators.output import PlanArrays, places_between
from fatigue_runner.integrators.protocol import MultiBladeData
from fatigue_runner.integrators.runge_kutta import Stages, Sum
from fatigue_runner.integrators.signals import Signals, signals_at
from fatigue_runner.integrators.stepper import Ring, advance, begin, finish, note, recover, room
from fatigue_runner.integrators.stepping import write_output
from fatigue_runner.turbine.lane_code import LANES
from fatigue_runner.turbine.model import rhs, width

Array = NDArray[np.float64]

ENDS = 3  # step ends that the ring holds


class Rung(NamedTuple):
    """`steps` of a corrected method make one of the ladder's. between: the places of its earlier parts, states (past, width) there; ring:
    room of its own."""

    method: ExponentialAdamsArrays
    steps: int
    between: PlanArrays
    states: Array
    ring: Ring


class LadderArrays(NamedTuple):
    """As `ExponentialAdamsArrays`, and the rungs below."""

    low: Array
    ratio: float
    past: int
    stages: Stages
    result: Sum
    substeps: int
    maps: MultiBladeData
    tested: Tested
    room: Room
    rungs: tuple[Rung, ...]


def with_rungs(
    top: ExponentialAdamsArrays, below: Sequence[tuple[int, ExponentialAdamsArrays]], start: Array, layout: Any, aligned: Aligned
) -> LadderArrays:  # fmt: skip
    """The ladder of `top` and of `below`, (number of steps in one of the top's, arrays); start (width,): any states."""
    padded = 1 << (layout.size - 1).bit_length()
    rungs = tuple(
        Rung(
            method,
            steps,
            places_between([-i / steps for i in range(method.past)]),
            np.zeros((method.past, len(start))),
            room(start, 1, padded, aligned),
        )
        for steps, method in below
    )
    return LadderArrays(*top, rungs)


def reaches(past: int, steps: int) -> int:
    """Step ends before the newest one that a rung of `steps` with `past` earlier parts looks back over."""
    return -(-(past - 1) // steps)


def evaluations_of_rungs(method: LadderArrays) -> NDArray[np.int64]:
    """Of the steps made anew: on each rung its steps and its earlier parts that lie between step ends; then those of RK4."""
    total = evaluations_of_refused(method)
    for rung in method.rungs:
        between = sum(1 for i in range(rung.method.past) if i % rung.steps)
        total = total + rung.method.room.refused * (rung.steps + between)
    return total


@njit(**LEAN)
def _copy_part(model: Any, source: Array, line: int, target: Array, to: int) -> None:
    for m in range(part_size(model) * LANES):
        target[to, m] = source[line, m]


@njit(nogil=True, error_model="numpy", _nrt=False)
def _stand_in(model: Any, x: Array, states: Array, now: int) -> None:
    """x where it is finite, else the state of the step's start: a lane that has diverged has no past to look at."""
    for m in range(width(model)):
        value = x[m]
        x[m] = value if abs(value) < np.inf else states[now, m]


@njit(nogil=True, error_model="numpy", _nrt=False)
def _take_over(model: Any, rung: Any, room: Any, ring: Any, line: int, newest: int) -> bool:
    """The lanes that were not fine and are on the rung take its result; returns whether all are fine now."""
    own, inner = rung.method.room, rung.ring
    whole = True
    for j in range(LANES):
        if not room.fine[j]:
            own.refused[j] += 1  # steps that came down to this rung
            if not own.fine[j]:
                whole = False
                continue
            for m in range(j, width(model), LANES):
                ring.current[m] = inner.current[m]
                ring.slope[m] = inner.slope[m]
                room.ahead[m] = own.ahead[m]
            for m in range(j, part_size(model) * LANES, LANES):
                room.ring[line, m] = own.ring[newest, m]
            for m in range(j, len(room.commands.made), LANES):
                room.commands.at[line, m] = own.commands.at[newest, m]
            room.fine[j] = True
            room.refused[j] -= 1
    return whole


@njit(**LEAN)
def _step_down(
    model: Any, method: Any, rung: Any, n: int, h: float, now: int, signals: Any, data: Any, ring: Any
) -> int:
    """The step anew in `rung.steps` smaller ones, all lanes of it; returns the line of the newest nonlinear part."""
    top, own, room, inner = method.room, rung.method, rung.method.room, rung.ring
    past, steps, small = own.past, rung.steps, h / rung.steps
    lines = past + 1
    between = Signals(
        signals.cell_duration, signals.cells, signals.changing, signals.control, room.wind, signals.u
    )
    for i in range(past):
        # the newest stands in line `past`, so that none is negative
        if i % steps == 0:
            before = (n - i // steps) % (method.past + 1)
            _copy_part(model, top.ring, before, room.ring, past - i)
            for m in range(len(room.commands.made)):
                room.commands.at[past - i, m] = top.commands.at[before, m]
        else:
            write_output(model, i, rung.between, h, ring.states, ring.k, now, rung.states)
            copy_line(model, rung.states, i, room.stage)
            _stand_in(model, room.stage, ring.states, now)
            if signals.changing:
                signals_at(model, n * h - i * small, between)
            else:
                copy_wind(model, signals.p, room.wind)
            rhs(model, room.stage, room.wind, signals.u, inner.slope, 0, data)
            keep_part(model, own, room.stage, inner.slope, past - i, data)
    copy_line(model, ring.states, now, inner.current)
    copy_wind(model, top.start, room.start)
    copy_wind(model, top.middle, room.middle)
    set_all(room.fine, True)
    for s in range(steps):
        newest, line = (past + s) % lines, (past + s + 1) % lines
        if signals.changing:
            signals_at(model, (n + (s + 0.5) / steps) * h, signals)
            copy_wind(model, signals.p, room.middle)
            signals_at(model, (n + (s + 1) / steps) * h, signals)
        predict(model, own, small, newest, signals, data, inner)
        rhs(model, room.ahead, signals.p, signals.u, inner.slope, 0, data)
        keep_part(model, own, room.ahead, inner.slope, line, data)
        correct(model, own, small, line, data, inner)
        copy_wind(model, signals.p, room.start)
    return (past + steps) % lines


@compiled_for(finer, LadderArrays)
@njit(**INLINE)
def _finer(
    method: Any, model: Any, n: int, h: float, now: int, line: int, signals: Any, data: Any, ring: Any
) -> bool:
    if n < ENDS - 1:
        return False
    for rung in method.rungs:
        newest = _step_down(model, method, rung, n, h, now, signals, data, ring)
        if _take_over(model, rung, method.room, ring, line, newest):
            return True
    return False


compiled_for(begin, LadderArrays)(begin_adams)
compiled_for(recover, LadderArrays)(recover_adams)
compiled_for(advance, LadderArrays)(advance_adams)
compiled_for(note, LadderArrays)(note_adams)


@compiled_for(finish, LadderArrays)
@njit(**INLINE)
def _finish(
    method: Any,
    model: Any,
    n: int,
    h: float,
    now: int,
    new: int,
    wanted: bool,
    signals: Any,
    data: Any,
    ring: Any,
) -> None:
    # the rungs look at places between step ends, output or not
    finish_adams(method, model, n, h, now, new, True, signals, data, ring)
