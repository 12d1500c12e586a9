"""Training data of a Runge-Kutta method: defects of one step against an accurate one, along trajectories and off them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.corrector import features
from fatigue_runner.corrector.coordinates import blown, kernel, slopes
from fatigue_runner.errors import InputError
from fatigue_runner.integrators import Ensemble, Integrator, simulate
from fatigue_runner.integrators import method as find_method

if TYPE_CHECKING:
    from fatigue_runner.trajectory import Trajectory
    from fatigue_runner.turbine import Turbine

Array = NDArray[np.float64]

ACCURATE = "dop853"  # the method of the exact step
SUBSTEPS = 8  # of it in one step: its local error is below 1e-9 of the defects for the steps of this project
MOST_PIECES = 64  # of the wind in a step
LARGEST_ACCURATE = 0.05  # s, of its own steps
GRID = 0.1  # s, times at which steps are sampled where a corrector does not look back


@dataclass
class Samples:
    """n single steps: rows (n, features) stage-aware, raw (n, 1 + states + 1), plain and exact results (n, states), wind pieces
    (n, m, 4, signals)."""

    rows: Array
    raw: Array
    plain: Array
    exact: Array
    pieces: Array | None = None

    @property
    def defect(self) -> Array:
        """Exact minus plain (n, states): what a corrector is to give."""
        return self.exact - self.plain

    @property
    def state(self) -> Array:
        """(n, states) at the step's start."""
        return self.raw[:, 1 : 1 + self.plain.shape[1]]

    def multiplied(self, factors: tuple[int, ...]) -> Array:
        """(n, k) stage-aware rows, and all of them times each of the rows `factors`."""
        more = [self.rows * self.rows[:, row : row + 1] for row in factors]
        return np.concatenate([self.rows, *more], axis=1) if more else self.rows


def wind_pieces(turbine: Turbine, wind: Any, times: Array, step: float, count: int = 1) -> Array:
    """(n, count, 4, rows) cubic coefficients in time of `count` equal pieces of the steps that begin at `times` (n,) [s].

    Exact where the wind is cubic over each piece; see `pieces_of`.
    """
    u, length = np.array([0.0, 1 / 3, 2 / 3, 1.0]), step / count
    powers = np.linalg.inv(np.vander(u, 4, increasing=True)) / length ** np.arange(4)[:, None]
    values = (np.stack([blown(turbine, wind, times + (i + x) * length) for x in u]) for i in range(count))
    return np.stack([np.einsum("pk,kns->nps", powers, v) for v in values], axis=1)


def pieces_of(winds: Sequence[Any], step: float, grid: float) -> int:
    """In how many pieces a step from a multiple of `grid` [s] must be cut so that no wind's knot lies inside one; 1 if in too many."""
    units = [
        round(1e6 * value) for value in (step, grid, *(w.cell_key for w in winds if w.cell_key is not None))
    ]
    if len(units) == 2:
        return 1
    count = units[0] // math.gcd(*units)
    return count if count <= MOST_PIECES else 1


def single_steps(
    turbine: Turbine,
    method: str,
    step: float,
    states: Array,
    pieces: Array,
    accurate: str = ACCURATE,
    substeps: int = SUBSTEPS,
) -> Samples:
    """One step of the Runge-Kutta method `method`, and one in `substeps` of `accurate`, from each of states (n, states) under wind pieces
    (n, m, 4, signals)."""
    from fatigue_runner.integrators.runge_kutta import runge_kutta_arrays, stage_rows
    from fatigue_runner.integrators.single_steps import step_samples
    from fatigue_runner.turbine.lane_code import LANES
    from fatigue_runner.turbine.lanes import counters, from_groups, to_groups

    n = len(states)
    x = to_groups(np.ascontiguousarray(states.T))
    count = pieces.shape[1]
    cells = to_groups(np.ascontiguousarray(pieces.reshape(n, -1).T)).reshape(len(x), count, 4, -1)
    tableaux: Any = find_method(method), find_method(accurate)
    own, finer = (runge_kutta_arrays(tableau) for tableau in tableaux)
    stages = len(own.stages.c)
    layout = turbine.layout
    width, seen = len(features.stage_aware(layout, stages)), len(features.raw(layout))
    rows, raw = np.empty((len(x), width * LANES)), np.empty((len(x), seen * LANES))
    plain, exact = np.empty_like(x), np.empty_like(x)
    data = kernel(turbine, pieces.shape[3])
    step_samples(
        data.model, x, cells, step / count, own, stage_rows(stages), step, finer, substeps, turbine.gearbox_ratio,
        data.arrays(counters()), rows, raw, plain, exact,
    )  # fmt: skip
    return Samples(
        from_groups(rows, width, n).T.copy(),
        from_groups(raw, seen, n).T.copy(),
        from_groups(plain, layout.size, n).T.copy(),
        from_groups(exact, layout.size, n).T.copy(),
        pieces,
    )


def references(
    turbine: Turbine, winds: Sequence[Any], initial: Array, duration: float, output: float
) -> list[Trajectory]:
    """Accurate trajectories from initial (n, states), sampled every `output` [s], in the order of the winds.

    Raises InputError where one diverges: its defects would teach nothing.
    """
    from fatigue_runner.integrators import stability_limit

    fine = min(LARGEST_ACCURATE, stability_limit(turbine, ACCURATE) / 4)
    step = output / np.ceil(output / fine - 1e-9)
    return accurate_runs(turbine, winds, initial, duration, step, output)


def accurate_runs(
    turbine: Turbine, winds: Sequence[Any], initial: Array, duration: float, step: float, output: float
) -> list[Trajectory]:
    """As `references`, with the accurate method's step [s]."""
    runs = simulate(
        Ensemble(turbine, winds, initial, duration, float(output)), Integrator(ACCURATE, float(step))
    )
    for wind, run in zip(winds, runs, strict=True):
        if run.diverged_at is not None:
            raise InputError(
                f"training wind {wind.name}: the reference diverged at {run.diverged_at:g} s; leave this wind out of the recipe"
            )
    return runs


def along(
    turbine: Turbine,
    method: str,
    step: float,
    winds: Sequence[Any],
    runs: Sequence[Trajectory],
    per_wind: int,
    perturbation: float,
    seed: int,
    history: int = 0,
    length: int = 1,
) -> Samples:
    """Samples along `runs`, trajectories of the winds at `output_step(step, history, length)`, half of them moved off it.

    per_wind samples of each wind at random times, `length` of them in a row; perturbation: standard deviation of the move in units of
    each state's own (large ones teach another mixture than a corrected run meets: 1e-5 to 1e-4 did best). history: steps looked back.
    """
    rng = np.random.Generator(np.random.PCG64(seed))
    scale = np.std(np.concatenate([run.state for run in runs]), axis=0)
    states, pieces, behind = [], [], []
    count = pieces_of(winds, step, output_step(step, history, length))
    for wind, run in zip(winds, runs, strict=True):
        last = int(np.searchsorted(run.time, run.time[-1] - step - 1e-9))
        if last <= history:
            raise InputError(
                f"training wind {wind.name}: {run.time[-1]:g} s hold no step of {step:g} s; make it longer"
            )
        pick = places(rng, history, last, per_wind, length, wind, step)
        x = run.state[pick].copy()
        moved = slice(0, None, 2)
        x[moved] += moves(rng, x[moved].shape, scale, perturbation, turbine)
        states.append(x)
        pieces.append(wind_pieces(turbine, wind, run.time[pick], step, count))
        if history:
            found = step * slopes(turbine, run.state, blown(turbine, wind, run.time))
            looked = np.concatenate([found[pick - i] for i in range(1, history + 1)], axis=1)
            looked[moved] += (
                rng.standard_normal(looked[moved].shape) * np.tile(found.std(axis=0), history) * perturbation
            )
            behind.append(looked)
    out = single_steps(turbine, method, step, np.concatenate(states), np.concatenate(pieces))
    if history:
        out.rows = np.concatenate([out.rows, np.concatenate(behind)], axis=1)
    return out


def places(
    rng: np.random.Generator, low: int, high: int, count: int, length: int, wind: Any, step: float
) -> NDArray[np.int64]:
    """(count,) random places from low to below high, `length` in a row each: so many windows as the count holds, at least one.

    Raises InputError where not even one finds room under the wind.
    """
    if high - low < length:
        raise InputError(
            f"training wind {wind.name}: too short for {length} steps of {step:g} s in a row; make its duration longer, or give a "
            "shorter horizon"
        )
    starts = rng.integers(low, high - length + 1, max(1, count // length))
    return np.asarray((starts[:, None] + np.arange(length)).ravel())


def output_step(step: float, history: int, length: int = 1) -> float:
    """Sampling [s] of the trajectories that `along` needs: a corrector that looks back, and steps in a row, need its own steps."""
    return step if history or length > 1 else GRID


def moves(
    rng: np.random.Generator, shape: tuple[int, ...], scale: Array, size: float, turbine: Turbine
) -> Array:
    """Perturbations of states that keep the azimuth, and the generator's angle and speed near the rotor's."""
    layout, ratio = turbine.layout, turbine.gearbox_ratio
    move = rng.standard_normal(shape) * scale * size
    move[:, layout.rotor] = 0.0
    move[:, layout.generator] = ratio * 1e-3 * size * rng.standard_normal(shape[0])
    slip = 1e-2 * size * rng.standard_normal(shape[0])
    move[:, layout.generator_speed] = ratio * (move[:, layout.rotor_speed] + slip)
    return move
