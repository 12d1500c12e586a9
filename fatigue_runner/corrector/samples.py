"""Training data: defects of one step of a method, against one accurate local step, along trajectories and off them."""

from __future__ import annotations

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
    from fatigue_runner.turbine import Turbine

Array = NDArray[np.float64]

ACCURATE = "dop853"  # the method of the exact step
SUBSTEPS = 8  # of it in one step: its local error is below 1e-9 of the defects for the steps of this project


@dataclass
class Samples:
    """n single steps: rows (n, features) stage-aware, raw (n, 18), plain and exact results (n, 16)."""

    rows: Array
    raw: Array
    plain: Array
    exact: Array

    @property
    def defect(self) -> Array:
        """Exact minus plain (n, 16): what a corrector is to give."""
        return self.exact - self.plain

    def features(self, kind: str, factors: tuple[str, ...] = ()) -> Array:
        """(n, k) in the order of `features.names`."""
        base = self.raw if kind == features.RAW else self.rows
        more = [base * self.rows[:, row : row + 1] for row in features.factor_rows(factors)]
        return np.concatenate([base, *more], axis=1) if more else base


def wind_pieces(wind: Any, times: Array, step: float) -> Array:
    """(n, 4, 3) cubic coefficients in time since each of `times` (n,) [s], exact where the wind is cubic over the step."""
    u = np.array([0.0, 1 / 3, 2 / 3, 1.0])
    values = np.stack([wind.at(times + x * step) for x in u])
    powers = np.linalg.inv(np.vander(u, 4, increasing=True)) / step ** np.arange(4)[:, None]
    return np.einsum("pk,kns->nps", powers, values)


def single_steps(
    turbine: Turbine, method: str, step: float, states: Array, pieces: Array, pitch: float = 0.0
) -> Samples:
    """One step of `method` and one accurate step from each of states (n, 16) under wind pieces (n, 4, 3)."""
    from fatigue_runner.integrators.correction import FIXED_ROWS, RAW_ROWS
    from fatigue_runner.integrators.defects import step_samples
    from fatigue_runner.integrators.kernel_data import runge_kutta_data
    from fatigue_runner.turbine.lanes import from_groups, to_groups, work_space

    n = len(states)
    x = to_groups(np.ascontiguousarray(states.T))
    cells = to_groups(np.ascontiguousarray(pieces.reshape(n, -1).T)).reshape(len(x), 4, -1)
    own, accurate = runge_kutta_data(tableau(method)), runge_kutta_data(tableau(ACCURATE))
    stages = len(own[0][3])
    count = FIXED_ROWS + 8 * stages
    width = x.shape[1]
    rows, raw = np.empty((len(x), count * width // 16)), np.empty((len(x), RAW_ROWS * width // 16))
    plain, exact = np.empty_like(x), np.empty_like(x)
    data = turbine.kernel_data(pitch)
    scratch, row, clamped = work_space()
    step_samples(
        x, cells, own[:2], stage_rows(stages), step, accurate[:2], SUBSTEPS, turbine.parameters["g_ratio"],
        (data.tables, data.cells, data.constants, scratch, row), clamped, rows, raw, plain, exact,
    )  # fmt: skip
    return Samples(
        from_groups(rows, count, n).T.copy(),
        from_groups(raw, RAW_ROWS, n).T.copy(),
        from_groups(plain, 16, n).T.copy(),
        from_groups(exact, 16, n).T.copy(),
    )


def stage_rows(stages: int) -> NDArray[np.int64]:
    """Rows of the loops' slopes that hold the stages: the first one's changes from step to step."""
    from fatigue_runner.integrators.loops import RING

    return np.array([0, *(RING - 1 + i for i in range(1, stages))], dtype=np.int64)


def tableau(method: str) -> Any:
    """The Runge-Kutta method of this name. Raises InputError for a method that is none: it has no stages to see."""
    from fatigue_runner.integrators.tableaux import ButcherTableau

    found = find_method(method)
    if not isinstance(found, ButcherTableau):
        raise InputError(f"correctors exist for Runge-Kutta methods only; {method} is none: use heun, rk3, rk4 or tsit5")
    return found


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
) -> Samples:
    """Samples along accurate trajectories under `winds`, half of them moved off it.

    per_wind samples of each wind at random times; perturbation: standard deviation of the move in units of each state's own.
    Raises InputError where an accurate trajectory diverges: its defects would teach nothing.
    """
    from fatigue_runner.integrators import stability_limit

    rng = np.random.Generator(np.random.PCG64(seed))
    if initial is None:
        initial = np.array([turbine.operating_point(float(w.at(np.zeros(1))[0, 0]), pitch=pitch) for w in winds])
    output = 0.1
    fine = min(0.05, stability_limit(turbine, ACCURATE) / 4)
    runs = []
    # winds with different time grids cannot share a block
    for key in dict.fromkeys(w.cell_key for w in winds):
        chosen = [i for i, w in enumerate(winds) if w.cell_key == key]
        block = simulate_block(
            turbine, ACCURATE, output / round(output / fine), [winds[i] for i in chosen], initial[chosen], duration, output, pitch
        )
        runs += list(zip(chosen, block, strict=True))
    for i, run in runs:
        if run.diverged_at is not None:
            raise InputError(
                f"training wind {winds[i].label}: the reference diverged at {run.diverged_at:g} s; leave this wind out of the recipe"
            )
    scale = np.std(np.concatenate([run.state for _, run in runs]), axis=0)
    ratio = turbine.parameters["g_ratio"]
    states, pieces = [], []
    for i, run in runs:
        last = int(np.searchsorted(run.time, run.time[-1] - step - 1e-9))
        pick = rng.integers(0, max(last, 1), per_wind)
        x = run.state[pick].copy()
        moved = slice(0, None, 2)
        x[moved] += _move(rng, x[moved].shape, scale, perturbation, ratio)
        states.append(x)
        pieces.append(wind_pieces(winds[i], run.time[pick], step))
    return single_steps(turbine, method, step, np.concatenate(states), np.concatenate(pieces), pitch)


def _move(rng: np.random.Generator, shape: tuple[int, ...], scale: Array, size: float, ratio: float) -> Array:
    """A perturbation that keeps the azimuth, and the generator's angle and speed near the rotor's."""
    move = rng.standard_normal(shape) * scale * size
    move[:, 6] = 0.0
    move[:, 7] = ratio * 1e-3 * size * rng.standard_normal(shape[0])
    move[:, 15] = ratio * (move[:, 14] + 1e-2 * size * rng.standard_normal(shape[0]))
    return move
