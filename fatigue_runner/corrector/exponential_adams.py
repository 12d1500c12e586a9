"""Training of the learned part of an exponential Adams method: least squares on what its predictor and its corrector leave.

Everything is linear in rows that the step has anyway (`features.multi_blade`), in multi-blade coordinates, where an isotropic
rotor's map does not depend on the azimuth. The predictor is fitted first; then runs that are put back on the true trajectory
before every step, with the fitted predictor, give the rows and defects of the corrector.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.corrector import features, fit, samples
from fatigue_runner.corrector.artefact import Corrector
from fatigue_runner.corrector.guard import limit_of
from fatigue_runner.integrators import exponential_adams as adams

if TYPE_CHECKING:
    from fatigue_runner.corrector.affine_recipe import AffineRecipe
    from fatigue_runner.turbine import Turbine

Array = NDArray[np.float64]

WARM = 3  # steps from true states before the sampled one: its earlier values then lie at predicted states, as in a run


@dataclass
class Steps:
    """n sampled steps: what predictor and corrector saw (n, rows), the plain results (n, 16) of both, the exact one, the azimuth (n,)."""

    ahead_rows: Array
    rows: Array
    ahead: Array
    plain: Array
    exact: Array
    azimuth: Array


def collect(
    turbine: Turbine,
    method: adams.ExponentialAdams,
    step: float,
    past: int,
    winds: list[Any],
    runs: list[Any],
    per_wind: int,
    seed: int,
    damping: float,
    learned_ahead: Array | None,
) -> Steps:
    """Steps from random places of true trajectories `runs`, sampled every `step` [s]; learned_ahead (16, rows): part of the predictor;
    damping [1/s]: see `exponential_adams.linear`."""
    rng = np.random.Generator(np.random.PCG64(seed))
    ahead_base, plain_base = adams.matrices(turbine, method, step, 0.0, past, damping)
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
        turn = _turns(x[:, 6])
        seen = rows(turbine, x, pressure, parts, turn)
        change = from_fixed(seen @ ahead_all.T, turn)
        part = nonlinear_part(turbine, x + change, pressure[:, 2], damping)
        parts = [part, *parts]
        if back:
            parts = parts[:past]
    whole = np.concatenate([seen, parts_to_fixed(parts[0], turn)], axis=1)
    return Steps(
        seen, whole, x + from_fixed(seen @ ahead_base.T, turn), x + from_fixed(whole @ plain_base.T, turn), state(-1), x[:, 6]
    )  # fmt: skip


def nonlinear_part(turbine: Turbine, x: Array, wind: Array, damping: float) -> Array:
    """(n, 8) accelerations at states (n, 16) under wind (n, 3) without their linear part, the twist's in place of the generator's."""
    from fatigue_runner.turbine.lanes import evaluate

    slope = evaluate(turbine.kernel_data(0.0), np.ascontiguousarray(x.T), np.ascontiguousarray(wind.T))[0].T
    ratio = turbine.parameters["g_ratio"]
    out = slope[:, 8:].copy()
    out[:, 7] = slope[:, 14] - slope[:, 15] / ratio
    return np.asarray(out - relative(x, ratio) @ adams.linear(turbine, 0.0, damping).low.T)


def relative(x: Array, ratio: float) -> Array:
    """(n, 15) deflections, shaft twist, rates, rate of the twist of states (n, 16)."""
    twist, rate = x[:, 6] - x[:, 7] / ratio, x[:, 14] - x[:, 15] / ratio
    return np.concatenate([x[:, :6], twist[:, None], x[:, 8:15], rate[:, None]], axis=1)


def _turns(azimuth: Array) -> tuple[Array, Array]:
    return np.cos(azimuth), np.sin(azimuth)


def _turned(values: Array, first: tuple[int, ...], turn: tuple[Array, Array], sign: int) -> Array:
    """Cosine and sine parts of the blades' columns turned by the azimuth (sign 1) or back (-1)."""
    cosine, sine = turn[0], sign * turn[1]
    out = values.copy()
    for i in first:
        out[:, i + 1] = cosine * values[:, i + 1] - sine * values[:, i + 2]
        out[:, i + 2] = sine * values[:, i + 1] + cosine * values[:, i + 2]
    return out


def from_fixed(change: Array, turn: tuple[Array, Array]) -> Array:
    """(n, 16) changes of the state from multi-blade coordinates."""
    return np.asarray(_turned(change, (2, 10), turn, -1) @ np.linalg.inv(adams.T_STATE).T)


def to_fixed(change: Array, turn: tuple[Array, Array]) -> Array:
    """(n, 16) changes of the state in multi-blade coordinates."""
    return _turned(change @ adams.T_STATE.T, (2, 10), turn, 1)


def parts_to_fixed(parts: Array, turn: tuple[Array, Array]) -> Array:
    return _turned(parts @ adams.T_PARTS.T, (2,), turn, 1)


def rows(turbine: Turbine, x: Array, wind: Array, parts: list[Array], turn: tuple[Array, Array]) -> Array:
    """(n, rows) what a predictor sees: states (n, 16), wind (n, 3, 3) at start, middle and end, earlier parts, the newest first."""
    state = _turned(relative(x, turbine.parameters["g_ratio"]) @ adams.T_RELATIVE.T, (2, 9), turn, 1)
    blown = wind.copy()
    blown[:, :, 1:] *= wind[:, :, :1]
    earlier = [parts_to_fixed(part, turn) for part in parts]
    return np.concatenate([np.ones((len(x), 1)), state, blown.reshape(len(x), 9), *earlier], axis=1)


def multiplied(seen: Array, factors: tuple[str, ...]) -> Array:
    """Rows and their products with each factor's row."""
    return np.concatenate(
        [seen, *(seen * seen[:, [i]] for i in features.multi_blade_factors(factors))], axis=1
    )


def train(
    recipe: AffineRecipe, turbine: Turbine, start: Any, say: Callable[[str], None], text: str
) -> Corrector:
    """The guarded corrector of an exponential Adams method; start: initial states of given winds. See `affine.train_affine`."""
    begin = time.perf_counter()
    method = samples.base_method(recipe.method)
    assert isinstance(method, adams.ExponentialAdams)
    past, factors = max(method.past, recipe.history), tuple(recipe.factors)
    winds = recipe.training.build()
    say(f"reference trajectories under {len(winds)} winds")
    runs = samples.references(
        turbine, winds, start(winds), _whole(recipe.training.duration, recipe.step), recipe.step
    )
    sampled = partial(
        collect,
        turbine,
        method,
        recipe.step,
        past,
        winds,
        runs,
        recipe.samples,
        recipe.seed,
        recipe.generator_damping,
    )
    say(f"fitting the predictor to {len(winds) * recipe.samples} steps")
    found = sampled(None)
    learned_ahead = recipe.solve(found.ahead_rows, to_fixed(found.exact - found.ahead, _turns(found.azimuth)))
    say("fitting the corrector")
    found = sampled(learned_ahead)
    seen, defect = multiplied(found.rows, factors), found.exact - found.plain
    learned = recipe.solve(seen, to_fixed(defect, _turns(found.azimuth)))
    size = recipe.step ** (method.order + 1)
    g = recipe.guard
    change = from_fixed(seen @ learned.T, _turns(found.azimuth))
    guard = limit_of(change, found.plain, found.plain, g.norm, g.kappa, g.quantile, g.rtol)
    moved = from_fixed(found.ahead_rows @ learned_ahead.T, _turns(found.azimuth))
    ahead = limit_of(moved, found.ahead, found.ahead, g.norm, g.kappa, g.quantile, g.rtol)
    # in units in which the corrector's limit is the predictor's as well
    ahead_atol = tuple(a * ahead.limit / guard.limit for a in ahead.atol)
    speeds = np.concatenate([run.wind[:, 0] for run in runs])
    made: dict[str, Any] = {"samples": len(seen), "winds": len(winds), "seed": recipe.seed}
    corrector = Corrector(
        name=recipe.name, family=recipe.family, method=recipe.method, step=recipe.step, turbine=turbine.name,
        turbine_hash=turbine.hash, kind=features.MULTI_BLADE, factors=factors, linear=learned / size, layers=(),
        activation="identity", guard=guard, wind_range=(float(speeds.min()), float(speeds.max())), recipe=text,
        history=recipe.history, predictor=learned_ahead / size, damping=recipe.generator_damping,
        ahead_atol=ahead_atol,
    )  # fmt: skip
    made["seconds"] = round(time.perf_counter() - begin, 1)
    return replace(corrector, training=made)


def _whole(duration: float, step: float) -> float:
    """The longest time within `duration` that is whole steps."""
    return float(np.floor(duration / step + 1e-9) * step)


def residual(corrector: Corrector, turbine: Turbine, winds: list[Any], runs: list[Any], seed: int) -> Array:
    """(16,) what the corrector leaves of each state's defect on other winds, relative to it."""
    method = samples.base_method(corrector.method)
    assert isinstance(method, adams.ExponentialAdams)
    ahead, learned, _ = corrector.matrices()
    found = collect(
        turbine, method, corrector.step, corrector.past, winds, runs, 200, seed, corrector.damping, ahead
    )
    seen = multiplied(found.rows, corrector.factors)
    return fit.relative_residual(
        from_fixed(seen @ learned.T, _turns(found.azimuth)), found.exact - found.plain
    )
