"""From an affine recipe (`affine_recipe`) to the guarded artefact: samples, fit, refinement, network, threshold, validation."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from fatigue_runner.corrector import affine_net, exponential_adams, features, fit, rollouts, samples
from fatigue_runner.corrector.affine_recipe import DRIVE, AffineRecipe
from fatigue_runner.corrector.artefact import Corrector, Guard
from fatigue_runner.corrector.guard import from_training_set
from fatigue_runner.errors import InputError
from fatigue_runner.integrators.exponential_adams import ExponentialAdams

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine

Say = Callable[[str], None]
InitialState = Callable[[Any, str, Any], Any]  # `integrators.initial.initial_state`


def starts(turbine: Turbine, winds: list[Any], initial: str, initial_state: InitialState | None) -> Any:
    if initial_state is None:
        if initial != "operating-point":
            raise InputError(f"initial {initial!r} needs the campaign's initial states")
        return samples.operating_points(turbine, winds)
    return np.array([initial_state(turbine, initial, wind) for wind in winds])


def train_affine(
    recipe: AffineRecipe,
    turbine: Turbine,
    initial_state: InitialState | None = None,
    say: Say = lambda what: None,
    text: str = "",
    progress: affine_net.Progress | None = None,
) -> Corrector:
    """The guarded corrector that a recipe makes; say: told of each stage; text: the recipe's file, kept in the artefact; progress: told
    of a network's epochs."""
    begin = time.perf_counter()
    if isinstance(samples.base_method(recipe.method), ExponentialAdams):
        made_here = exponential_adams.train(
            recipe,
            turbine,
            lambda blowing: starts(turbine, blowing, recipe.initial, initial_state),
            say,
            text,
        )
        say("validation")
        return replace(made_here, validation=validate(made_here, recipe, turbine, initial_state))
    winds = recipe.training.build()
    say(f"reference trajectories under {len(winds)} winds")
    common: dict[str, Any] = {"perturbation": recipe.perturbation, "history": recipe.history}
    train = samples.collect(
        turbine, recipe.method, recipe.step, winds, recipe.training.duration, recipe.samples, seed=recipe.seed,
        initial=starts(turbine, winds, recipe.initial, initial_state), **common,
    )  # fmt: skip
    say(f"fitting {len(train.plain)} steps")
    low, high = float(train.rows[:, 16].min()), float(train.rows[:, 16].max())

    def fitted(found: samples.Samples) -> Corrector:
        return _unguarded(recipe, turbine, found, (low, high), text)

    corrector = fitted(train)
    made: dict[str, Any] = {"winds": len(winds), "seed": recipe.seed}
    if recipe.refine is not None:
        ground = rollouts.Ground(
            winds, starts(turbine, winds, recipe.initial, initial_state), recipe.samples, recipe.seed
        )
        long = recipe.refine.duration or recipe.training.duration
        corrector, train, more = rollouts.refine(
            corrector, train, recipe.refine.rounds, fitted, lambda c, number: rollouts.visited(turbine, c, ground, long, number),
            _judge(recipe, turbine, initial_state), say,
        )  # fmt: skip
        made |= more
    if recipe.network is not None:
        say("the network's validation steps")
        unseen = recipe.validation.build()
        judged_by = samples.collect(
            turbine, recipe.method, recipe.step, unseen, recipe.validation.duration, recipe.samples, seed=recipe.seed + 1,
            initial=starts(turbine, unseen, recipe.initial, initial_state), **common,
        )  # fmt: skip
        corrector, more = affine_net.add(corrector, train, judged_by, recipe.network, DRIVE, progress)
        made |= more
    g = recipe.guard
    say("acceptance threshold")
    guard = from_training_set(corrector, turbine, train, g.norm, g.kappa, g.quantile, g.rtol, g.substeps)
    corrector = replace(corrector, guard=guard)
    say("validation")
    judged = validate(corrector, recipe, turbine, initial_state)
    made = {"samples": len(train.plain), **made, "seconds": round(time.perf_counter() - begin, 1)}
    return replace(corrector, validation=judged, training=made)


def _unguarded(
    recipe: AffineRecipe, turbine: Turbine, found: samples.Samples, winds: tuple[float, float], text: str
) -> Corrector:
    """The affine map that fits samples; winds: slowest and fastest [m/s]."""
    size = recipe.step ** (samples.tableau(recipe.method).order + 1)
    weights = recipe.solve(found.features(features.STAGE_AWARE, tuple(recipe.factors)), found.defect) / size
    open_guard = Guard(0.0, recipe.guard.norm, 1.0, 1.0, (1.0,) * 16, (0.0,) * 16, 2)
    return Corrector(
        name=recipe.name, family=recipe.family, method=recipe.method, step=recipe.step, turbine=turbine.name,
        turbine_hash=turbine.hash, kind=features.STAGE_AWARE, factors=tuple(recipe.factors), linear=weights, layers=(),
        activation="identity", guard=open_guard, wind_range=winds, recipe=text, history=recipe.history,
    )  # fmt: skip


def _judge(
    recipe: AffineRecipe, turbine: Turbine, initial_state: InitialState | None
) -> Callable[[Corrector], float]:
    """Median error of enhanced runs under the validation winds."""
    winds = recipe.validation.build()
    start = starts(turbine, winds, recipe.initial, initial_state)
    duration = recipe.validation.duration - 2 * recipe.step
    runs = samples.references(turbine, winds, start, duration, samples.output_step(recipe.step, 1))

    def error(corrector: Corrector) -> float:
        return float(
            np.median(
                rollout_errors(
                    turbine, corrector, "enhanced", winds, start, duration, runs, rollouts.DISCARD
                )[0]
            )
        )

    return error


def validate(
    corrector: Corrector, recipe: AffineRecipe, turbine: Turbine, initial_state: InitialState | None = None
) -> dict[str, float]:
    """Figures on the validation winds: NRMSE (largest over states; median and worst over winds), relative residual per state."""
    from fatigue_runner.channels import STATE_NAMES

    winds = recipe.validation.build()
    start = starts(turbine, winds, recipe.initial, initial_state)
    step = samples.output_step(recipe.step, 1)
    duration = recipe.validation.duration - 2 * recipe.step
    runs = samples.references(turbine, winds, start, duration, step)
    if corrector.past:
        left = exponential_adams.residual(corrector, turbine, winds, runs, recipe.seed + 1)
    else:
        unseen = samples.collect(
            turbine, recipe.method, recipe.step, winds, duration, 200, 0.0, recipe.seed + 1, history=recipe.history, runs=runs
        )  # fmt: skip
        left = fit.relative_residual(corrector.predict(unseen), unseen.defect)
    out = {f"residual_{name}": float(value) for name, value in zip(STATE_NAMES, left, strict=True)}
    for mode in ("plain", "enhanced", "hybrid"):
        errors, accepted = rollout_errors(
            turbine, corrector, None if mode == "plain" else mode, winds, start, duration, runs
        )
        out |= {f"nrmse_{mode}": float(np.median(errors)), f"nrmse_{mode}_worst": float(errors.max())}
        if mode == "hybrid":
            out["acceptance"] = accepted
    # a run that diverged has no error: left out, as JSON knows no infinity
    return {name: value for name, value in out.items() if np.isfinite(value)}


def rollout_errors(
    turbine: Turbine,
    corrector: Corrector,
    mode: str | None,
    winds: Any,
    start: Any,
    duration: float,
    runs: Any,
    discard: float = 0.0,
) -> tuple[Any, float]:
    """(winds,) NRMSE, the largest over states, infinite where a run diverged; and the share of accepted steps. mode None: plain.

    discard [s]: what is left out at the start, at most half of the run.
    """
    from fatigue_runner.integrators import simulate_block

    output = float(runs[0].time[1] - runs[0].time[0])
    out = np.full(len(winds), np.inf)
    accepted = []
    for key in dict.fromkeys(w.cell_key for w in winds):
        chosen = [i for i, w in enumerate(winds) if w.cell_key == key]
        block = simulate_block(
            turbine, corrector.method, corrector.step, [winds[i] for i in chosen], start[chosen], duration, output,
            corrector=corrector if mode else None, mode=mode or "enhanced",
        )  # fmt: skip
        for i, run in zip(chosen, block, strict=True):
            accepted.append(float(run.accepted.mean()) if len(run.accepted) else 1.0)
            if run.diverged_at is None:
                first = int(np.searchsorted(run.time, min(discard, 0.5 * duration) - 1e-9))
                reference, state = runs[i].state[first : len(run.state)], run.state[first:]
                scale = np.ptp(reference, axis=0)
                scale[scale == 0] = 1.0
                out[i] = float((np.sqrt(((state - reference) ** 2).mean(axis=0)) / scale).max())
    return out, float(np.mean(accepted))
