"""Constant wind: the paper's parameters (speed, vertical shear, horizontal shear), held for the whole run."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fatigue_runner.channels import WIND_NAMES
from fatigue_runner.wind.checks import number, wind_speed
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
