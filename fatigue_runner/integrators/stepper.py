"""The one compiled time loop: output, checks and the end of a diverged run are written here, the step itself in each family's file.

A family has its coefficients and its room in a NamedTuple, `method`, and registers (see `choice`) what a step consists of:

    begin    k[0] = slope at the start, from ring.restart; the signals stand at time 0
    advance  ring.current and ring.states[new] = the state a step after ring.states[now]; returns whether it is within the bounds
    recover  after a step that was not: forget what the restarted lanes must not see again
    finish   k[new] = slope at the new state, for the next step and for the output, which needs it where `wanted`
    note     what a step's figures are since the last note, into row `interval` of out.accepted, discrepancy and errors

Arguments in common: model (its type says which equations); n, h, now, new: the step's number, its size [s], and the rows of its two
ends in the rings of three; signals: `Signals`; data: `KernelArrays`; ring: `Ring`. Row 0 to 2 of ring.k belong to the last three
step ends, the others to the family.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.compiled import LEAN, njit
from fatigue_runner.integrators.signals import signals_at
from fatigue_runner.integrators.stepping import keep, mark_diverged, write_output
from fatigue_runner.turbine.lane_code import LANES

Array = NDArray[np.float64]

RING = 3  # first row of k that is a family's own


class Ring(NamedTuple):
    """states (3, width), slopes k (rows, width); current: the newest state; slope: room for one more; restart: where the run began, for
    lanes that diverge; largest (padded_rows * LANES,): errors since the last note."""

    states: Array
    k: Array
    current: Array
    slope: Array
    restart: Array
    largest: Array


class Output(NamedTuple):
    """rows (n, width) of states; per interval and lane (n - 1, LANES): accepted, discrepancy, errors, written in the row of a step's
    first output; diverged_at (LANES,): -1 or the time [s]."""

    rows: Array
    accepted: NDArray[np.bool_]
    discrepancy: Array
    errors: Array
    diverged_at: Array


def begin(method, model, h, signals, data, ring):
    raise NotImplementedError("compiled code only")


def advance(method, model, n, h, now, new, signals, data, ring):
    raise NotImplementedError("compiled code only")


def recover(method):
    raise NotImplementedError("compiled code only")


def finish(method, model, n, h, now, new, wanted, signals, data, ring):
    raise NotImplementedError("compiled code only")


def note(method, model, ring, out, interval):
    raise NotImplementedError("compiled code only")


class Place(NamedTuple):
    """Where a run is between two calls of `run`, one number each (1,): row of the newest step end in the rings, next output."""

    now: NDArray[np.int64]
    output: NDArray[np.int64]


@njit(**LEAN)
def run(method, model, h, begin_step, end_step, signals, data, ring, place, plan, out):
    """Advance one group from step `begin_step` (0: the start) to `end_step`, of size h [s]; returns whether all lanes have diverged, so
    that it ended early.

    plan: `output.PlanArrays` of the outputs that become known on the way, behind one more, the last that was known before, as
    are the rows of `out`; place.output is 1 at the beginning, and the number of rows that are written at the end.
    """
    now, output, gone = place.now[0], place.output[0], False
    if begin_step == 0:
        keep(model, ring.restart, out.rows, 0)
        signals_at(model, 0.0, signals)
        begin(method, model, h, signals, data, ring)
    for n in range(begin_step, end_step):
        new = (now + 1) % 3
        if not advance(method, model, n, h, now, new, signals, data, ring):
            gone = mark_diverged(model, ring.current, (n + 1) * h, out.diverged_at, ring.restart)
            keep(model, ring.current, ring.states, new)
            recover(method)
        # the output interpolates through three step ends at most
        wanted = output < len(plan.step) and plan.step[output] <= n + RING
        finish(method, model, n, h, now, new, wanted, signals, data, ring)
        now, first = new, output
        while output < len(plan.step) and plan.step[output] <= n + 1:
            write_output(model, output, plan, h, ring.states, ring.k, now, out.rows)
            output += 1
        if output > first:
            note(method, model, ring, out, first - 1)
        if gone:
            break
    place.now[0], place.output[0] = now, output
    return gone


def room(start: Array, slopes: int, padded: int, aligned: object) -> Ring:
    """A ring for the initial states `start` (width,) and `slopes` rows of k; padded: rows of `largest`; aligned: copies onto cache
    lines."""
    assert callable(aligned)
    zeros = np.zeros_like(start)
    return Ring(
        states=aligned(np.stack([start, start, start])),
        k=aligned(np.zeros((slopes, len(start)))),
        current=aligned(start),
        slope=aligned(zeros),
        restart=aligned(start),
        largest=aligned(np.zeros(padded * LANES)),
    )
