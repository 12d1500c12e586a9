"""Family `affine` of exponential Adams methods: learned parts of predictor and corrector, affine in multi-blade coordinates.

Keys beside those of `closed_form`:
history            earlier nonlinear parts that the map sees, where that is more than the method's own (default 0)
generator_damping  added to the linear part's [1/s] (default 0)
guard              norm (`max`, `rms`), kappa (2), quantile (0.999; 1: the largest), rtol (0); the fallback is the method as it is

The predictor is fitted first; then runs that are put back on the true trajectory before every step, with the fitted predictor, give the
rows and defects of the corrector. The samples lie on the trajectories.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import Field, field_validator

from fatigue_runner.corrector import features, samples, steps
from fatigue_runner.corrector.coordinates import from_fixed, to_fixed
from fatigue_runner.corrector.families.closed_form import ClosedForm
from fatigue_runner.corrector.guard import Guard
from fatigue_runner.corrector.maps import MultiBladeMap
from fatigue_runner.corrector.maps.multi_blade import MOST_DAMPING, past_of
from fatigue_runner.corrector.recipe import Array, GuardRecipe, Learned, Progress
from fatigue_runner.corrector.threshold import limit_of
from fatigue_runner.errors import InputError
from fatigue_runner.inputs.section import problem

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine


class MultiBladeRecipe(ClosedForm):
    """See the module."""

    methods = MultiBladeMap.methods

    family: Literal["affine"]
    history: int = Field(default=0, ge=0, le=features.MOST_HISTORY)
    generator_damping: float = Field(default=0.0, ge=0, lt=MOST_DAMPING)
    guard: GuardRecipe = GuardRecipe()

    @field_validator("factors")
    @classmethod
    def _factors_of_the_kind(cls, value: list[str]) -> list[str]:
        try:
            features.check_multi_blade_factors(tuple(value))
        except InputError as error:
            raise problem(str(error)) from None
        return value

    def train(self, turbine: Turbine, progress: Progress) -> Learned:
        binding, layout = self.bound_to(turbine), turbine.layout
        method, factors, damping = binding.found, tuple(self.factors), self.generator_damping
        winds = self.training.build()
        progress.say(f"reference trajectories under {len(winds)} winds")
        # whole steps: a sampled one begins at a step's end
        duration = float(np.floor(self.training.duration / self.step + 1e-9) * self.step)
        runs = samples.references(turbine, winds, self.starts(turbine, winds), duration, self.step)
        sampled = partial(
            steps.collect, turbine, method, self.step, past_of(method, self.history), winds, runs, self.samples, self.seed, damping
        )  # fmt: skip
        progress.say(f"fitting the predictor to {len(winds) * self.samples} steps")
        found = sampled(None)
        ahead = self.solve(layout, found.ahead_rows, to_fixed(layout, found.ahead_defect, found.turn))
        progress.say("fitting the corrector")
        found = sampled(ahead)
        seen = found.multiplied(features.multi_blade_factor_rows(layout, factors))
        learned = self.solve(layout, seen, to_fixed(layout, found.defect, found.turn))
        guard = self._guard(
            found,
            from_fixed(layout, found.ahead_rows @ ahead.T, found.turn),
            from_fixed(layout, seen @ learned.T, found.turn),
        )
        speeds = np.concatenate([run.wind[:, 0] for run in runs])
        facts: dict[str, Any] = {"samples": len(seen), "winds": len(winds), "seed": self.seed}
        matrices = MultiBladeMap(
            ahead / binding.size, learned / binding.size, factors, self.history, damping, layout
        )
        return Learned(matrices, guard, (float(speeds.min()), float(speeds.max())), facts)

    def _guard(self, found: steps.Steps, moved: Array, change: Array) -> Guard:
        """Of what the learned parts add to the predictor's and to the corrector's results (n, states)."""
        guard = limit_of(change, found.plain, found.plain, **self.guard.threshold)
        ahead = limit_of(moved, found.ahead, found.ahead, **self.guard.threshold)
        # in units in which the corrector's limit is the predictor's as well
        return replace(guard, ahead_atol=tuple(a * ahead.limit / guard.limit for a in ahead.atol))
