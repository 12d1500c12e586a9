"""What a controller commands within a step, as rows for a learned map: it is known without an evaluation of the equations.

Pitch and torque follow from the controller's own states, which are smooth; the corners are in the commands. A polynomial through their
values at step ends does not know of a corner between these, and at rated wind that is the error of a step. So the controller's states are
interpolated between the step's start and its predicted end (cubic Hermite, with the rates there), the commands are made of them at
`POINTS` Gauss points, and a map sees their moments over the step: integrals with Legendre's polynomials of degree 0 to `MOMENTS` - 1.
Beside them it sees the commands at the predicted end and at the places of the earlier nonlinear parts. Other states that a controller might
look at are taken as they are at the step's start.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import NDArray

from fatigue_runner.compiled import INLINE, njit
from fatigue_runner.integrators.contract import Aligned
from fatigue_runner.layout import Layout
from fatigue_runner.turbine.lane_code import LANES
from fatigue_runner.turbine.model import COMMANDS, commands, first_order, freedoms, width

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine

Array = NDArray[np.float64]

POINTS, MOMENTS = 4, 3


def _quadrature() -> tuple[Array, Array]:
    """(POINTS, 4) Hermite weights of start, its rate, end, its rate [per step]; (POINTS, MOMENTS) weights of the moments."""
    places, weights = np.polynomial.legendre.leggauss(POINTS)
    t = (places + 1) / 2
    hermite = np.stack(
        [(1 + 2 * t) * (1 - t) ** 2, t * (1 - t) ** 2, t * t * (3 - 2 * t), t * t * (t - 1)], axis=1
    )
    basis = [np.polynomial.legendre.Legendre.basis(k)(places) * weights / 2 for k in range(MOMENTS)]
    return hermite, np.stack(basis, axis=1)


HERMITE, BASIS = _quadrature()


@register_jitable(**INLINE)
def command_count(past: int) -> int:
    """Rows of a step that holds `past` earlier nonlinear parts."""
    return COMMANDS * (MOMENTS + 1 + past)


def commanded(turbine: Turbine, x: Array) -> Array:
    """(n, COMMANDS) of states (n, size)."""
    made = turbine.commanded(x)
    return np.stack([made["pitch"], made["generator_torque"]], axis=-1)


def command_rows(turbine: Turbine, x: Array, ahead: Array, earlier: list[Array], step: float) -> Array:
    """(n, `command_count`) of steps from states x (n, size) to predicted ones; earlier: `commanded` at the places of the earlier nonlinear
    parts, the newest first. Numpy's form of what is compiled below."""
    own = turbine.layout.first_order_rows
    ends = np.stack([x[:, own], step * _rates(turbine, x), ahead[:, own], step * _rates(turbine, ahead)])
    within = np.repeat(x[:, None], POINTS, axis=1)
    within[:, :, own] = np.einsum("pe,enc->npc", HERMITE, ends)
    moments = np.einsum("pk,npc->nkc", BASIS, commanded(turbine, within))
    return np.concatenate([moments.reshape(len(x), -1), commanded(turbine, ahead), *earlier], axis=1)


def _rates(turbine: Turbine, x: Array) -> Array:
    """(n, own states) of the controller's states in states x (n, size)."""
    assert turbine.controller is not None
    states = dict(zip(turbine.layout.names, x.T, strict=True))
    made = turbine.controller.rates(states, turbine.control_parameters, np.sqrt)
    return np.stack([made[name] for name in turbine.controller.names], axis=1)


class CommandRoom(NamedTuple):
    """at: commands and rates (lines, k LANES) at the places of the nonlinear parts; start, made: the same at the step's start and within
    it; within: a state. Empty for maps that do not see commands."""

    at: Array
    start: Array
    made: Array
    within: Array


def command_room(layout: Layout, lines: int, seen: bool, aligned: Aligned) -> CommandRoom:
    """For a ring of so many lines; seen: whether a map sees commands."""
    many = (COMMANDS + len(layout.first_order)) * LANES if seen else 0
    sizes = lines * many, many, many, layout.size * LANES if seen else 0
    at, start, made, within = (aligned(np.zeros(size)) for size in sizes)
    return CommandRoom(at.reshape(lines, many), start, made, within)


@njit(**INLINE)
def keep_commands(model: Any, x: Array, room: CommandRoom, line: int, data: Any) -> None:
    """Line of the ring = commands and rates in the state x, where they are seen."""
    if len(room.made) > 0:
        commands(model, x, room.made, 0, data)
        for m in range(len(room.made)):
            room.at[line, m] = room.made[m]


@njit(**INLINE)
def command_lines(
    model: Any,
    h: float,
    x: Array,
    ahead: Array,
    room: CommandRoom,
    past: int,
    line: int,
    rows: Array,
    to: int,
    data: Any,
) -> None:
    """Rows `to` on = what is commanded in the step from x to `ahead`; its end's own commands stand in line `line` of the ring, those of
    `past` earlier places before it."""
    first = 2 * freedoms(model) * LANES
    commands(model, x, room.start, 0, data)
    for m in range(width(model)):
        room.within[m] = x[m]
    for m in range(COMMANDS * MOMENTS * LANES):
        rows[to * LANES + m] = 0.0
    for p in range(POINTS):
        a, b, c, d = HERMITE[p, 0], h * HERMITE[p, 1], HERMITE[p, 2], h * HERMITE[p, 3]
        for m in range(first_order(model) * LANES):
            rate, later = room.start[COMMANDS * LANES + m], room.at[line, COMMANDS * LANES + m]
            room.within[first + m] = a * x[first + m] + b * rate + c * ahead[first + m] + d * later
        commands(model, room.within, room.made, 0, data)
        for k in range(MOMENTS):
            by = BASIS[p, k]
            for m in range(COMMANDS * LANES):
                rows[(to + COMMANDS * k) * LANES + m] += by * room.made[m]
    for i in range(past + 1):
        own = (line - i + past + 1) % (past + 1)
        for m in range(COMMANDS * LANES):
            rows[(to + COMMANDS * (MOMENTS + i)) * LANES + m] = room.at[own, m]
