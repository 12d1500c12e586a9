"""Recipes: what makes a corrector, as data. One base for all families, the sections that several share, and the register.

name          of the artefact: `NAME.safetensors` beside the recipe
family        what is learned and how: `fatigue_runner/corrector/families/` has a file for each, with the keys of its own
description   for people
turbine       `nrel5mw`, `t2b1i1cg` or the path of a turbine YAML
operation     `fixed` pitch (default), `controlled` or `torque-law`: who steers the turbine, as in a campaign
method, step  the method that is corrected and its step [s]
initial       state at the start of every trajectory: `operating-point`, `paper` or `paper-spinning`
"""

from __future__ import annotations

import re
from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag, field_validator

from fatigue_runner.corrector.binding import Binding, correctable
from fatigue_runner.corrector.fit import relative_residual
from fatigue_runner.errors import InputError
from fatigue_runner.inputs.section import TAG, Section, known_name, problem
from fatigue_runner.integrators.initial import INITIAL_STATES, initial_state
from fatigue_runner.turbine.turbine import FIXED, OPERATIONS
from fatigue_runner.wind.section import Harmonics

if TYPE_CHECKING:
    from fatigue_runner.corrector.corrector import Corrector
    from fatigue_runner.corrector.guard import Guard
    from fatigue_runner.corrector.maps import Map
    from fatigue_runner.trajectory import Trajectory
    from fatigue_runner.turbine import Turbine

Array = NDArray[np.float64]

# (family, family of the methods that it corrects) -> the recipe; filled as the modules of `families` are imported
FAMILIES: dict[tuple[str, str], type[Recipe]] = {}
RESIDUAL_SAMPLES = 200  # per validation wind, for the figure `residual`


@dataclass(frozen=True)
class Progress:
    """Who is told of a training: `say` of its stages, `epoch` of every epoch of a network (epoch, epochs, train, validation, best, rate);
    checkpoint: file by which a network's training that was stopped goes on."""

    say: Callable[[str], None] = lambda what: None
    epoch: Callable[[dict[str, float]], None] | None = None
    checkpoint: Path | None = None


@dataclass(frozen=True)
class Learned:
    """What a family's training gives: the map, its guard, the winds seen [m/s], what is to be said of it on the card, and its rungs."""

    map: Map
    guard: Guard
    wind_range: tuple[float, float]
    facts: Mapping[str, Any] = field(default_factory=dict)
    rungs: tuple[Corrector, ...] = ()


class Recipe(Section):
    """The base of every family's recipe.

    A new family is one file in `families/`: a subclass whose `family` is the Literal of its name, with `methods`, the family of the
    methods that it corrects (`Method.family`), fields for its own keys, `train`, and `judged_under`, the winds and the duration for its
    figures; and, where no map of `maps/` fits, a `Map` of its own. The same family may have a class for each family of methods.
    """

    methods: ClassVar[str] = ""
    seed_key: ClassVar[tuple[str, ...]] = ("seed",)  # where another seed of the training belongs

    name: str
    family: str
    description: str = ""
    turbine: str = "nrel5mw"
    operation: str = FIXED
    method: str
    step: float = Field(gt=0, le=1)
    initial: str = "operating-point"

    @classmethod
    def __pydantic_init_subclass__(cls, **options: Any) -> None:
        super().__pydantic_init_subclass__(**options)
        for name in get_args(cls.model_fields["family"].annotation):
            FAMILIES[name, cls.methods] = cls

    @classmethod
    def unknown(cls, key: str) -> Any:
        """Says so where a key is another family's."""
        others = sorted(
            {
                f"{name} of {methods} methods"
                for (name, methods), other in FAMILIES.items()
                if key in other.model_fields
            }
        )
        if others:
            return problem(f"the key belongs to family {' and '.join(others)}; leave it out", key=key)
        return super().unknown(key)

    @field_validator("name")
    @classmethod
    def _a_file_name(cls, value: str) -> str:
        if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]*", value):
            raise problem(f"must consist of letters, digits, `.`, `_` and `-`; got {value!r:.60}")
        return value

    @field_validator("initial")
    @classmethod
    def _known_state(cls, value: str) -> str:
        return known_name(value, INITIAL_STATES)

    @field_validator("operation")
    @classmethod
    def _known_operation(cls, value: str) -> str:
        return known_name(value, OPERATIONS)

    @field_validator("method")
    @classmethod
    def _correctable(cls, value: str) -> str:
        try:
            correctable(value)
        except InputError as error:
            raise problem(str(error)) from None
        return value

    def load_turbine(self) -> Turbine:
        """The turbine as it is operated. Raises InputError for one that cannot be so."""
        from fatigue_runner.turbine import load_turbine

        return load_turbine(self.turbine).operated(self.operation)

    def starts(self, turbine: Turbine, winds: Sequence[Any]) -> Array:
        """(n, states) initial states."""
        return np.array([initial_state(turbine, self.initial, wind) for wind in winds])

    @abstractmethod
    def train(self, turbine: Turbine, progress: Progress) -> Learned:
        """Make the samples, fit, find the guard's threshold. Raises InputError where the recipe asks for what cannot be."""

    @abstractmethod
    def judged_under(self) -> tuple[list[Any], float]:
        """Winds that were not trained on, and the duration [s] of the runs under them: for the figures of the card."""

    @property
    def judging_seed(self) -> int:
        """Of the samples that are judged, not trained on."""
        return 1

    def residual(
        self, corrector: Corrector, turbine: Turbine, winds: Sequence[Any], runs: Sequence[Trajectory]
    ) -> Array:
        """(states,) what the corrector leaves of each state's defect along `runs`, which are sampled every step, relative to it."""
        found = corrector.map.sample(
            corrector.binding, turbine, winds, runs, RESIDUAL_SAMPLES, self.judging_seed
        )
        return relative_residual(corrector.predict(found), found.defect)

    def tune(self, turbine: Turbine, trials: int, epochs: int, storage: Path, told: Any = None) -> Any:
        """Search for better settings of the training. Raises InputError for a family that has none."""
        raise InputError(f"a corrector of family {self.family!r} has nothing to tune; its fit is exact")

    def bound_to(self, turbine: Turbine) -> Binding:
        return Binding.to(turbine, self.method, self.step)


# --- sections that families share ---


class Spread(Section):
    """`count` values from start to stop, both included."""

    start: float = Field(gt=0)
    stop: float = Field(gt=0)
    count: int = Field(ge=1, le=1000)


def _pair(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) and len(value) == 2 else value


def _ordered(value: tuple[float, float]) -> tuple[float, float]:
    if not 0 <= value[0] <= value[1]:
        raise problem(f"must be [low, high] with 0 <= low <= high; got {list(value)}")
    return value


Interval = Annotated[tuple[float, float], AfterValidator(_ordered), BeforeValidator(_pair)]
Speeds = Annotated[
    Annotated[Spread, Tag(f"{TAG}spread")] | Annotated[list[float], Tag(f"{TAG}list")],
    Discriminator(lambda value: f"{TAG}spread" if isinstance(value, dict | Spread) else f"{TAG}list"),
]


def speeds_of(speeds: Spread | list[float]) -> list[float]:
    """As a list [m/s]."""
    if isinstance(speeds, Spread):
        return [float(v) for v in np.linspace(speeds.start, speeds.stop, speeds.count)]
    return speeds


class Winds(Section):
    """`type: constant` with `speeds`, `vertical_shear`, `horizontal_shear` (lists, every combination), or `type: turbulent` with
    `speeds: {start, stop, count}`, `intensity: [low, high]`, `shear_exponent: [low, high]`, `seed`: one wind per speed, the two drawn,
    over a rotor of 63 m with its hub at 90 m whatever the turbine, so that a shipped recipe gives the shipped corrector; `harmonics`:
    azimuthal ones of turbulence (default 1: mean and linear shears), or a list of numbers that the winds have in turn; `duration` [s]."""

    type: Literal["constant", "turbulent"] = "turbulent"
    speeds: Speeds
    intensity: Interval = (0.08, 0.18)
    shear_exponent: Interval = (0.0, 0.3)
    vertical_shear: list[float] = Field(default=[0.0])
    horizontal_shear: list[float] = Field(default=[0.0])
    seed: int = Field(default=0, ge=0)
    harmonics: Harmonics | Annotated[list[Harmonics], Field(min_length=1)] = 1
    duration: float = Field(default=120.0, ge=2, le=1e4)

    @property
    def speed_list(self) -> list[float]:
        return speeds_of(self.speeds)

    @property
    def harmonics_list(self) -> list[int]:
        """Numbers of azimuthal harmonics that the winds have in turn."""
        return self.harmonics if isinstance(self.harmonics, list) else [self.harmonics]

    def build(self) -> list[Any]:
        """The wind sources."""
        from fatigue_runner.wind import ConstantWind, TurbulentWind

        if self.type == "constant":
            return [
                ConstantWind(v, kv, kh)
                for v in self.speed_list for kv in self.vertical_shear for kh in self.horizontal_shear
            ]  # fmt: skip
        rng, harmonics = np.random.Generator(np.random.PCG64(self.seed)), self.harmonics_list
        return [
            TurbulentWind(
                v, intensity=float(rng.uniform(*self.intensity)), shear_exponent=float(rng.uniform(*self.shear_exponent)),
                seed=100_000 + 1000 * self.seed + number, duration=self.duration,
                rotor_radius=63.0, hub_height=90.0, harmonics=harmonics[number % len(harmonics)],
            )
            for number, v in enumerate(self.speed_list)
        ]  # fmt: skip


class GuardRecipe(Section):
    """Acceptance test of the hybrid, see `threshold.from_training_set`: norm (`max`, `rms`), kappa, quantile (1: the largest), rtol."""

    norm: Literal["max", "rms"] = "max"
    kappa: float = Field(default=2.0, ge=1)
    quantile: float = Field(default=0.999, gt=0, le=1)
    rtol: float = Field(default=0.0, ge=0)

    @property
    def threshold(self) -> dict[str, Any]:
        """Arguments of `threshold.from_training_set` and `threshold.limit_of`."""
        return {"norm": self.norm, "kappa": self.kappa, "quantile": self.quantile, "rtol": self.rtol}
