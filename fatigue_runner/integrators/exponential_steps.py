"""The compiled step of the exponential Adams methods, and what it reads.

Predictor and corrector are one matrix product each on the rows of a step in multi-blade coordinates (`multi_blade`). A learned
correction is another matrix on the same rows. Guarded (hybrid), the corrected result must agree with that of the method as it is, and
with the predicted one; a step that does not is made anew: by smaller corrected ones where there is a ladder of them (`step_ladder`), else
by a few of RK4, which is stable where the method may not be.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.compiled import INLINE, LEAN, njit
from fatigue_runner.integrators import multi_blade
from fatigue_runner.integrators.choice import compiled_for
from fatigue_runner.integrators.command_rows import (
    CommandRoom,
    command_count,
    command_lines,
    command_room,
    keep_commands,
)
from fatigue_runner.integrators.contract import Aligned
from fatigue_runner.integrators.dense import blocks_of, dense_rows, multiply, pack
from fatigue_runner.integrators.guard import GuardUnits, guard, guard_units, norm_of
from fatigue_runner.integrators.multi_blade_rows import (
    advanced,
    forget_infinite,
    harmonic_rows,
    nonlinear_part,
    part_rows,
    part_size,
    relative,
    relative_rows,
    shifted_slope,
    sine_cosine,
    state_rows,
    wind_rows,
)
from fatigue_runner.integrators.protocol import MultiBladeData, StepCorrector
from fatigue_runner.integrators.runge_kutta import Stages, Sum, slope_rows
from fatigue_runner.integrators.signals import Signals, signals_at
from fatigue_runner.integrators.single_steps import integrate
from fatigue_runner.integrators.stepper import advance, begin, finish, note, recover
from fatigue_runner.integrators.stepping import (
    all_fine,
    keep,
    keep_largest_distance,
    move,
    note_step,
    subtract,
)
from fatigue_runner.integrators.tableaux import RK4
from fatigue_runner.layout import BLADES
from fatigue_runner.turbine.lane_code import LANES
from fatigue_runner.turbine.model import constant, harmonics, rhs, rows, width, wind_signals

Array = NDArray[np.float64]

first_wind_row = constant(multi_blade.wind_row)
first_harmonic_row = constant(multi_blade.harmonic_row)
first_past_row = constant(multi_blade.past_row)


class Tested(NamedTuple):
    """The hybrid's acceptance test: units of the corrected result's distance from the predicted one and from that of the method as it is,
    limit and norm of both; substeps: of RK4 in a step that is refused."""

    hybrid: bool
    ahead_units: GuardUnits
    units: GuardUnits
    limit: float
    norm: int
    substeps: int


def tested_by(corrector: StepCorrector | None, hybrid: bool, states: int) -> Tested:
    if corrector is None:
        units = guard_units((1.0,) * states, (0.0,) * states)
        return Tested(False, units, units, 0.0, 0, 1)
    judge = corrector.guard
    ahead, units = (guard_units(atol, judge.rtol) for atol in (judge.ahead_atol, judge.atol))
    return Tested(hybrid, ahead, units, float(judge.limit), norm_of(judge), judge.substeps)


class Room(NamedTuple):
    """ahead, fixed, other, change: states; middle, start: winds; seen: rows of the step; ring: nonlinear parts; judged: since the last
    note, fine: in this step, refused: steps that RK4 made, per lane; then the arrays of the start and of refused steps."""

    ahead: Array
    fixed: Array
    other: Array
    change: Array
    start: Array
    middle: Array
    seen: Array
    ring: Array
    turned: Array
    turn: Array
    rel: Array
    product: Array
    judged: tuple[Array, NDArray[np.bool_]]
    fine: NDArray[np.bool_]
    refused: NDArray[np.int64]
    scaled: Array
    states: Array
    k: Array
    stage: Array
    wind: Array
    commands: CommandRoom


class ExponentialAdamsArrays(NamedTuple):
    low: Array
    ratio: float
    past: int
    stages: Stages
    result: Sum
    substeps: int
    maps: MultiBladeData
    tested: Tested
    room: Room


def evaluations_of_refused(method: Any) -> NDArray[np.int64]:
    """Of the steps made anew: those of RK4, and one at the new place."""
    return method.room.refused * (RK4.evaluations_per_step * method.tested.substeps + 1)


def plain_maps(ahead: Array, plain: Array) -> MultiBladeData:
    """Of the method alone."""
    corrector = pack(plain)[0]
    return MultiBladeData(pack(ahead)[0], np.zeros(0), corrector, corrector, np.zeros(0, np.int64))


def room_for(
    start: Array, blown: int, layout: Any, past: int, factors: int, steered: bool, aligned: Aligned
) -> Room:
    """steered: whether the map sees what is commanded within a step."""
    width, padded = len(start), 8 * blocks_of(layout.size) * LANES
    part = multi_blade.parts(layout)
    inputs = (multi_blade.base_rows(layout, past) + steered * command_count(past)) * (1 + factors)
    halves = 1 << (layout.size - 1).bit_length()
    zeros = {
        "ahead": padded, "fixed": padded, "other": padded, "change": padded,
        "start": blown, "middle": blown,
        "seen": inputs * LANES, "turned": 2 * LANES, "turn": 6 * LANES, "rel": layout.relative_size * LANES,
        "product": 8 * blocks_of(part) * LANES, "scaled": halves * LANES, "stage": width,
        "wind": blown,
    }  # fmt: skip
    return Room(
        **{name: aligned(np.zeros(size)) for name, size in zeros.items()},
        ring=aligned(np.zeros((past + 1, part * LANES))),
        judged=(aligned(np.zeros(LANES)), np.ones(LANES, np.bool_)),
        fine=np.ones(LANES, np.bool_),
        refused=np.zeros(LANES, np.int64),
        states=aligned(np.zeros((3, width))),
        k=aligned(np.zeros((slope_rows(RK4), width))),
        commands=command_room(layout, past + 1, steered, aligned),
    )


# --- the step ---


@njit(**LEAN)
def copy_line(model, table, line, out):
    for m in range(width(model)):
        out[m] = table[line, m]


@njit(**LEAN)
def copy_wind(model, p, out):
    # all that blows, harmonics, too
    for m in range(len(out)):
        out[m] = p[m]


@njit(**INLINE)
def times_linear(model, method, x):
    """room.product = linear part of the accelerations at the state x."""
    room = method.room
    relative(model, x, 1.0 / method.ratio, room.rel, 0)
    dense_rows(room.rel, method.low, relative_rows(model), part_size(model), room.product)


@njit(**INLINE)
def keep_part(model, method, x, slope, line, data):
    """Line of the ring = nonlinear part, and what is commanded, in the state x, whose slope is known."""
    room = method.room
    times_linear(model, method, x)
    nonlinear_part(model, slope, room.product, 1.0 / method.ratio, room.ring, line)
    keep_commands(model, x, room.commands, line, data)


@compiled_for(begin, ExponentialAdamsArrays)
@njit(**INLINE)
def begin_adams(method, model, h, signals, data, ring):
    room = method.room
    copy_wind(model, signals.p, room.start)
    copy_wind(model, signals.p, room.middle)
    rhs(model, ring.current, signals.p, signals.u, ring.slope, 0, data)
    keep(model, ring.slope, ring.k, 0)
    keep_part(model, method, ring.current, ring.slope, 0, data)


@compiled_for(recover, ExponentialAdamsArrays)
@njit(**INLINE)
def recover_adams(method):
    forget_infinite(method.room.ring)
    forget_infinite(method.room.commands.at)


@njit(**INLINE)
def predict(model, method, h, newest, signals, data, ring):
    """room.ahead = the predictor's result; room.seen = the rows that it sees. Where the map sees what is commanded within the step, the
    first result says where the controller goes, and a second product sees that, too."""
    room, maps, past = method.room, method.maps, method.past
    seen, turned, current = room.seen, room.turned, ring.current
    first, wind, signal_count = first_past_row(model), first_wind_row(model), wind_signals(model)
    sine_cosine(model, current, turned)
    state_rows(model, current, turned, 1.0 / method.ratio, seen)
    wind_rows(model, room.start, seen, wind)
    wind_rows(model, room.middle, seen, wind + signal_count)
    wind_rows(model, signals.p, seen, wind + 2 * signal_count)
    if harmonics(model):
        felt = first_harmonic_row(model)
        harmonic_rows(model, current, 0.0, room.start, turned, room.turn, seen, felt)
        harmonic_rows(model, current, 0.5 * h, room.middle, turned, room.turn, seen, felt + BLADES)
        harmonic_rows(model, current, h, signals.p, turned, room.turn, seen, felt + 2 * BLADES)
    for i in range(past):
        part_rows(model, room.ring, (newest - i) % (past + 1), turned, seen, first + part_size(model) * i)
    inputs = first + part_size(model) * past
    dense_rows(seen, maps.ahead, inputs, rows(model), room.change)
    advanced(model, current, room.change, turned, room.ahead)
    if len(maps.again) > 0:
        line = (newest + 1) % (past + 1)
        keep_commands(model, room.ahead, room.commands, line, data)
        command_lines(model, h, current, room.ahead, room.commands, past, line, seen, inputs, data)
        dense_rows(seen, maps.again, inputs + command_count(past), rows(model), room.change)
        advanced(model, current, room.change, turned, room.ahead)


@njit(**INLINE)
def _learned(model, method, h, line, count, data, ring):
    """room.change = what the learned corrector makes of its `count` rows, of what is commanded, and of its factors."""
    room, maps = method.room, method.maps
    every = count
    if len(maps.again) > 0:
        command_lines(
            model, h, ring.current, room.ahead, room.commands, method.past, line, room.seen, count, data
        )
        every += command_count(method.past)
    if len(maps.factors) > 0:
        multiply(every, maps.factors, room.seen)
    dense_rows(room.seen, maps.weights, every * (1 + len(maps.factors)), rows(model), room.change)


@njit(**INLINE)
def correct(model, method, h, line, data, ring):
    """ring.current = the corrector's result; in hybrid mode judged by that of the method as it is, and by the predictor's: what one step
    cannot follow, a corner of the equations or a wrong map, sets these two apart."""
    room, maps, tested = method.room, method.maps, method.tested
    seen, turned, current = room.seen, room.turned, ring.current
    new_row = first_past_row(model) + part_size(model) * method.past
    count = new_row + part_size(model)
    part_rows(model, room.ring, line, turned, seen, new_row)
    _learned(model, method, h, line, count, data, ring)
    advanced(model, current, room.change, turned, room.fixed)
    if tested.hybrid:
        dense_rows(seen, maps.plain, count, rows(model), room.change)
        advanced(model, current, room.change, turned, room.other)
        guard(
            model, current, room.other, room.fixed, tested.units, tested.limit, tested.norm, room.scaled,
            (room.judged[0], room.fine),
        )  # fmt: skip
        guard(
            model, room.other, room.ahead, room.fixed, tested.ahead_units, tested.limit, tested.norm, room.scaled,
            (room.judged[0], room.fine),
        )  # fmt: skip
    else:
        move(model, room.fixed, current)
    keep_largest_distance(model, current, room.ahead, ring.largest)


@njit(**INLINE)
def learned_products(model, method, h, signals, data, ring):
    """What a step multiplies with learned matrices: the rows that it sees, predictor and corrector."""
    room = method.room
    predict(model, method, h, 0, signals, data, ring)
    count = first_past_row(model) + part_size(model) * method.past
    part_rows(model, room.ring, 0, room.turned, room.seen, count)
    _learned(model, method, h, 0, count + part_size(model), data, ring)


@njit(nogil=True, error_model="numpy", _nrt=False)
def set_all(fine, value):
    for j in range(LANES):
        fine[j] = value


@njit(nogil=True, error_model="numpy", _nrt=False)
def _all_accepted(room):
    """Whether no lane was refused in this step; those that were are counted and noted."""
    accepted, whole = room.judged[1], True
    for j in range(LANES):
        if not room.fine[j]:
            accepted[j] = whole = False
            room.refused[j] += 1
    return whole


@njit(nogil=True, error_model="numpy", _nrt=False)
def replace_refused(model, fine, source, target):
    """target = source in the lanes that are not fine."""
    for i in range(rows(model)):
        for j in range(LANES):
            if not fine[j]:
                target[i * LANES + j] = source[i * LANES + j]


def finer(method, model, n, h, now, line, signals, data, ring):
    """Make the step of the lanes that are not fine anew in smaller ones; returns whether all are fine now."""
    raise NotImplementedError("compiled code only")


@compiled_for(finer, ExponentialAdamsArrays)
@njit(**INLINE)
def _no_finer(method, model, n, h, now, line, signals, data, ring):
    return False


@compiled_for(advance, ExponentialAdamsArrays)
@njit(**INLINE)
def advance_adams(method, model, n, h, now, new, signals, data, ring):
    room, past = method.room, method.past
    newest, line = n % (past + 1), (n + 1) % (past + 1)
    if signals.changing:
        signals_at(model, (n + 0.5) * h, signals)
        copy_wind(model, signals.p, room.middle)
        signals_at(model, (n + 1) * h, signals)
    small = method.substeps if n < past - 1 else 0  # steps of RK4 in this one; 0: predictor and corrector
    set_all(room.fine, small == 0)
    if small == 0:
        predict(model, method, h, newest, signals, data, ring)
    while True:
        if small > 0:
            inner = Signals(
                signals.cell_duration, signals.cells, signals.changing, signals.control, room.wind, signals.u
            )
            copy_line(model, ring.states, now, room.fixed)
            integrate(
                model, room.fixed, method.stages, method.result, h / small, n * small, small, inner, data,
                room.states, room.k, room.stage, room.other,
            )  # fmt: skip
            replace_refused(model, room.fine, room.fixed, ring.current)
            replace_refused(model, room.fine, room.fixed, room.ahead)
        rhs(model, room.ahead, signals.p, signals.u, ring.slope, 0, data)
        keep_part(model, method, room.ahead, ring.slope, line, data)
        if small > 0:
            break
        correct(model, method, h, line, data, ring)
        if not method.tested.hybrid or _all_accepted(room):
            break
        if finer(method, model, n, h, now, line, signals, data, ring):
            break
        small = method.tested.substeps
    keep(model, ring.current, ring.states, new)
    return all_fine(model, ring.current)


@compiled_for(finish, ExponentialAdamsArrays)
@njit(**INLINE)
def finish_adams(method, model, n, h, now, new, wanted, signals, data, ring):
    room = method.room
    if wanted:
        subtract(model, ring.current, room.ahead, room.change)
        times_linear(model, method, room.change)
        shifted_slope(model, ring.slope, room.product, method.ratio, ring.k, new)
    copy_wind(model, signals.p, room.start)


@compiled_for(note, ExponentialAdamsArrays)
@njit(**INLINE)
def note_adams(method, model, ring, out, interval):
    note_step(model, method.room.judged, ring.largest, ring.current, out, interval)
