"""Constant wind: speed and shear, held for the whole run; linear as in the paper, or a power law with all its harmonics."""

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
from fatigue_runner.wind.mean_shear import NO_TURBINE, checked_order, mean_signals
from fatigue_runner.wind.profiles import PowerLaw
from fatigue_runner.wind.section import Realisation, Site, WindSection
from fatigue_runner.wind.source import WindSource


@dataclass(frozen=True, init=False)
class ConstantWind(WindSource):
    """Steady hub-height wind of `speed` [m/s] with linear shears [-], or with a power law of `shear_exponent` alpha.

    Of a power law the blades feel `harmonics` azimuthal harmonics (default 6): its exact profile on the turbine that it blows on;
    with 1 it is linear, kappa_v = alpha R/H. Linear shears have no others. Raises InputError for a speed <= 0, for both a vertical
    shear and an exponent, and for harmonics of a linear shear.
    """

    kind = "constant"

    speed: float
    vertical_shear: float = 0.0
    horizontal_shear: float = 0.0
    shear_exponent: float | None = None
    order: int | None = None
    rotor: Rotor | None = None

    def __init__(
        self,
        speed: float,
        vertical_shear: float = 0.0,
        horizontal_shear: float = 0.0,
        shear_exponent: float | None = None,
        harmonics: int | None = None,
        rotor: Rotor | None = None,
    ) -> None:
        put = object.__setattr__
        put(self, "speed", wind_speed("constant wind: speed", speed))
        put(self, "vertical_shear", linear_shear("constant wind: vertical_shear", vertical_shear))
        put(self, "horizontal_shear", linear_shear("constant wind: horizontal_shear", horizontal_shear))
        put(self, "shear_exponent", shear_exponent)
        put(self, "rotor", rotor)
        put(self, "order", checked_order("constant wind", harmonics, shear_exponent, self.vertical_shear))

    @classmethod
    def example(cls) -> ConstantWind:
        return cls(8.0, 0.14, -0.05)

    def on(self, rotor: Rotor) -> Self:
        if self.shear_exponent is None or self.rotor is not None:
            return self
        return type(self)(
            self.speed, self.vertical_shear, self.horizontal_shear, self.shear_exponent, self.order, rotor
        )

    @property
    def harmonics(self) -> int:
        return self.order or 1

    @property
    def name(self) -> str:
        shears = {"kv": self.vertical_shear, "kh": self.horizontal_shear, "alpha": self.shear_exponent}
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
        law = {} if self.shear_exponent is None else {"shear_exponent": self.shear_exponent}
        return {**shears, **law}

    @property
    def description(self) -> str:
        return "steady wind, linear shears" if self.shear_exponent is None else "steady wind, power law"

    @property
    def left_out(self) -> str:
        return "" if self.shear_exponent is None else super().left_out

    @property
    def cell_key(self) -> None:
        return None

    @cached_property
    def _signals(self) -> np.ndarray:
        if self.shear_exponent is None:
            return np.array([self.speed, self.vertical_shear, self.horizontal_shear])
        law, rotor = PowerLaw(self.shear_exponent), self.rotor or NO_TURBINE
        out = mean_signals(law, self.speed, rotor, self.harmonics)
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
    shear_exponent     power-law exponent alpha instead of `vertical_shear`
    harmonics          azimuthal harmonics of the power law that the blades feel (default 6); 1: linear, kappa_v = alpha R/H
    """

    kind = "constant"

    speeds: Sweep
    vertical_shear: Sweep = Field(default=[0.0])
    horizontal_shear: Sweep = Field(default=[0.0])
    shear_exponent: float | None = Field(default=None, ge=-1, le=1)
    harmonics: int | None = Field(default=None, ge=0, le=16)

    @model_validator(mode="after")
    def _one_vertical_shear(self) -> ConstantSection:
        given = self.model_fields_set
        if {"vertical_shear", "shear_exponent"} <= given:
            raise problem("stands beside vertical_shear; give one of the two", key="shear_exponent")
        if "harmonics" in given and "shear_exponent" not in given and (self.harmonics or 1) > 1:
            raise problem(
                "a linear shear has one harmonic; give `shear_exponent` for a power law", key="harmonics"
            )
        return self

    def realisations(self, site: Site) -> Iterator[Realisation]:
        alpha = self.shear_exponent
        law = [("shear_exponent", alpha)] if alpha is not None else []
        law += [("harmonics", self.harmonics)] if self.harmonics is not None else []
        for speed, piece in expand(self.speeds):
            for kv, _ in expand(self.vertical_shear):
                for kh, _ in expand(self.horizontal_shear):
                    words = ("kv", kv), ("kh", kh), ("a", alpha)
                    yield Realisation(
                        joined(speed_id(speed), *(f"{k}{value_id(x)}" for k, x in words if x)),
                        self.kind,
                        (("speed", speed), ("vertical_shear", kv), ("horizontal_shear", kh), *law),
                        ("speeds", piece),
                        speed,
                    )
