"""Family `affine` of exponential Adams methods: learned parts of predictor and corrector, affine in multi-blade coordinates.

Keys beside those of `closed_form`:
history            earlier nonlinear parts that the map sees, where that is more than the method's own (default 0)
wind_bins          mean winds [m/s], a list or `{start, stop, count}`: a map for each, and a case takes the nearest one's; default one
                   map for all
generator_damping  added to the linear part's [1/s] (default 0)
commands           of a turbine under control: the map sees what its controller commands within the step as well (default false)
guard              norm (`max`, `rms`), kappa (2), quantile (0.999; 1: the largest), rtol (0); compared with the method as it is
                   and with what was predicted; what is refused is made anew in substeps of RK4
ladder             maps for smaller steps as well, which make what is refused before RK4 does: `halvings` (1: half the step; 2: a quarter,
                   too), `kappa` of the guards above the smallest step (1: strict, since what they refuse costs little), whose own
                   is that of `guard`; default none

The predictor is fitted first; then runs that are put back on the true trajectory before every step, with the fitted predictor, give the
rows and defects of the corrector. The samples lie on the trajectories. With loss `trajectory` both are fitted
to it: what the predictor errs by comes back through the nonlinear part at the predicted place.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator, model_validator

from fatigue_runner.corrector import features, samples, steps, threshold
from fatigue_runner.corrector.binding import Binding
from fatigue_runner.corrector.coordinates import to_fixed
from fatigue_runner.corrector.corrector import Corrector
from fatigue_runner.corrector.families.closed_form import ClosedForm
from fatigue_runner.corrector.guard import Guard
from fatigue_runner.corrector.header import MOST_RUNGS
from fatigue_runner.corrector.maps import MultiBladeMap
from fatigue_runner.corrector.maps.map import place
from fatigue_runner.corrector.maps.multi_blade import MOST_DAMPING, past_of
from fatigue_runner.corrector.recipe import Array, GuardRecipe, Learned, Progress, Speeds, speeds_of
from fatigue_runner.corrector.threshold import limit_of
from fatigue_runner.corrector.trajectory_loss import Windows, modes
from fatigue_runner.errors import InputError
from fatigue_runner.inputs.section import Section, problem
from fatigue_runner.integrators import multi_blade
from fatigue_runner.integrators.linear_part import linearisation_point
from fatigue_runner.integrators.tableaux import RK4
from fatigue_runner.turbine.turbine import FIXED

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine


Numbers = NDArray[np.int64]

# Of a state whose equation is linear (a filter's) the nonlinear part is what finite differences leave of it, 1e-8 [SI]; those of the
# others are above 1e-3. Scaled to unit size, it would get weights that amplify the last bits.
ROUNDING = 1e-6


class LadderRecipe(Section):
    """Smaller steps with maps of their own, see `integrators.step_ladder`."""

    halvings: int = Field(default=1, ge=1, le=MOST_RUNGS)
    kappa: float = Field(default=1.0, ge=1)


class MultiBladeRecipe(ClosedForm):
    """See the module."""

    methods = MultiBladeMap.methods

    family: Literal["affine"]
    history: int = Field(default=0, ge=0, le=features.MOST_HISTORY)
    generator_damping: float = Field(default=0.0, ge=0, lt=MOST_DAMPING)
    wind_bins: Speeds | None = None
    commands: bool = False
    guard: GuardRecipe = GuardRecipe()
    ladder: LadderRecipe | None = None

    @field_validator("factors")
    @classmethod
    def _factors_of_the_kind(cls, value: list[str]) -> list[str]:
        try:
            features.check_multi_blade_factors(tuple(value))
        except InputError as error:
            raise problem(str(error)) from None
        return value

    @property
    def bins(self) -> tuple[float, ...]:
        """Of mean winds [m/s]; none: one map for all."""
        return () if self.wind_bins is None else tuple(speeds_of(self.wind_bins))

    def in_bins(self, speeds: Array, what: Callable[[Numbers], Any]) -> list[Any]:
        """What is made of the samples of each bin, or of all: `what` gets their numbers; speeds (n,): of the samples' winds [m/s]."""
        if not self.bins:
            return [what(np.arange(len(speeds)))]
        nearest = np.abs(speeds[:, None] - np.array(self.bins)).argmin(axis=1)
        return [what(np.flatnonzero(nearest == number)) for number in range(len(self.bins))]

    def _in(self, weights: list[Array], speed: float) -> Array:
        """Those of a mean wind's bin."""
        return weights[place(self.bins, speed)]

    @model_validator(mode="after")
    def _commands_of_a_controller(self) -> MultiBladeRecipe:
        if self.commands and self.operation == FIXED:
            raise problem(
                f"are those of a controller; add `operation: controlled`, or leave them out with `operation: {FIXED}`",
                key="commands",
            )
        return self

    @model_validator(mode="after")
    def _bins_have_winds(self) -> MultiBladeRecipe:
        winds = np.array(self.training.speed_list)
        for number in range(len(self.bins)):
            if not np.any(np.abs(winds[:, None] - np.array(self.bins)).argmin(axis=1) == number):
                raise problem(
                    f"no wind of training is nearest to {self.bins[number]:g} m/s; leave the bin out, or give training more speeds",
                    key="wind_bins",
                )
        return self

    def train(self, turbine: Turbine, progress: Progress) -> Learned:
        if self.ladder is None:
            return self._at_one_step(turbine, progress)
        strict = self.guard.model_copy(update={"kappa": self.ladder.kappa})
        count, made = self.ladder.halvings, []
        for number in range(count + 1):
            step = self.step / 2**number
            progress.say(f"steps of {step * 1e3:g} ms")
            guard = strict if number < count else self.guard
            made.append(
                self.model_copy(update={"step": step, "guard": guard})._at_one_step(turbine, progress)
            )
        # RK4's steps are as small whichever rung they stand in for
        finest = made[-1].guard.substeps
        top, *below = (
            replace(learned, guard=replace(learned.guard, substeps=finest * 2 ** (count - number)))
            for number, learned in enumerate(made)
        )
        rungs = tuple(self._rung(turbine, number, learned) for number, learned in enumerate(below, start=1))
        return replace(top, rungs=rungs)

    def _rung(self, turbine: Turbine, number: int, learned: Learned) -> Corrector:
        binding = Binding.to(turbine, self.method, self.step / 2**number)
        name = f"{self.name}-rung{number}"
        return Corrector(name, self.family, binding, learned.map, learned.guard, learned.wind_range)

    def _at_one_step(self, turbine: Turbine, progress: Progress) -> Learned:
        binding = self.bound_to(turbine)
        method, factors, damping = binding.found, tuple(self.factors), self.generator_damping
        layout = multi_blade.seen_by(turbine, max(self.training.harmonics_list) > 1)
        winds = [wind.on(turbine.rotor) for wind in self.training.build()]
        progress.say(f"reference trajectories under {len(winds)} winds")
        # whole steps: a sampled one begins at a step's end
        duration = float(np.floor(self.training.duration / self.step + 1e-9) * self.step)
        runs = samples.references(turbine, winds, self.starts(turbine, winds), duration, self.step)
        length = self.length(turbine)
        sampled = partial(
            steps.collect, turbine, method, self.step, past_of(method, self.history), winds, runs, self.samples, self.seed, damping
        )  # fmt: skip

        def windows(chosen: Numbers) -> Windows | None:
            if length == 1:
                return None
            point = linearisation_point(turbine, float(np.median(found.speeds[chosen])))
            azimuth = np.arctan2(found.turn[1][chosen], found.turn[0][chosen])
            return Windows(modes(turbine, self.step, True, damping, point), length, azimuth)

        def fitted(seen: Array, defect: Array) -> list[Array]:
            turned = to_fixed(layout, defect, found.turn)
            seen = np.where(np.sqrt((seen**2).mean(axis=0)) < ROUNDING, 0.0, seen)
            return self.in_bins(
                found.speeds, lambda chosen: self.solve(layout, seen[chosen], turned[chosen], windows(chosen))
            )

        learned_ahead: list[Callable[[float], Array]] = []
        predictors = []
        for _ in range(1 + self.commands):
            progress.say(f"fitting the predictor to {len(winds) * self.samples} steps")
            bins = self.bins if learned_ahead else ()
            found = sampled(learned_ahead, bins, length, self.commands)
            ahead = fitted(found.ahead_rows, found.ahead_defect)
            learned_ahead.append(partial(self._in, ahead))
            predictors.append(ahead)
        progress.say("fitting the corrector")
        found = sampled(learned_ahead, self.bins, length, self.commands)
        seen = found.multiplied(features.multi_blade_factor_rows(layout, factors))
        learned = fitted(seen, found.defect)
        substeps = threshold.fallback_substeps(turbine, RK4.name, self.step, 1)
        speeds = np.concatenate([run.wind[:, 0] for run in runs])
        facts: dict[str, Any] = {"samples": len(seen), "winds": len(winds), "seed": self.seed}
        facts |= self.said_of_loss(length)
        first, *again, corrector = (
            (np.stack(w) if self.bins else w[0]) / binding.size for w in (*predictors, learned)
        )
        matrices = MultiBladeMap(first, corrector, factors, self.history, damping, layout, self.bins, *again)
        if length > 1:  # for the threshold steps in a row are too few different ones
            found = sampled(learned_ahead, self.bins, commands=self.commands)
        guard = self._guard(matrices, binding.size, found, substeps)
        return Learned(matrices, guard, (float(speeds.min()), float(speeds.max())), facts)

    def _guard(self, learned: MultiBladeMap, size: float, found: steps.Steps, substeps: int) -> Guard:
        """Of what the learned part adds to the method's results, and of the distance from the predicted ones.

        In one unit for all wind bins: so the steps that are made anew are spent where the errors are large.
        """
        change = learned.predict(found, size)
        predicted = found.ahead + learned.predict_ahead(found, size)
        guard = limit_of(change, found.plain, found.plain, **self.guard.threshold, substeps=substeps)
        ahead = limit_of(found.plain + change - predicted, found.plain, predicted, **self.guard.threshold)
        # in units in which the one limit is the other's as well
        return replace(guard, ahead_atol=tuple(a * ahead.limit / guard.limit for a in ahead.atol))
