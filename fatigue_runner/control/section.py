"""The `control` section of a turbine file: what every controller's has. Its own keys stand with each controller.

controller            which one (default `baseline`)
pitch_rate_limit_deg  pitch rate [deg/s] that is watched: it does not act, where it would have is counted (default 8)
actuator              optional pitch actuator of second order: `natural_frequency` [rad/s], `damping_ratio` [-]
tuning                optional: gains from `natural_frequency` [rad/s] and `damping_ratio` [-] of the speed loop as designed, in place of
                      those of the file; `wake`: of the power's sensitivity to pitch, see `Tuning`
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from fatigue_runner.inputs.section import Section, known_name, problem

Positive = Annotated[float, Field(gt=0)]

DEFAULT = "baseline"
SECTIONS: dict[str, type[ControlSection]] = {}


class Actuator(Section):
    """A pitch actuator of second order."""

    natural_frequency: Positive
    damping_ratio: Annotated[float, Field(gt=0, le=5)]


class Tuning(Section):
    """The speed loop as it is designed: see `control.tuning`.

    wake: whether the wake follows the pitch (`equilibrium`, from the tables) or not (`frozen`, from blade elements, as NREL's); by
    default `frozen` where the file has airfoils.
    """

    natural_frequency: Annotated[float, Field(gt=0, le=10)] = 0.6
    damping_ratio: Annotated[float, Field(gt=0, le=5)] = 0.7
    wake: Literal["frozen", "equilibrium"] | None = None


class ControlSection(Section):
    """The base of all controllers' sections; `kind` is what the file's `controller` says."""

    kind: ClassVar[str]

    controller: str = DEFAULT
    pitch_rate_limit_deg: Positive = 8.0
    actuator: Actuator | None = None
    tuning: Tuning | None = None

    @classmethod
    def __pydantic_init_subclass__(cls, **options: Any) -> None:
        super().__pydantic_init_subclass__(**options)
        SECTIONS[cls.kind] = cls


def control_section(value: Any) -> ControlSection:
    """The section of a turbine file's `control`, by its `controller`; for pydantic's validators."""
    if isinstance(value, ControlSection):
        return value
    if not isinstance(value, dict):
        raise problem(f"must be a section; got {value!r:.60}")
    kind = value.get("controller", DEFAULT)
    return SECTIONS[known_name(kind, SECTIONS, key="controller")].model_validate(value)
