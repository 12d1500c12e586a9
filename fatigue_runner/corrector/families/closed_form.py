"""What the recipes of closed-form fits have in common; the families stand in `affine`, `affine_net` and `affine_multi_blade`.

factors       of `sin_azimuth`, `cos_azimuth`, `wind_speed@start`, `rotor_speed`: the map varies with them; default none
training      winds, see `recipe.Winds`; `validation`: other winds, for the figures of the card
samples       steps per wind (default 500)
fit           `robust` (default: little weight on the few steps that no affine map can follow) or `least-squares`
loss          what the fit makes small: `defect` (default), errors of single steps; or `trajectory`, where these lead (`trajectory_loss`)
horizon       [s] that errors are followed for with loss `trajectory` (default: half a revolution at 8 m/s)
ridge         of the fit, relative to unit features (default 1e-12)
seed          of the samples (default 0)
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field, field_validator, model_validator

from fatigue_runner.corrector import features, fit, trajectory_loss
from fatigue_runner.corrector.recipe import Array, Recipe, Winds
from fatigue_runner.errors import InputError
from fatigue_runner.inputs.section import problem
from fatigue_runner.layout import Layout

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine


class ClosedForm(Recipe):
    """See the module."""

    factors: list[str] = Field(default=[])
    training: Winds
    validation: Winds
    samples: int = Field(default=500, ge=10, le=100_000)
    fit: Literal["robust", "least-squares"] = "robust"
    loss: Literal["defect", "trajectory"] = "defect"
    horizon: float | None = Field(default=None, gt=0)
    ridge: float = Field(default=1e-12, gt=0, le=1)
    seed: int = Field(default=0, ge=0)

    def length(self, turbine: Turbine) -> int:
        """How many sampled steps lie in a row: one, or as long as the loss follows them."""
        if self.loss == "defect":
            return 1
        return max(2, round((self.horizon or trajectory_loss.half_a_revolution(turbine)) / self.step))

    def solve(
        self, layout: Layout, rows: Array, defects: Array, windows: trajectory_loss.Windows | None = None
    ) -> Array:
        """(states, k) weights of the fit that the recipe asks for: rows (n, k), defects (n, states); windows: of steps to follow."""
        robust, watched = self.fit == "robust", features.drive(layout)
        if windows is not None:
            return trajectory_loss.fitted(rows, defects, windows, self.ridge, robust, watched)
        if robust:
            return fit.robust(rows, defects, self.ridge, watched)
        return fit.affine(rows, defects, self.ridge)

    def said_of_loss(self, length: int) -> dict[str, str]:
        """For the card, where the loss is not the usual one."""
        if self.loss == "defect":
            return {}
        return {"loss": f"{self.loss}, followed for {length} steps, {length * self.step:.3g} s"}

    @field_validator("factors")
    @classmethod
    def _factors_exist(cls, value: list[str]) -> list[str]:
        try:
            features.check_factors(tuple(value))
        except InputError as error:
            raise problem(str(error)) from None
        return value

    @model_validator(mode="after")
    def _horizon_holds_steps(self) -> ClosedForm:
        if self.horizon is None:
            return self
        if self.loss != "trajectory":
            raise problem(
                "is that of loss `trajectory`; leave it out, or add `loss: trajectory`", key="horizon"
            )
        if not 2 * self.step <= self.horizon <= self.training.duration / 2:
            raise problem(
                f"must be at least two steps, {2 * self.step:g} s, and at most half of the training's duration, "
                f"{self.training.duration / 2:g} s; got {self.horizon:g}",
                key="horizon",
            )
        return self

    @model_validator(mode="after")
    def _validation_unseen(self) -> ClosedForm:
        if self.training == self.validation:
            raise problem(
                "must hold other winds than training; give it another seed or other speeds", key="validation"
            )
        return self

    def judged_under(self) -> tuple[list[Any], float]:
        return self.validation.build(), self.validation.duration - 2 * self.step

    @property
    def judging_seed(self) -> int:
        return self.seed + 1
