"""Constant wind: speed and shear, held for the whole run; linear as in the paper, or a profile with all its harmonics."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from pydantic import Field, model_validator

from fatigue_runner.inputs.section import problem
from fatigue_runner.inputs.sweep import Sweep, expand
from fatigue_runner.naming import joined, speed_id, value_id
from fatigue_runner.rotor import Rotor
from fatigue_runner.wind.checks import linear_shear, wind_speed
from fatigue_runner.wind.mean_shear import NO_TURBINE, checked_order, mean_profile, mean_signals, one_profile
from fatigue_runner.wind.profiles import Profile
from fatigue_runner.wind.section import Harmonics, Realisation, Site, WindSection
from fatigue_runner.wind.source import WindSource


@dataclass(frozen=True, init=False)
class ConstantWind(WindSource):
    """Steady hub-height wind of `speed` [m/s] with linear shears [-], or with a power law of `shear_exponent` alpha, or with a
    logarithmic profile of `roughness_length` z_0 [m].

    Of a profile the blades feel `harmonics` azimuthal harmonics (default 6): its exact shape on the turbine that it blows on;
    with 1 it is linear, its slope at the hub (alpha R/H). Linear shears have no others. Raises InputError for a speed <= 0, for a
    vertical shear beside a profile, for both profiles, and for harmonics of a linear shear.
    """

    kind = "constant"

    speed: float
    vertical_shear: float = 0.0
    horizontal_shear: float = 0.0
    shear_exponent: float | None = None
    order: int | None = None
    rotor: Rotor | None = None
    roughness_length: float | None = None

    def __init__(
        self,
        speed: float,
        vertical_shear: float = 0.0,
        horizontal_shear: float = 0.0,
        shear_exponent: float | None = None,
        harmonics: int | None = None,
        rotor: Rotor | None = None,
        roughness_length: float | None = None,
    ) -> None:
        put = object.__setattr__
        put(self, "speed", wind_speed("constant wind: speed", speed))
        put(self, "vertical_shear", linear_shear("constant wind: vertical_shear", vertical_shear))
        put(self, "horizontal_shear", linear_shear("constant wind: horizontal_shear", horizontal_shear))
        put(self, "shear_exponent", shear_exponent)
        put(self, "rotor", rotor)
        put(self, "roughness_length", roughness_length)
        put(self, "order", checked_order("constant wind", harmonics, self.profile, self.vertical_shear))

    @classmethod
    def example(cls) -> ConstantWind:
        return cls(8.0, 0.14, -0.05)

    @property
    def profile(self) -> Profile | None:
        """Of the mean wind; None where its shears are linear."""
        return mean_profile("constant wind", self.shear_exponent, self.roughness_length)

    def on(self, rotor: Rotor) -> Self:
        if self.profile is None or self.rotor is not None:
            return self
        shears = self.vertical_shear, self.horizontal_shear, self.shear_exponent
        return type(self)(self.speed, *shears, self.order, rotor, self.roughness_length)

    @property
    def harmonics(self) -> int:
        return self.order or 1

    @property
    def name(self) -> str:
        shears = {"kv": self.vertical_shear, "kh": self.horizontal_shear}
        shears |= {"alpha": self.shear_exponent or 0.0, "z0-": self.roughness_length or 0.0}
        return "-".join(
            ["constant", f"{self.speed:g}", *(f"{k}{value:g}" for k, value in shears.items() if value)]
        )

    @property
    def mean_speed(self) -> float:
        return self.speed

    @property
    def parameters(self) -> dict[str, Any]:
        shears = {
            "vertical_shear": float(self._signals[1]),
            "horizontal_shear": float(self._signals[2]),
        }
        laws = {"shear_exponent": self.shear_exponent, "roughness_length": self.roughness_length}
        return {**shears, **{key: value for key, value in laws.items() if value is not None}}

    @property
    def description(self) -> str:
        return f"steady wind, {self.profile.words if self.profile else 'linear shears'}"

    @property
    def left_out(self) -> str:
        return "" if self.profile is None else super().left_out

    @property
    def cell_key(self) -> None:
        return None

    @cached_property
    def _signals(self) -> np.ndarray:
        if self.profile is None:
            return np.array([self.speed, self.vertical_shear, self.horizontal_shear])
        out = mean_signals(self.profile, self.speed, self.rotor or NO_TURBINE, self.harmonics)
        out[2] = self.horizontal_shear
        return out

    def _cells(self, n_cells: int) -> np.ndarray:
        coefficients = np.zeros((n_cells, 4, self.signals))
        coefficients[:, 0] = self._signals
        return coefficients


class ConstantSection(WindSection):
    """Every combination of speed and shears, in this order.

    speeds             hub-height speeds [m/s]: a sweep
    vertical_shear     linear shear kappa_v [-], v(z) = v (1 + kappa_v z/R); a sweep (default 0)
    horizontal_shear   linear shear kappa_h [-]; a sweep (default 0)
    shear_exponent     power-law exponent alpha instead of `vertical_shear`, or
    roughness_length   z_0 [m] of a logarithmic profile
    harmonics          azimuthal harmonics of the profile that the blades feel (default 6); 1: linear, its slope at the hub
    """

    kind = "constant"

    speeds: Sweep
    vertical_shear: Sweep = Field(default=[0.0])
    horizontal_shear: Sweep = Field(default=[0.0])
    shear_exponent: float | None = Field(default=None, ge=-1, le=1)
    roughness_length: float | None = Field(default=None, gt=0)
    harmonics: Harmonics | None = None

    @model_validator(mode="after")
    def _one_vertical_shear(self) -> ConstantSection:
        given = self.model_fields_set
        one_profile(self)
        profiles = given & {"shear_exponent", "roughness_length"}
        if profiles and "vertical_shear" in given:
            raise problem("stands beside vertical_shear; give one of the two", key=profiles.pop())
        if not profiles and (self.harmonics or 1) > 1:
            raise problem(
                "a linear shear has one harmonic; give `shear_exponent` for a power law", key="harmonics"
            )
        return self

    def realisations(self, site: Site) -> Iterator[Realisation]:
        alpha, z0 = self.shear_exponent, self.roughness_length
        pairs = ("shear_exponent", alpha), ("roughness_length", z0), ("harmonics", self.harmonics)
        law = [(key, value) for key, value in pairs if value is not None]
        for speed, piece in expand(self.speeds):
            for kv, _ in expand(self.vertical_shear):
                for kh, _ in expand(self.horizontal_shear):
                    words = ("kv", kv), ("kh", kh), ("a", alpha), ("z0-", z0)
                    yield Realisation(
                        joined(speed_id(speed), *(f"{k}{value_id(x)}" for k, x in words if x)),
                        self.kind,
                        (("speed", speed), ("vertical_shear", kv), ("horizontal_shear", kh), *law),
                        ("speeds", piece),
                        speed,
                    )
