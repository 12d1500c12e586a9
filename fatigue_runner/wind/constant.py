"""Constant wind: the paper's parameters (speed, vertical shear, horizontal shear), held for the whole run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import Field, model_validator

from fatigue_runner.channels import WIND_NAMES
from fatigue_runner.inputs.section import problem
from fatigue_runner.inputs.sweep import Sweep, expand
from fatigue_runner.naming import joined, speed_id, value_id
from fatigue_runner.wind.checks import number, wind_speed
from fatigue_runner.wind.section import Realisation, Site, WindSection
from fatigue_runner.wind.source import WindSource


@dataclass(frozen=True)
class ConstantWind(WindSource):
    """Steady hub-height wind of `speed` [m/s] with linear shears [-]. Raises InputError for a speed <= 0."""

    kind = "constant"

    speed: float
    vertical_shear: float = 0.0
    horizontal_shear: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "speed", wind_speed("constant wind: speed", self.speed))
        for key in ("vertical_shear", "horizontal_shear"):
            object.__setattr__(self, key, number(f"constant wind: {key}", getattr(self, key)))

    @classmethod
    def example(cls) -> ConstantWind:
        return cls(8.0, 0.14, -0.05)

    @property
    def name(self) -> str:
        shears = {"kv": self.vertical_shear, "kh": self.horizontal_shear}
        return "-".join(
            ["constant", f"{self.speed:g}", *(f"{k}{value:g}" for k, value in shears.items() if value)]
        )

    @property
    def mean_speed(self) -> float:
        return self.speed

    @property
    def parameters(self) -> dict[str, Any]:
        return {"vertical_shear": self.vertical_shear, "horizontal_shear": self.horizontal_shear}

    @property
    def cell_key(self) -> None:
        return None

    def _cells(self, n_cells: int) -> np.ndarray:
        coefficients = np.zeros((n_cells, 4, len(WIND_NAMES)))
        coefficients[:, 0] = self.speed, self.vertical_shear, self.horizontal_shear
        return coefficients


class ConstantSection(WindSection):
    """Every combination of speed and shears, in this order.

    speeds             hub-height speeds [m/s]: a sweep
    vertical_shear     linear shear kappa_v [-], v(z) = v (1 + kappa_v z/R); a sweep (default 0)
    horizontal_shear   linear shear kappa_h [-]; a sweep (default 0)
    shear_exponent     power-law exponent alpha instead of `vertical_shear`: kappa_v = alpha R/H
    """

    kind = "constant"

    speeds: Sweep
    vertical_shear: Sweep = Field(default=[0.0])
    horizontal_shear: Sweep = Field(default=[0.0])
    shear_exponent: float | None = Field(default=None, ge=-1, le=1)

    @model_validator(mode="after")
    def _one_vertical_shear(self) -> ConstantSection:
        if {"vertical_shear", "shear_exponent"} <= self.model_fields_set:
            raise problem("stands beside vertical_shear; give one of the two", key="shear_exponent")
        return self

    def realisations(self, site: Site) -> Iterator[Realisation]:
        vertical = [value for value, _ in expand(self.vertical_shear)]
        if self.shear_exponent is not None:
            vertical = [self.shear_exponent * site.rotor.radius / site.rotor.hub_height]
        for speed, piece in expand(self.speeds):
            for kv in vertical:
                for kh, _ in expand(self.horizontal_shear):
                    yield Realisation(
                        joined(
                            speed_id(speed), *(f"{k}{value_id(x)}" for k, x in (("kv", kv), ("kh", kh)) if x)
                        ),
                        self.kind,
                        (("speed", speed), ("vertical_shear", kv), ("horizontal_shear", kh)),
                        ("speeds", piece),
                        speed,
                    )
