"""What a campaign counts at the wall of a section: the keys of an entry of `fatigue.damage`.

place                 `tower_base`, `blade1_root`, `blade2_root` or `blade3_root`; its circle stands under `sections` in the turbine's file
curve                 what the wall stands: a curve's name (`dnv-d-air`, `ec3-80`, ...: docs/fatigue.md), or a curve of its own
                      {exponents: [3, 5], stress: [MPa], cycles: 2e6, knees: [5e6], cutoff_cycles: 1e8, thickness_exponent: 0.2}, or
                      {laminate: epoxy | polyester | carbon-epoxy, tension: [MPa], compression: [MPa], exponent, mean_factor,
                      amplitude_factor}
stress_concentration  local over nominal stress (default 1)
safety_factor         product of the partial factors of load and material, on the stress (default 1: characteristic)
ultimate              [MPa]: Goodman's correction of every range to a mean of zero (default none; a laminate has its own)
azimuths              points around the circle (default 24)
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field, PlainSerializer, PlainValidator, model_validator

from fatigue_runner.errors import InputError
from fatigue_runner.fatigue import sn_curve
from fatigue_runner.fatigue.laminate import SLOPES, Laminate
from fatigue_runner.fatigue.sections import PLACES, Circle, Strength, Wall
from fatigue_runner.fatigue.sn_curves import SNCurve
from fatigue_runner.inputs.section import Section, known_name, problem


class CurveSection(Section):
    """A curve through (`stress` [MPa], `cycles`), falling with each exponent up to its knee."""

    name: str = "of the campaign"
    exponents: list[float] = Field(min_length=1)
    stress: float = Field(gt=0)
    cycles: float = Field(default=2e6, gt=0)
    knees: list[float] = Field(default=[])
    cutoff_cycles: float | None = Field(default=None, gt=0)
    thickness_exponent: float = Field(default=0.0, ge=0, le=1)

    @model_validator(mode="after")
    def _a_curve(self) -> CurveSection:
        try:
            self.strength()
        except InputError as error:
            raise problem(str(error)) from None
        return self

    def strength(self) -> Strength:
        """The curve."""
        return SNCurve.through(
            self.name,
            self.stress,
            self.cycles,
            tuple(self.exponents),
            "as given in the campaign",
            tuple(self.knees),
            math.inf if self.cutoff_cycles is None else self.cutoff_cycles,
            thickness_exponent=self.thickness_exponent,
        )


class LaminateSection(Section):
    """A laminate by its slope and strengths [MPa]."""

    laminate: Literal["epoxy", "polyester", "carbon-epoxy"]
    tension: float = Field(gt=0)
    compression: float = Field(gt=0)
    exponent: float | None = Field(default=None, gt=0)
    mean_factor: float = Field(default=1.0, gt=0)
    amplitude_factor: float = Field(default=1.0, gt=0)

    def strength(self) -> Strength:
        """The laminate."""
        slope = SLOPES[self.laminate] if self.exponent is None else self.exponent
        name = f"{self.laminate} laminate, m = {slope:g}, {self.tension:g}/{self.compression:g} MPa"
        return Laminate(name, slope, self.tension, self.compression, self.mean_factor, self.amplitude_factor)


def _curve(value: Any) -> str | CurveSection | LaminateSection:
    if isinstance(value, CurveSection | LaminateSection):
        return value
    if isinstance(value, dict):
        return (LaminateSection if "laminate" in value else CurveSection).model_validate(value)
    try:
        return sn_curve(value).name
    except (InputError, TypeError):
        from fatigue_runner.fatigue import SN_CURVES

        return known_name(value, SN_CURVES)


def _plain(value: Any) -> Any:
    return value if isinstance(value, str) else value.model_dump(exclude_none=True)


class DamageSection(Section):
    """See the module's text."""

    place: str
    curve: Annotated[str | CurveSection | LaminateSection, PlainValidator(_curve), PlainSerializer(_plain)]
    stress_concentration: float = Field(default=1.0, gt=0, le=20)
    safety_factor: float = Field(default=1.0, gt=0, le=10)
    ultimate: float | None = Field(default=None, gt=0)
    azimuths: int = Field(default=24, ge=4, le=72)

    @model_validator(mode="after")
    def _fits(self) -> DamageSection:
        known_name(self.place, PLACES, key="place")
        if isinstance(self.curve, LaminateSection) and self.ultimate is not None:
            raise problem(
                "means nothing for a laminate, which has its own strengths; remove it", key="ultimate"
            )
        return self

    @property
    def strength(self) -> Strength:
        """What the wall stands."""
        return sn_curve(self.curve) if isinstance(self.curve, str) else self.curve.strength()

    def wall(self, circles: Mapping[str, tuple[float, float]]) -> Wall:
        """The wall on a turbine with these circles {name: (diameter, wall) [m]}; raises InputError where it has none there."""
        place = PLACES[self.place]
        if place.circle not in circles:
            raise InputError(
                f"the turbine's file does not say how thick its {place.label} is; add `sections: {{{place.circle}: {{diameter: ..., "
                "wall: ...}}` in metres to it"
            )
        return Wall(
            place,
            Circle(*circles[place.circle]),
            self.strength,
            self.stress_concentration,
            self.safety_factor,
            self.ultimate,
            self.azimuths,
        )
