"""What the recipes of closed-form fits have in common; the families stand in `affine`, `affine_net` and `affine_multi_blade`.

factors       of `sin_azimuth`, `cos_azimuth`, `wind_speed@start`, `rotor_speed`: the map varies with them; default none
training      winds, see `recipe.Winds`; `validation`: other winds, for the figures of the card
samples       single steps per wind (default 500)
fit           `robust` (default: little weight on the few steps that no affine map can follow) or `least-squares`
ridge         of the fit, relative to unit features (default 1e-12)
seed          of the samples (default 0)
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field, field_validator, model_validator

from fatigue_runner.corrector import features, fit
from fatigue_runner.corrector.recipe import Array, Recipe, Winds
from fatigue_runner.errors import InputError
from fatigue_runner.inputs.section import problem
from fatigue_runner.layout import Layout


class ClosedForm(Recipe):
    """See the module."""

    factors: list[str] = Field(default=[])
    training: Winds
    validation: Winds
    samples: int = Field(default=500, ge=10, le=100_000)
    fit: Literal["robust", "least-squares"] = "robust"
    ridge: float = Field(default=1e-12, gt=0, le=1)
    seed: int = Field(default=0, ge=0)

    def solve(self, layout: Layout, rows: Array, defects: Array) -> Array:
        """(states, k) weights of the fit that the recipe asks for: rows (n, k), defects (n, states)."""
        if self.fit == "robust":
            return fit.robust(rows, defects, self.ridge, features.drive(layout))
        return fit.affine(rows, defects, self.ridge)

    @field_validator("factors")
    @classmethod
    def _factors_exist(cls, value: list[str]) -> list[str]:
        try:
            features.check_factors(tuple(value))
        except InputError as error:
            raise problem(str(error)) from None
        return value

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
