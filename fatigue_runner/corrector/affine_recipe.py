"""Recipes of the closed-form families: winds, samples and a least-squares fit as data, from a YAML file to the artefact.

name          of the artefact: `NAME.safetensors` beside the recipe
family        `affine`: the defect is an affine map of the features (`features`); with `factors` one that varies with them;
              `affine+net`: and a small network on what the map leaves
turbine       `nrel5mw` (default), `t2b1i1cg` or the path of a turbine YAML
method, step  the Runge-Kutta or exponential Adams method and its step [s]
factors       of `sin_azimuth`, `cos_azimuth`, `wind_speed@start`, `rotor_speed`; default none
history       earlier steps that the map looks back to (default 0); of an exponential Adams method the earlier nonlinear parts that it
              sees, at least the method's own
generator_damping  of an exponential Adams method: added to the linear part's [1/s] (default 0)
training      winds, see below; `validation`: other winds, for the figures of the card
samples       single steps per wind (default 500); half of them `perturbation` (1e-5 of each state's deviation) off the trajectory;
              those of an exponential Adams method lie on it
fit           `robust` (default: little weight on the few steps that no affine map can follow) or `least-squares`
ridge         of the fit, relative to unit features (default 1e-12)
seed          of the samples (default 0)
network       of `affine+net`: its sizes and training, see `affine_net`
refine        of a Runge-Kutta method's map: fit again on the states that rollouts visit, see `rollouts`; default not
guard         norm (`max`, `rms`), kappa (2), quantile (0.999; 1: the largest), rtol (0), substeps (fallback; default as needed)

Winds: `type: constant` with `speeds`, `vertical_shear`, `horizontal_shear` (lists, every combination), or `type: turbulent` with
`speeds: {start, stop, count}`, `intensity: [low, high]`, `shear_exponent: [low, high]`, `seed`: one wind per speed, the two drawn;
`duration` [s]; `initial`: `operating-point` (default) or `paper-spinning`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from fatigue_runner.corrector import features, fit, samples
from fatigue_runner.corrector.affine_net import NetworkRecipe
from fatigue_runner.corrector.rollouts import RefineRecipe
from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.integrators.exponential_adams import ExponentialAdams

Array = NDArray[np.float64]
# the edge mode and the shaft, and their rates: the largest errors of a run; what a robust fit watches
DRIVE = (5, 7, 13, 14, 15)


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Range(_Part):
    """`count` values from start to stop, both included."""

    start: float = Field(gt=0)
    stop: float = Field(gt=0)
    count: int = Field(ge=1, le=1000)


class Winds(_Part):
    """What blows; see the module."""

    type: Literal["constant", "turbulent"] = "turbulent"
    speeds: Range | list[float]
    intensity: tuple[float, float] = (0.08, 0.18)
    shear_exponent: tuple[float, float] = (0.0, 0.3)
    vertical_shear: list[float] = [0.0]
    horizontal_shear: list[float] = [0.0]
    seed: int = Field(default=0, ge=0)
    duration: float = Field(default=120.0, ge=2, le=1e4)

    @field_validator("intensity", "shear_exponent")
    @classmethod
    def _ordered(cls, value: tuple[float, float]) -> tuple[float, float]:
        if not 0 <= value[0] <= value[1]:
            raise ValueError(f"must be [low, high] with 0 <= low <= high, got {list(value)}")
        return value

    @property
    def speed_list(self) -> list[float]:
        if isinstance(self.speeds, Range):
            return [float(v) for v in np.linspace(self.speeds.start, self.speeds.stop, self.speeds.count)]
        return self.speeds

    def build(self) -> list[Any]:
        """The wind sources."""
        from fatigue_runner.wind import ConstantWind, TurbulentWind

        if self.type == "constant":
            return [
                ConstantWind(v, kv, kh)
                for v in self.speed_list for kv in self.vertical_shear for kh in self.horizontal_shear
            ]  # fmt: skip
        rng = np.random.Generator(np.random.PCG64(self.seed))
        return [
            TurbulentWind(
                v, intensity=float(rng.uniform(*self.intensity)), shear_exponent=float(rng.uniform(*self.shear_exponent)),
                seed=100_000 + 1000 * self.seed + number, duration=self.duration,
                rotor_radius=63.0, hub_height=90.0,  # whatever the turbine: the shipped correctors were trained so
            )
            for number, v in enumerate(self.speed_list)
        ]  # fmt: skip


class GuardRecipe(_Part):
    """Acceptance test of the hybrid."""

    norm: Literal["max", "rms"] = "max"
    kappa: float = Field(default=2.0, ge=1)
    quantile: float = Field(default=0.999, gt=0, le=1)
    rtol: float = Field(default=0.0, ge=0)
    substeps: int | None = Field(default=None, ge=0, le=64)


class AffineRecipe(_Part):
    """A whole recipe; see the module."""

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$")
    family: Literal["affine", "affine+net"]
    description: str = ""
    turbine: str = "nrel5mw"
    method: str
    step: float = Field(gt=0, le=1)
    factors: list[str] = []
    history: int = Field(default=0, ge=0, le=features.MOST_HISTORY)
    generator_damping: float = Field(default=0.0, ge=0, lt=100)
    training: Winds
    validation: Winds
    initial: Literal["operating-point", "paper", "paper-spinning"] = "operating-point"
    samples: int = Field(default=500, ge=10, le=100_000)
    perturbation: float = Field(default=1e-5, ge=0, le=1)
    fit: Literal["robust", "least-squares"] = "robust"
    ridge: float = Field(default=1e-12, gt=0, le=1)
    seed: int = Field(default=0, ge=0)
    guard: GuardRecipe = GuardRecipe()
    network: NetworkRecipe | None = None
    refine: RefineRecipe | None = None

    def solve(self, rows: Array, defects: Array) -> Array:
        """(16, k) weights of the fit that the recipe asks for: rows (n, k), defects (n, 16)."""
        if self.fit == "robust":
            return fit.robust(rows, defects, self.ridge, DRIVE)
        return fit.affine(rows, defects, self.ridge)

    @field_validator("factors")
    @classmethod
    def _factors_exist(cls, value: list[str]) -> list[str]:
        for name in value:
            if name not in features.FACTORS:
                raise ValueError(f"unknown feature factor {name!r}{did_you_mean(name, features.FACTORS)}")
        return value

    @field_validator("method")
    @classmethod
    def _has_stages(cls, value: str) -> str:
        try:
            samples.base_method(value)
        except InputError as error:
            raise ValueError(str(error)) from None
        return value

    @model_validator(mode="after")
    def _fits_the_method(self) -> AffineRecipe:
        exponential = isinstance(samples.base_method(self.method), ExponentialAdams)
        if exponential:
            try:
                features.multi_blade_factors(tuple(self.factors))
            except InputError as error:
                raise ValueError(str(error)) from None
            if self.guard.substeps:
                raise ValueError(
                    f"guard.substeps: the fallback of {self.method} is the method itself; leave it out"
                )
            for key in ("network", "refine"):
                if getattr(self, key) is not None:
                    raise ValueError(f"{key}: correctors of {self.method} are two matrices; leave it out")
        elif self.generator_damping:
            raise ValueError(f"generator_damping: {self.method} has no linear part; leave it out")
        if (self.network is not None) != (self.family == "affine+net"):
            raise ValueError("network: the key belongs to family affine+net, and only to it")
        return self

    @model_validator(mode="after")
    def _validation_unseen(self) -> AffineRecipe:
        if self.training == self.validation:
            raise ValueError(
                "validation must hold other winds than training; give it another seed or other speeds"
            )
        return self


def parse_affine(data: Mapping[str, Any], place: str = "recipe") -> AffineRecipe:
    """The recipe in a mapping. Raises InputError with the place, the key and the nearest known one of the first mistake."""
    try:
        return AffineRecipe.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        location = [str(part) for part in first["loc"] if part not in ("Range", "list[float]")]
        key = ".".join(location)
        if first["type"] == "extra_forbidden":
            inner = {
                "training": Winds, "validation": Winds, "guard": GuardRecipe, "network": NetworkRecipe, "refine": RefineRecipe,
            }  # fmt: skip
            part: Any = inner.get(location[0], AffineRecipe) if len(location) > 1 else AffineRecipe
            known = Range.model_fields if "speeds" in location[:-1] else part.model_fields
            raise InputError(f"{place}: unknown key {key!r}{did_you_mean(location[-1], known)}") from None
        what = first["msg"].removeprefix("Value error, ")
        raise InputError(f"{place}: {key}: {what}" if key else f"{place}: {what}") from None
