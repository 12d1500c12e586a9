"""Family `affine` of Runge-Kutta methods: the defect is an affine map of what the step has computed anyway, fitted in closed form.

Keys beside those of `closed_form`:
history       earlier steps whose first slopes the map sees (default 0)
perturbation  half of the samples lie off the trajectories, by this share of each state's deviation (default 1e-5)
refine        fit again on the states that rollouts visit, see `rollouts`; default not
guard         norm (`max`, `rms`), kappa (2), quantile (0.999; 1: the largest), rtol (0), substeps (fallback; default as needed)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import Field

from fatigue_runner.corrector import features, rollouts, samples, threshold
from fatigue_runner.corrector.corrector import Corrector
from fatigue_runner.corrector.families.closed_form import ClosedForm
from fatigue_runner.corrector.guard import open_guard
from fatigue_runner.corrector.judging import Judge, median_error
from fatigue_runner.corrector.maps import StageMap
from fatigue_runner.corrector.recipe import GuardRecipe, Learned, Progress
from fatigue_runner.corrector.trajectory_loss import Windows, modes
from fatigue_runner.integrators.linear_part import linearisation_point

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine


class SubstepGuard(GuardRecipe):
    """Acceptance test with the fallback's substeps."""

    substeps: int | None = Field(default=None, ge=0, le=64)


@dataclass(frozen=True)
class Fitted:
    """A map without a guard, the samples that it was fitted to, the winds seen [m/s], and what is to be said of it."""

    map: StageMap
    samples: samples.Samples
    wind_range: tuple[float, float]
    facts: dict[str, Any]


class AffineRecipe(ClosedForm):
    """See the module."""

    methods = StageMap.methods

    family: Literal["affine"]
    history: int = Field(default=0, ge=0, le=features.MOST_HISTORY)
    perturbation: float = Field(default=1e-5, ge=0, le=1)
    guard: SubstepGuard = SubstepGuard()
    refine: rollouts.RefineRecipe | None = None

    def train(self, turbine: Turbine, progress: Progress) -> Learned:
        return self.guarded(turbine, self.fitted(turbine, progress), progress)

    def sampled(
        self, turbine: Turbine, winds: list[Any], duration: float, seed: int, length: int = 1
    ) -> samples.Samples:
        """Samples under these winds, `length` of them in a row."""
        grid = samples.output_step(self.step, self.history, length)
        runs = samples.references(turbine, winds, self.starts(turbine, winds), duration, grid)
        return samples.along(
            turbine, self.method, self.step, winds, runs, self.samples, self.perturbation, seed, self.history, length
        )  # fmt: skip

    def fitted(self, turbine: Turbine, progress: Progress) -> Fitted:
        """The map, refined where the recipe asks for that."""
        winds = self.training.build()
        progress.say(f"reference trajectories under {len(winds)} winds")
        length = self.length(turbine)
        found = self.sampled(turbine, winds, self.training.duration, self.seed, length)
        speeds = found.raw[:, -1]
        wind_range = float(speeds.min()), float(speeds.max())
        progress.say(f"fitting {len(found.plain)} steps")
        size, windows = self.bound_to(turbine).size, None
        if length > 1:
            point = linearisation_point(turbine, float(np.median(self.training.speed_list)))
            windows = Windows(modes(turbine, self.step, False, point=point), length)

        def fit(seen: samples.Samples) -> StageMap:
            factors = tuple(self.factors)
            rows = seen.multiplied(features.factor_rows(turbine.layout, factors))
            weights = self.solve(turbine.layout, rows, seen.defect, windows)
            return StageMap(weights / size, factors=factors, history=self.history, layout=turbine.layout)

        learned = fit(found)
        facts: dict[str, Any] = {"winds": len(winds), "seed": self.seed, **self.said_of_loss(length)}
        if self.refine is not None:
            ground = rollouts.Ground(winds, self.starts(turbine, winds), self.samples, self.seed, length)
            long = self.refine.duration or self.training.duration
            learned, found, more = rollouts.refine(
                learned, found, self.refine.rounds, fit,
                lambda tried, number: rollouts.visited(turbine, self._open(turbine, tried), ground, long, number),
                self._judge(turbine), progress.say,
            )  # fmt: skip
            facts |= more
        return Fitted(learned, found, wind_range, {"samples": len(found.plain), **facts})

    def guarded(self, turbine: Turbine, made: Fitted, progress: Progress) -> Learned:
        """The map with the threshold that its samples give; steps in a row are too few different ones, and others are drawn."""
        progress.say("acceptance threshold")
        seen = made.samples
        if self.length(turbine) > 1:
            seen = self.sampled(turbine, self.training.build(), self.training.duration, self.seed)
        guard = threshold.from_training_set(
            made.map, self.bound_to(turbine), turbine, seen, **self.guard.threshold, substeps=self.guard.substeps
        )  # fmt: skip
        return Learned(made.map, guard, made.wind_range, made.facts)

    def _open(self, turbine: Turbine, learned: StageMap) -> Corrector:
        """A corrector for enhanced runs: its threshold is still to be found."""
        return Corrector(
            self.name,
            self.family,
            self.bound_to(turbine),
            learned,
            open_guard(turbine.layout.size, self.guard.norm),
        )

    def _judge(self, turbine: Turbine) -> Callable[[StageMap], float]:
        """Median error of a map's enhanced runs under the validation winds."""
        judge = Judge.of(self, turbine)
        return lambda learned: median_error(judge, self._open(turbine, learned), rollouts.DISCARD)
