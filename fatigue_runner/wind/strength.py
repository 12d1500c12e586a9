"""How strong turbulence is: an intensity, or a model of IEC 61400-1 with its classes."""

from __future__ import annotations

from dataclasses import dataclass

from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.naming import value_id
from fatigue_runner.wind.spectrum import (
    TURBULENCE_CLASSES,
    TURBULENCE_MODELS,
    WIND_CLASSES,
    extreme_turbulence_sigma,
    normal_turbulence_sigma,
    turbulence_class,
    wind_class,
)


@dataclass(frozen=True)
class Strength:
    """`intensity` = sigma_1/V [-], or a `turbulence_class` of the `model` ntm or etm; etm needs a `wind_class`, too.

    Raises InputError for neither and for both, and for what is not known.
    """

    intensity: float | None = None
    turbulence_class: str | None = None
    model: str = "ntm"
    wind_class: str | None = None

    def __post_init__(self) -> None:
        if (self.intensity is None) == (self.turbulence_class is None):
            how = "neither" if self.intensity is None else "both"
            raise InputError(
                f"turbulent wind has {how} of intensity and turbulence_class; give exactly one of them"
            )
        if self.model not in TURBULENCE_MODELS:
            near = did_you_mean(str(self.model).lower(), TURBULENCE_MODELS)
            raise InputError(f"turbulent wind: unknown turbulence model {self.model!r}{near}")
        if self.intensity is not None and self.model != "ntm":
            raise InputError(
                f"turbulent wind: {self.model} says how strong it is; give a turbulence_class ({', '.join(TURBULENCE_CLASSES)}) "
                "in place of the intensity"
            )
        if self.turbulence_class is not None:
            turbulence_class(self.turbulence_class)
        if (self.model == "etm") != (self.wind_class is not None):
            classes = ", ".join(WIND_CLASSES)
            raise InputError(
                f"turbulent wind: etm needs a wind_class ({classes})"
                if self.wind_class is None
                else f"turbulent wind: a wind_class ({classes}) means nothing for {self.model}; leave it out"
            )
        if self.wind_class is not None:
            wind_class(self.wind_class)

    def sigma(self, mean: float) -> float:
        """sigma_1 [m/s] at the mean hub-height wind `mean` [m/s]."""
        if self.intensity is not None:
            return self.intensity * mean
        if self.model == "etm":
            return extreme_turbulence_sigma(self.turbulence_class, self.wind_class, mean)
        return normal_turbulence_sigma(self.turbulence_class, mean)

    @property
    def id(self) -> str:
        """Fit for a file name: `ti0.14`, `ntmB`, `etmB-I`."""
        if self.intensity is not None:
            return f"ti{value_id(self.intensity)}"
        extreme = "" if self.wind_class is None else f"-{self.wind_class}"
        return f"{self.model}{self.turbulence_class}{extreme}"

    @property
    def words(self) -> str:
        """As it goes on behind `turbulence`; nothing for an intensity."""
        if self.intensity is not None:
            return ""
        site = "" if self.wind_class is None else f" and wind class {self.wind_class}"
        return f" of class {self.turbulence_class}{site} ({TURBULENCE_MODELS[self.model]})"
