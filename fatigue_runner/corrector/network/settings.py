"""How a network is made and trained, as keys of a recipe; needs no PyTorch.

The defaults are the paper's sizes. Training ends after `epochs`, or when the plateau scheduler has brought the learning rate to
`smallest_rate`. `patience` counts epochs without a better validation loss before the rate is multiplied with `factor`; the other
schedulers fall from `learning_rate` to `smallest_rate` over all epochs. `threads`: of PyTorch on a processor (0: its own choice).
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from fatigue_runner.corrector.maps.layers import MOST_UNITS
from fatigue_runner.inputs.section import Section, problem

SCHEDULERS = ("plateau", "cosine", "exponential")


def _sizes(value: tuple[int, ...]) -> tuple[int, ...]:
    if not all(0 < width <= MOST_UNITS for width in value):
        raise problem(f"hidden layers have 1 to {MOST_UNITS} units; got {list(value)}")
    return value


def _plain(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


Hidden = Annotated[tuple[int, ...], AfterValidator(_sizes), BeforeValidator(_plain)]


class NetworkSettings(Section):
    """See the module."""

    hidden: Hidden = (111, 111, 111)
    activation: Literal["relu", "isru"] = "relu"
    batch: int = Field(default=256, gt=0)
    learning_rate: float = Field(default=2e-3, gt=0)
    smallest_rate: float = Field(default=1e-6, gt=0)
    scheduler: Literal["plateau", "cosine", "exponential"] = "plateau"
    factor: float = Field(default=0.5, gt=0, lt=1)
    patience: int = Field(default=100, gt=0)
    weight_decay: float = Field(default=1e-4, ge=0)
    epochs: int = Field(default=20000, gt=0)
    seed: int = Field(default=0, ge=0)
    precision: Literal["float32", "float64"] = "float32"
    threads: int = Field(default=1, ge=0)

    @model_validator(mode="after")
    def _a_falling_rate(self) -> NetworkSettings:
        if self.smallest_rate > self.learning_rate:
            raise problem(f"lies above learning_rate {self.learning_rate:g}", key="smallest_rate")
        return self

    def but(self, **changed: Any) -> NetworkSettings:
        """The same with other values. Raises pydantic's error for impossible ones."""
        return NetworkSettings(**{**self.model_dump(), **changed})
