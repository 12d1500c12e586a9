"""Sweeps: how a campaign file says "these values", and the list of numbers that it means."""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Annotated, Any

from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from fatigue_runner.inputs.section import TAG, Section, problem

# One campaign file must not ask for more cases than a disk or a person could take.
MAX_VALUES = 100_000


class Range(Section):
    """Values from `start` to `stop`, both included: `{start: 5, stop: 10, step: 0.5}`, or `count: 11`."""

    start: float
    stop: float
    step: float | None = Field(default=None, gt=0)
    count: int | None = Field(default=None, ge=1, le=MAX_VALUES)

    @model_validator(mode="after")
    def _one_spacing(self) -> Range:
        if (self.step is None) == (self.count is None):
            raise problem("give either `step` or `count` beside `start` and `stop`")
        if self.stop < self.start:
            raise problem(
                f"start {self.start:g} lies above stop {self.stop:g}, so the sweep is empty; swap them"
            )
        if self.step is not None and (self.stop - self.start) / self.step > MAX_VALUES:
            raise problem(f"holds more than {MAX_VALUES} values; use a larger `step`", key="step")
        return self

    def expand(self, taken: set[float]) -> list[float]:
        """The values but those `taken`. 5 + 3*0.1 is 5.3; elevenths are cut to 6 digits (readable names)."""
        if self.step is not None:
            count, spacing, digits = int((self.stop - self.start) / self.step + 1e-9) + 1, self.step, 12
        else:
            count = self.count or 1
            spacing, digits = (self.stop - self.start) / max(count - 1, 1), 6
        values = (float(f"{self.start + i * spacing:.{digits}g}") for i in range(count))
        return [value for value in values if value not in taken]


class RandomDraw(Section):
    """`count` values drawn uniformly between `low` and `high` from `seed`."""

    count: int = Field(ge=1, le=MAX_VALUES)
    low: float
    high: float
    seed: int = Field(ge=0)

    @model_validator(mode="after")
    def _room(self) -> RandomDraw:
        if (self.high - self.low) * 1e4 < 2 * self.count:
            raise problem(f"{self.count} different values need `high` well above `low` (drawn to 4 digits)")
        return self


class Random(Section):
    """Random values, the same on every machine: `{random: {count: 200, low: 5, high: 10, seed: 1}}`."""

    random: RandomDraw

    def expand(self, taken: set[float]) -> list[float]:
        """The values in increasing order, rounded to 1e-4 (readable case names), none twice.

        Python's own generator: its stream for a seed is documented not to change, NumPy's is not.
        """
        draw, spec = random.Random(self.random.seed), self.random
        values: dict[float, None] = {}
        for _ in range(100 * spec.count):
            value = round(spec.low + (spec.high - spec.low) * draw.random(), 4)
            if value not in taken:
                values[value] = None
            if len(values) == spec.count:
                break
        return sorted(values)


def _kind(piece: Any) -> str | None:
    if isinstance(piece, dict):
        return f"{TAG}random" if "random" in piece else f"{TAG}range"
    return (
        f"{TAG}random"
        if isinstance(piece, Random)
        else f"{TAG}range"
        if isinstance(piece, Range)
        else f"{TAG}number"
    )


Piece = Annotated[
    Annotated[float, Tag(f"{TAG}number")]
    | Annotated[Range, Tag(f"{TAG}range")]
    | Annotated[Random, Tag(f"{TAG}random")],
    Discriminator(_kind),
]


def as_list(value: Any) -> Any:
    """A single value where a list may stand."""
    return value if isinstance(value, list) else [value]


def check_not_empty(value: Any) -> Any:
    """An empty list is an empty sweep."""
    if value == []:
        raise problem("is an empty sweep, so there is nothing to run; give at least one value")
    return value


# A number, a range, random values, or a list of these.
Sweep = Annotated[list[Piece], BeforeValidator(check_not_empty), BeforeValidator(as_list)]


def expand(pieces: Sequence[float | Range | Random]) -> list[tuple[float, int]]:
    """(value, index of its piece) in the order written; a value that stands in two pieces comes once."""
    found: dict[float, int] = {}
    for index, piece in enumerate(pieces):
        values = piece.expand(set(found)) if isinstance(piece, Range | Random) else [float(piece)]
        for value in values:
            found.setdefault(value, index)
    return list(found.items())
