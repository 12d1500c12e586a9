"""Refinement by rollouts: an affine map is fitted again with the states that the corrected method itself visits.

Recipe keys `refine`: `rounds` (default 2), `duration` [s] of each rollout (default: the training winds'). The target stays the exact
step from the visited state; only where the samples lie changes. The round with the least error of whole runs under the
validation winds, their first `DISCARD` seconds apart, is kept; round 0 is the map without refinement.

Measured: it changes little. Short rollouts are mostly the ringing of a start off the wind's own motion: 40 s of them take a factor of
3 to 6 off Tsit5's error at 200 ms in whole runs and add two thirds to it after the first 10 s. Hence the long default.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from pydantic import Field

from fatigue_runner.corrector import samples
from fatigue_runner.inputs.section import Section
from fatigue_runner.integrators import Ensemble, Integrator, simulate

if TYPE_CHECKING:
    from fatigue_runner.corrector.corrector import Corrector
    from fatigue_runner.corrector.samples import Samples
    from fatigue_runner.turbine import Turbine

Fit = TypeVar("Fit")  # what is fitted: a map
DISCARD = 10.0  # s, the start of a run, which says little about the rest


class RefineRecipe(Section):
    """See the module."""

    rounds: int = Field(default=2, ge=1, le=20)
    duration: float | None = Field(default=None, ge=2, le=1e4)


@dataclass(frozen=True)
class Ground:
    """What rollouts run on: winds, their initial states (n, states), samples of each, seed, how many samples lie in a row."""

    winds: list[Any]
    start: Any
    per_wind: int
    seed: int
    length: int = 1


def visited(
    turbine: Turbine, corrector: Corrector, ground: Ground, duration: float, number: int
) -> Samples | None:
    """Samples at the states of the corrected method's own runs; None where every run diverged."""
    step = corrector.step
    # whole steps: between them lie values that the method never stepped from
    output = step if corrector.history or ground.length > 1 else step * max(1, round(samples.GRID / step))
    ensemble = Ensemble(turbine, ground.winds, ground.start, duration, output)
    found = simulate(ensemble, Integrator(corrector.method, step, corrector))
    whole = [(wind, run) for wind, run in zip(ground.winds, found, strict=True) if run.diverged_at is None]
    if not whole:
        return None
    winds, runs = zip(*whole, strict=True)
    return samples.along(
        turbine, corrector.method, step, winds, runs, ground.per_wind, 0.0, ground.seed + 1000 * number, corrector.history,
        ground.length,
    )  # fmt: skip


def union(a: Samples, b: Samples) -> Samples:
    """Both, one after the other."""
    return type(a)(*(np.concatenate([getattr(a, f.name), getattr(b, f.name)]) for f in fields(a)))


def refine(
    first: Fit,
    train: Samples,
    rounds: int,
    refit: Callable[[Samples], Fit],
    visit: Callable[[Fit, int], Samples | None],
    judge: Callable[[Fit], float],
    say: Callable[[str], None] = lambda what: None,
) -> tuple[Fit, Samples, dict[str, Any]]:
    """The best map of all rounds, the samples that it was fitted to, and what to say of it.

    refit: samples to map; visit: map and number of the round to the samples that it meets; judge: error of whole runs under winds
    that were not trained on.
    """
    errors = [judge(first)]
    best, seen, all_seen, current = first, train, train, first
    for number in range(1, rounds + 1):
        say(f"refinement {number} of {rounds}: rollouts (error so far {min(errors):.3g})")
        more = visit(current, number)
        if more is None:
            break
        all_seen = union(all_seen, more)
        current = refit(all_seen)
        errors.append(judge(current))
        if errors[-1] <= min(errors):
            best, seen = current, all_seen
    said = " -> ".join(f"{e:.3g}" for e in errors)
    return best, seen, {"refinement": f"validation NRMSE {said}; kept round {int(np.argmin(errors))}"}
