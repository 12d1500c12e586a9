"""Training data of an exponential Adams method: what its predictor and its corrector see of a step, and what they leave.

Everything is linear in rows that the step has anyway (`features.multi_blade`), in multi-blade coordinates, where an isotropic
rotor's map does not depend on the azimuth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fatigue_runner.corrector.coordinates import (
    Array,
    Turn,
    from_fixed,
    nonlinear_part,
    parts_to_fixed,
    relative,
    relative_to_fixed,
    turn_of,
)
from fatigue_runner.layout import WIND

if TYPE_CHECKING:
    from fatigue_runner.trajectory import Trajectory
    from fatigue_runner.turbine import Turbine

WARM = 3  # steps from true states before the sampled one: its earlier values then lie at predicted states, as in a run


@dataclass
class Steps:
    """n sampled steps: what predictor and corrector saw (n, rows), the plain results (n, states) of both, the exact one, and the rotor's
    turn."""

    ahead_rows: Array
    rows: Array
    ahead: Array
    plain: Array
    exact: Array
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
    learned_ahead: Array | None,
) -> Steps:
    """Steps from random places of true trajectories `runs`, sampled every `step` [s]; learned_ahead (states, rows): part of the predictor;
    damping [1/s]: see `multi_blade.linear`."""
    layout = turbine.layout
    rng = np.random.Generator(np.random.PCG64(seed))
    ahead_base, plain_base = method.matrices(turbine, step, 0.0, past, damping)
    ahead_all = ahead_base if learned_ahead is None else ahead_base + learned_ahead
    picks = [rng.integers(past + WARM, len(run.time) - 1, per_wind) for run in runs]

    def state(back: int) -> Array:
        return np.concatenate([run.state[pick - back] for run, pick in zip(runs, picks, strict=True)])

    def wind(back: int, place: float) -> Array:
        return np.concatenate(
            [
                w.at(run.time[pick - back] + place * step)
                for w, run, pick in zip(winds, runs, picks, strict=True)
            ]
        )

    # nonlinear parts, the newest first; the oldest ones at true states, then at predicted ones
    parts = [nonlinear_part(turbine, state(i), wind(i, 0.0), damping) for i in range(WARM, WARM + past)]
    for back in range(WARM, -1, -1):
        x = state(back)
        pressure = np.stack([wind(back, place) for place in (0.0, 0.5, 1.0)], axis=1)
        turn = turn_of(layout, x)
        seen = rows(turbine, x, pressure, parts, turn)
        change = from_fixed(layout, seen @ ahead_all.T, turn)
        part = nonlinear_part(turbine, x + change, pressure[:, 2], damping)
        parts = [part, *parts]
        if back:
            parts = parts[:past]
    whole = np.concatenate([seen, parts_to_fixed(layout, parts[0], turn)], axis=1)
    ahead = x + from_fixed(layout, seen @ ahead_base.T, turn)
    return Steps(seen, whole, ahead, x + from_fixed(layout, whole @ plain_base.T, turn), state(-1), turn)


def rows(turbine: Turbine, x: Array, wind: Array, parts: list[Array], turn: Turn) -> Array:
    """(n, rows) what a predictor sees: states (n, states), wind (n, 3, signals) at start, middle and end, earlier parts, the newest
    first."""
    layout = turbine.layout
    state = relative_to_fixed(layout, relative(layout, x, turbine.gearbox_ratio), turn)
    blown = wind.copy()
    # the wind that the shears add at the rotor's edge; other signals as they are
    blown[:, :, 1 : len(WIND)] *= wind[:, :, :1]
    earlier = [parts_to_fixed(layout, part, turn) for part in parts]
    return np.concatenate([np.ones((len(x), 1)), state, blown.reshape(len(x), -1), *earlier], axis=1)
