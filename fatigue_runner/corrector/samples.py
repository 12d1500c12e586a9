"""Training data: defects of one step of a method, against one accurate local step, along trajectories and off them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.corrector import features
from fatigue_runner.errors import InputError
from fatigue_runner.integrators import method as find_method
from fatigue_runner.integrators import simulate_block

if TYPE_CHECKING:
    from fatigue_runner.trajectory import Trajectory
    from fatigue_runner.turbine import Turbine

Array = NDArray[np.float64]

ACCURATE = "dop853"  # the method of the exact step
SUBSTEPS = 8  # of it in one step: its local error is below 1e-9 of the defects for the steps of this project
MOST_PIECES = 64  # of the wind in a step
GRID = 0.1  # s, times at which steps are sampled where a corrector does not look back


@dataclass
class Samples:
    """n single steps: rows (n, features) stage-aware, raw (n, 18), plain and exact results (n, 16), wind pieces (n, m, 4, 3)."""

    rows: Array
    raw: Array
    plain: Array
    exact: Array
    pieces: Array | None = None

    @property
    def defect(self) -> Array:
        """Exact minus plain (n, 16): what a corrector is to give."""
        return self.exact - self.plain

    @property
    def state(self) -> Array:
        """(n, 16) at the step's start."""
        return self.raw[:, 1:17]

    def features(self, kind: str, factors: tuple[str, ...] = ()) -> Array:
        """(n, k) in the order of `features.names`."""
        base = self.raw if kind == features.RAW else self.rows
        more = [base * self.rows[:, row : row + 1] for row in features.factor_rows(factors)]
        return np.concatenate([base, *more], axis=1) if more else base


def wind_pieces(wind: Any, times: Array, step: float, count: int = 1) -> Array:
    """(n, count, 4, 3) cubic coefficients in time of `count` equal pieces of the steps that begin at `times` (n,) [s].

    Exact where the wind is cubic over each piece; see `pieces_of`.
    """
    u, length = np.array([0.0, 1 / 3, 2 / 3, 1.0]), step / count
    powers = np.linalg.inv(np.vander(u, 4, increasing=True)) / length ** np.arange(4)[:, None]
    out = np.empty((len(times), count, 4, 3))
    for i in range(count):
        values = np.stack([wind.at(times + (i + x) * length) for x in u])
        out[:, i] = np.einsum("pk,kns->nps", powers, values)
    return out


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
    pitch: float = 0.0,
    accurate: str = ACCURATE,
    substeps: int = SUBSTEPS,
) -> Samples:
    """One step of `method`, and one in `substeps` of `accurate`, from each of states (n, 16) under wind pieces (n, m, 4, 3)."""
    from fatigue_runner.integrators.correction import FIXED_ROWS, RAW_ROWS
    from fatigue_runner.integrators.defects import step_samples
    from fatigue_runner.integrators.kernel_data import runge_kutta_data, stage_rows
    from fatigue_runner.turbine.lanes import LANES, from_groups, to_groups, work_space

    n = len(states)
    x = to_groups(np.ascontiguousarray(states.T))
    count = pieces.shape[1]
    cells = to_groups(np.ascontiguousarray(pieces.reshape(n, -1).T)).reshape(len(x), count, 4, -1)
    own, finer = runge_kutta_data(tableau(method)), runge_kutta_data(tableau(accurate))
    stages = len(own[0][3])
    width = FIXED_ROWS + 8 * stages
    rows, raw = np.empty((len(x), width * LANES)), np.empty((len(x), RAW_ROWS * LANES))
    plain, exact = np.empty_like(x), np.empty_like(x)
    data = turbine.kernel_data(pitch)
    scratch, row, clamped = work_space()
    step_samples(
        x, cells, step / count, own[:2], stage_rows(stages), step, finer[:2], substeps, turbine.parameters["g_ratio"],
        (data.tables, data.cells, data.constants, scratch, row), clamped, rows, raw, plain, exact,
    )  # fmt: skip
    return Samples(
        from_groups(rows, width, n).T.copy(),
        from_groups(raw, RAW_ROWS, n).T.copy(),
        from_groups(plain, 16, n).T.copy(),
        from_groups(exact, 16, n).T.copy(),
        pieces,
    )


def base_method(method: str) -> Any:
    """The Runge-Kutta or exponential Adams method of this name. Raises InputError for one that no corrector is made for."""
    from fatigue_runner.integrators.exponential_adams import ExponentialAdams

    found = find_method(method)
    return found if isinstance(found, ExponentialAdams) else tableau(method)


def tableau(method: str) -> Any:
    """The Runge-Kutta method of this name. Raises InputError for a method that is none: it has no stages to see."""
    from fatigue_runner.integrators.tableaux import ButcherTableau

    found = find_method(method)
    if not isinstance(found, ButcherTableau):
        raise InputError(
            f"correctors exist for Runge-Kutta and exponential Adams methods; {method} is none: use heun, rk3, rk4, tsit5 or etdabm3"
        )
    return found


def references(
    turbine: Turbine, winds: Sequence[Any], initial: Array, duration: float, output: float, pitch: float = 0.0
) -> list[Trajectory]:
    """Accurate trajectories from initial (n, 16), sampled every `output` [s], in the order of the winds.

    Raises InputError where one diverges: its defects would teach nothing.
    """
    from fatigue_runner.integrators import stability_limit

    fine = min(0.05, stability_limit(turbine, ACCURATE) / 4)
    runs: list[Any] = [None] * len(winds)
    # winds with different time grids cannot share a block
    for key in dict.fromkeys(w.cell_key for w in winds):
        chosen = [i for i, w in enumerate(winds) if w.cell_key == key]
        block = simulate_block(
            turbine,
            ACCURATE,
            output / np.ceil(output / fine - 1e-9),
            [winds[i] for i in chosen],
            initial[chosen],
            duration,
            output,
            pitch,
        )
        for i, run in zip(chosen, block, strict=True):
            if run.diverged_at is not None:
                raise InputError(
                    f"training wind {winds[i].name}: the reference diverged at {run.diverged_at:g} s; leave this wind out of the recipe"
                )
            runs[i] = run
    return runs


def collect(
    turbine: Turbine,
    method: str,
    step: float,
    winds: Sequence[Any],
    duration: float,
    per_wind: int,
    perturbation: float,
    seed: int,
    initial: Array | None = None,
    pitch: float = 0.0,
    history: int = 0,
    runs: Sequence[Trajectory] | None = None,
) -> Samples:
    """Samples along accurate trajectories under `winds`, half of them moved off it.

    per_wind samples of each wind at random times; perturbation: standard deviation of the move in units of each state's own (large
    ones teach another mixture than a corrected run meets: 1e-5 to 1e-4 did best). history: steps looked back. runs: `references` of
    the winds at `output_step(step, history)`, made here where none are given. Raises InputError where one diverges.
    """
    rng = np.random.Generator(np.random.PCG64(seed))
    if runs is None:
        if initial is None:
            initial = operating_points(turbine, winds, pitch)
        runs = references(turbine, winds, initial, duration, output_step(step, history), pitch)
    scale = np.std(np.concatenate([run.state for run in runs]), axis=0)
    ratio = turbine.parameters["g_ratio"]
    states, pieces, behind = [], [], []
    count = pieces_of(winds, step, output_step(step, history))
    for wind, run in zip(winds, runs, strict=True):
        last = int(np.searchsorted(run.time, run.time[-1] - step - 1e-9))
        if last <= history:
            raise InputError(
                f"training wind {wind.name}: {run.time[-1]:g} s hold no step of {step:g} s; make it longer"
            )
        pick = rng.integers(history, last, per_wind)
        x = run.state[pick].copy()
        moved = slice(0, None, 2)
        x[moved] += _move(rng, x[moved].shape, scale, perturbation, ratio)
        states.append(x)
        pieces.append(wind_pieces(wind, run.time[pick], step, count))
        if history:
            slopes = step * accelerations(turbine, run, pitch)
            looked = np.concatenate([slopes[pick - i] for i in range(1, history + 1)], axis=1)
            looked[moved] += (
                rng.standard_normal(looked[moved].shape) * np.tile(slopes.std(axis=0), history) * perturbation
            )
            behind.append(looked)
    found = single_steps(turbine, method, step, np.concatenate(states), np.concatenate(pieces), pitch)
    if history:
        found.rows = np.concatenate([found.rows, np.concatenate(behind)], axis=1)
    return found


def output_step(step: float, history: int) -> float:
    """Sampling [s] of the `references` that `collect` needs: a corrector that looks back needs its own steps."""
    return step if history else GRID


def operating_points(turbine: Turbine, winds: Sequence[Any], pitch: float = 0.0) -> Array:
    """(n, 16) start of each wind: the operating point of its mean speed."""
    return np.array([turbine.operating_point(w.mean_speed, pitch=pitch) for w in winds])


def accelerations(turbine: Turbine, run: Trajectory, pitch: float = 0.0) -> Array:
    """(n, 8) time derivatives of a trajectory's rates, of the shaft's twist in place of the generator's."""
    from fatigue_runner.turbine.lanes import evaluate

    data = turbine.kernel_data(pitch)
    slopes = evaluate(data, np.ascontiguousarray(run.state.T), np.ascontiguousarray(run.wind.T))[0][
        8:
    ].T.copy()
    slopes[:, 7] = slopes[:, 6] - slopes[:, 7] / turbine.parameters["g_ratio"]
    return slopes


def _move(rng: np.random.Generator, shape: tuple[int, ...], scale: Array, size: float, ratio: float) -> Array:
    """A perturbation that keeps the azimuth, and the generator's angle and speed near the rotor's."""
    move = rng.standard_normal(shape) * scale * size
    move[:, 6] = 0.0
    move[:, 7] = ratio * 1e-3 * size * rng.standard_normal(shape[0])
    move[:, 15] = ratio * (move[:, 14] + 1e-2 * size * rng.standard_normal(shape[0]))
    return move
