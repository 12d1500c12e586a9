"""Training data of an exponential Adams method: what its predictor and its corrector see of a step, and what they leave.

Everything is linear in rows that the step has anyway (`features.multi_blade`), in multi-blade coordinates, where an isotropic
rotor's map does not depend on the azimuth.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fatigue_runner.corrector.coordinates import (
    Array,
    Turn,
    blown,
    from_fixed,
    nonlinear_part,
    of_harmonics,
    parts_to_fixed,
    relative,
    relative_to_fixed,
    turn_of,
)
from fatigue_runner.corrector.samples import places
from fatigue_runner.integrators.command_rows import command_count, command_rows, commanded
from fatigue_runner.integrators.linear_part import linearisation_point
from fatigue_runner.layout import WIND

if TYPE_CHECKING:
    from fatigue_runner.trajectory import Trajectory
    from fatigue_runner.turbine import Turbine

WARM = 3  # steps from true states before the sampled one: its earlier values then lie at predicted states, as in a run

BEGINNING, BEGUN = (
    8,
    5.0,
)  # one sample in so many lies in a run's first seconds [s], where the shaft still rings


BENDING = 4  # with commands, one in so many lies where these bend most: corners are rare


_ARRAYS = ("ahead_rows", "rows", "ahead", "plain", "exact", "speeds")


@dataclass
class Steps:
    """n sampled steps: what predictor and corrector saw (n, rows), the plain results (n, states) of both, the exact one, the mean winds
    (n,) [m/s], and the rotor's turn."""

    ahead_rows: Array
    rows: Array
    ahead: Array
    plain: Array
    exact: Array
    speeds: Array
    turn: Turn

    @property
    def defect(self) -> Array:
        """Exact minus plain (n, states): what the corrector's learned part is to give."""
        return self.exact - self.plain

    @property
    def ahead_defect(self) -> Array:
        """What the predictor's is to give."""
        return self.exact - self.ahead

    def multiplied(self, factors: tuple[int, ...]) -> Array:
        """The corrector's rows, and all of them times each of the rows `factors`."""
        return np.concatenate([self.rows, *(self.rows * self.rows[:, [i]] for i in factors)], axis=1)


def collect(
    turbine: Turbine,
    method: Any,
    step: float,
    past: int,
    winds: Sequence[Any],
    runs: Sequence[Trajectory],
    per_wind: int,
    seed: int,
    damping: float,
    learned_ahead: Sequence[Callable[[float], Array]] = (),
    bins: tuple[float, ...] = (),
    length: int = 1,
    commands: bool = False,
) -> Steps:
    """Steps from random places of true trajectories `runs`, sampled every `step` [s], `length` of them in a row; learned_ahead: (states,
    rows) part of the predictor for a mean wind [m/s], which may differ between the nearest of `bins`, then that of its second product;
    damping [1/s]: see `multi_blade.linear`; commands: whether what is commanded within a step is seen."""
    rng = np.random.Generator(np.random.PCG64(seed))
    first = past + WARM
    picks = [
        places(rng, first, len(run.time) - 1, per_wind, length, wind, step)
        for wind, run in zip(winds, runs, strict=True)
    ]
    for pick, run in zip(picks, runs, strict=True):
        early = pick.reshape(-1, length)[::BEGINNING]
        last = min(first + round(BEGUN / step), len(run.time) - length)
        early[:] = rng.integers(first, last, len(early))[:, None] + np.arange(length)
        if commands and length == 1:
            bent = pick[BENDING // 2 :: BENDING]
            bent[:] = first + most_bent(commanded(turbine, run.state[first - 1 :]), len(bent))
    kinds: dict[tuple[float, float], list[int]] = {}  # winds that share their matrices
    for i, w in enumerate(winds):
        nearest = min(bins, key=lambda b: abs(b - w.mean_speed), default=0.0)
        kinds.setdefault((linearisation_point(turbine, w.mean_speed), nearest), []).append(i)
    size = max(turbine.layout.wind_size(w.channels) for w in winds)
    parts = []
    for (point, nearest), here in kinds.items():
        found: Any = [[values[i] for i in here] for values in (winds, runs, picks)]
        learned = [of(nearest) for of in learned_ahead]
        parts.append(_at(turbine, method, step, past, point, found, size, damping, learned, commands))
    return parts[0] if len(parts) == 1 else joined(parts)


def most_bent(values: Array, count: int) -> Array:
    """(count,) numbers n, all different as far as they go, of the steps from row n + 1 of values (rows, k) to the next that lie at the
    largest changes of slope, each column in units of its usual one."""
    bend = np.abs(np.diff(values, n=2, axis=0))
    bend /= np.maximum(np.sqrt((bend**2).mean(axis=0)), 1e-300)
    found = np.argsort(-bend.max(axis=1), kind="stable")[: max(1, min(count, len(bend) // 2))]
    return np.resize(found, count)


def joined(parts: Sequence[Steps]) -> Steps:
    """All of them, one after the other."""
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in _ARRAYS
    }
    cosines, sines = zip(*(part.turn for part in parts), strict=True)
    return Steps(**arrays, turn=(np.concatenate(cosines), np.concatenate(sines)))


def _at(
    turbine: Turbine, method: Any, step: float, past: int, point: float, found: list[Any], size: int, damping: float,
    learned_ahead: list[Array], commands: bool,
) -> Steps:  # fmt: skip
    """Those of the winds of one linearisation point; found: winds, runs, and places in them; size: rows of the wind that has most."""
    layout = turbine.layout
    winds, runs, picks = found
    ahead_base, plain_base = method.matrices(
        turbine, step, 0.0, past, damping, point, size > len(layout.wind)
    )
    ahead_all = ahead_base + learned_ahead[0] if learned_ahead else ahead_base
    # the second product, which begins as the first
    again_all = np.zeros((len(ahead_base), ahead_base.shape[1] + commands * command_count(past)))
    again_all[:, : ahead_base.shape[1]] = ahead_all if len(learned_ahead) < 2 else ahead_base
    if len(learned_ahead) > 1:
        again_all += learned_ahead[1]

    def state(back: int) -> Array:
        return np.concatenate([run.state[pick - back] for run, pick in zip(runs, picks, strict=True)])

    def wind(back: int, place: float) -> Array:
        return np.concatenate(
            [
                blown(turbine, w, run.time[pick - back] + place * step, size)
                for w, run, pick in zip(winds, runs, picks, strict=True)
            ]
        )

    # nonlinear parts, the newest first; the oldest ones at true states, then at predicted ones
    parts = [
        nonlinear_part(turbine, state(i), wind(i, 0.0), damping, point) for i in range(WARM, WARM + past)
    ]
    made = [commanded(turbine, state(i)) for i in range(WARM, WARM + past)] if commands else []
    for back in range(WARM, -1, -1):
        x = state(back)
        pressure = np.stack([wind(back, place) for place in (0.0, 0.5, 1.0)], axis=1)
        turn = turn_of(layout, x)
        seen = rows(turbine, x, pressure, parts, turn, step)
        there = x + from_fixed(layout, seen @ ahead_all.T, turn)
        ahead_rows = seen
        if commands and learned_ahead:
            ahead_rows = np.concatenate([seen, command_rows(turbine, x, there, made, step)], axis=1)
            there = x + from_fixed(layout, ahead_rows @ again_all.T, turn)
        part = nonlinear_part(turbine, there, pressure[:, 2], damping, point)
        parts = [part, *parts]
        whole = [seen, parts_to_fixed(layout, part, turn)]
        if commands:
            whole.append(command_rows(turbine, x, there, made, step))
            made = [commanded(turbine, there), *made[:-1]]
        if back:
            parts = parts[:past]
    ahead = x + from_fixed(layout, seen @ ahead_base.T, turn)
    plain = x + from_fixed(layout, np.concatenate(whole[:2], axis=1) @ plain_base.T, turn)
    speeds = np.repeat([w.mean_speed for w in winds], [len(pick) for pick in picks])
    return Steps(ahead_rows, np.concatenate(whole, axis=1), ahead, plain, state(-1), speeds, turn)


def rows(turbine: Turbine, x: Array, wind: Array, parts: list[Array], turn: Turn, step: float) -> Array:
    """(n, rows) what a predictor sees: states (n, states), wind (n, 3, rows) at start, middle and end, earlier parts, the newest
    first."""
    layout, own = turbine.layout, len(turbine.layout.wind)
    felt = []
    if layout.harmonics or wind.shape[2] > own:
        felt = [
            of_harmonics(layout, x, i * step / 2, wind[:, i, layout.first_harmonic :])
            for i in range(wind.shape[1])
        ]
    wind = wind[:, :, :own]
    state = relative_to_fixed(layout, relative(layout, x, turbine.gearbox_ratio), turn)
    pressure = wind.copy()
    # the wind that the shears add at the rotor's edge; other signals as they are
    pressure[:, :, 1 : len(WIND)] *= wind[:, :, :1]
    earlier = [parts_to_fixed(layout, part, turn) for part in parts]
    return np.concatenate(
        [np.ones((len(x), 1)), state, pressure.reshape(len(x), -1), *felt, *earlier], axis=1
    )
