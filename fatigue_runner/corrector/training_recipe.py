"""From the recipe of a network to the corrector: the paper's experiment as data, from winds to the guarded artefact."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from fatigue_runner.corrector import features
from fatigue_runner.corrector.artefact import Corrector, Guard
from fatigue_runner.corrector.samples import Samples
from fatigue_runner.corrector.training_data import Pairs, along_trajectories, pairs
from fatigue_runner.errors import InputError, did_you_mean

if TYPE_CHECKING:
    from fatigue_runner.corrector.training import MlpSettings, Progress
    from fatigue_runner.corrector.tuning import Tuned
    from fatigue_runner.turbine import Turbine

Array = NDArray[np.float64]
# state (16,) at t = 0 from turbine, name of the initial state and wind: `integrators.initial.initial_state`
InitialState = Callable[[Any, str, Any], Array]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Speeds(_Part):
    """Constant winds [m/s]. The test winds stand in neither list."""

    train: list[float] = Field(min_length=1)
    validation: list[float] = Field(min_length=1)


class Perturbation(_Part):
    """Copies of the samples moved off the trajectories; size in units of each state's deviation over the training set."""

    copies: int = Field(default=0, ge=0, le=100)
    size: float = Field(default=0.01, ge=0)


class GuardRecipe(_Part):
    """Acceptance test of the hybrid, see `guard.from_training_set`; `margin`: see `guard.bounded`, no bounds where it is not given."""

    norm: Literal["max", "rms"] = "rms"
    kappa: float = Field(default=1.0, ge=1)
    quantile: float = Field(default=1.0, gt=0, le=1)
    rtol: float = Field(default=0.0, ge=0)
    margin: float | None = Field(default=None, ge=0)


class MlpRecipe(_Part):
    """What makes a network of family `mlp`; steps and durations in s. `training`: the fields of `training.MlpSettings`."""

    name: str
    family: Literal["mlp"] = "mlp"
    description: str = ""
    turbine: str = "t2b1i1cg"
    method: str = "heun"
    step: float = Field(gt=0)
    speeds: Speeds
    initial: Literal["operating-point", "paper", "paper-spinning"] = "paper-spinning"
    duration: float = Field(default=20.0, gt=0)
    sampling: float | None = Field(
        default=None, gt=0
    )  # s, of the training set; every step where it is not given
    perturbation: Perturbation = Perturbation()
    training: dict[str, Any] = {}
    guard: GuardRecipe = GuardRecipe()

    @field_validator("training")
    @classmethod
    def _known(cls, value: dict[str, Any]) -> dict[str, Any]:
        from fatigue_runner.corrector.training import MlpSettings

        known = list(MlpSettings.__dataclass_fields__)
        for key in value:
            if key not in known:
                raise ValueError(f"unknown setting {key!r}{did_you_mean(key, known)}")
        return value

    def settings(self) -> MlpSettings:
        from fatigue_runner.corrector.training import MlpSettings

        values: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in self.training.items()}
        return MlpSettings(**values)


def parse_recipe(data: Mapping[str, Any], place: str = "recipe") -> MlpRecipe:
    """The recipe in a mapping. Raises InputError with the place and the key of the first mistake."""
    try:
        return MlpRecipe.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(k) for k in first["loc"])
        extra = (
            did_you_mean(str(first["loc"][-1]), _keys_beside(first["loc"]))
            if first["type"] == "extra_forbidden"
            else ""
        )
        raise InputError(f"{place}: {key}: {first['msg']}{extra}") from None


def _keys_beside(location: tuple[int | str, ...]) -> list[str]:
    parts: dict[str, type[_Part]] = {"speeds": Speeds, "perturbation": Perturbation, "guard": GuardRecipe}
    return list(
        parts.get(str(location[0]), MlpRecipe).model_fields if len(location) > 1 else MlpRecipe.model_fields
    )


def read_recipe(path: Path) -> MlpRecipe:
    """The recipe in a YAML file. Raises InputError for one that cannot be read or has a mistake."""
    from ruamel.yaml import YAML, YAMLError

    try:
        data = YAML(typ="safe").load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, YAMLError) as error:
        raise InputError(f"{path} cannot be read: {' '.join(str(error).split())}") from None
    if not isinstance(data, dict):
        raise InputError(f"{path} holds no recipe: it must be a mapping with name, method, step and speeds")
    return parse_recipe(data, str(path))


def sample_sets(recipe: MlpRecipe, turbine: Turbine, initial_state: InitialState) -> tuple[Samples, Samples]:
    """Training and validation samples of a recipe; only the training ones are perturbed."""
    found = []
    for speeds, sampling, more in (
        (recipe.speeds.train, recipe.sampling, recipe.perturbation.copies),
        (recipe.speeds.validation, None, 0),
    ):
        winds, start = _starts(recipe, turbine, initial_state, speeds)
        size = recipe.perturbation.size
        found.append(
            along_trajectories(
                turbine, recipe.method, recipe.step, winds, start, recipe.duration, sampling, more, size
            )
        )
    return found[0], found[1]


def _starts(
    recipe: MlpRecipe, turbine: Turbine, initial_state: InitialState, speeds: list[float]
) -> tuple[list[Any], Array]:
    """Winds and their initial states (n, 16)."""
    from fatigue_runner.wind import ConstantWind

    winds = [ConstantWind(speed) for speed in speeds]
    return winds, np.array([initial_state(turbine, recipe.initial, wind) for wind in winds])


def pair_sets(recipe: MlpRecipe, train: Samples, validation: Samples) -> tuple[Pairs, Pairs]:
    return pairs(train, recipe.method, recipe.step), pairs(validation, recipe.method, recipe.step)


def train_recipe(
    recipe: MlpRecipe,
    turbine: Turbine,
    initial_state: InitialState,
    progress: Progress | None = None,
    checkpoint: Path | None = None,
    text: str = "",
) -> tuple[Corrector, Any]:
    """The corrector that a recipe makes, guarded, and the training's history; `text`: the recipe's file, kept in the artefact.

    `checkpoint` is removed when the training has ended by itself: another seed or setting would be refused by it.
    """
    from fatigue_runner.corrector.training import train_mlp

    train, validation = sample_sets(recipe, turbine, initial_state)
    settings = recipe.settings()
    layers, history = train_mlp(*pair_sets(recipe, train, validation), settings, progress, checkpoint)
    if checkpoint is not None and not history.stopped:
        checkpoint.unlink(missing_ok=True)
    made = {
        "samples": len(train.plain), "epochs": len(history.train), "best_epoch": history.best_epoch,
        "validation_loss": history.best, "training_loss": history.train[history.best_epoch - 1],
        "seconds": round(history.seconds, 1), "device": history.device, "seed": settings.seed,
        "initial": recipe.initial, "duration": recipe.duration,
        "train_speeds": list(recipe.speeds.train), "validation_speeds": list(recipe.speeds.validation),
    }  # fmt: skip
    return guarded(recipe, turbine, initial_state, layers, train, validation, made, text), history


def tune_recipe(
    recipe: MlpRecipe,
    turbine: Turbine,
    initial_state: InitialState,
    trials: int,
    epochs: int,
    storage: Path,
    progress: Callable[..., None] | None = None,
) -> Tuned:
    """`tuning.tune` with the samples of a recipe: `.settings` are to be written into its `training`."""
    from fatigue_runner.corrector.tuning import tune

    train, validation = pair_sets(recipe, *sample_sets(recipe, turbine, initial_state))
    return tune(train, validation, recipe.settings(), trials, epochs, storage, progress)


def tune_file(
    path: Path,
    storage: Path,
    initial_state: InitialState,
    trials: int,
    epochs: int,
    overrides: Mapping[str, Any],
    progress: Callable[..., None] | None = None,
) -> tuple[dict[str, Any], bool]:
    """Settings for `training` of the recipe file, its own with the best trial's in them; and whether Ctrl-C ended the search.

    Raises InputError for a recipe that is not of a network.
    """
    from fatigue_runner.corrector.recipes import read
    from fatigue_runner.turbine import load_turbine

    family, data, _ = read(path)
    if family != "mlp":
        raise InputError(f"{path}: a corrector of family {family!r} has nothing to tune; its fit is exact")
    changed = {k: v for k, v in overrides.items() if v is not None}
    own = dict(data.get("training") or {})
    if "seed" in changed:
        own["seed"] = changed.pop("seed")
    recipe = parse_recipe({**data, **changed, "training": own}, str(path))
    tuned = tune_recipe(
        recipe, load_turbine(recipe.turbine), initial_state, trials, epochs, storage, progress
    )
    chosen = ("batch", "learning_rate", "smallest_rate", "scheduler", "factor", "patience")
    return own | {name: getattr(tuned.settings, name) for name in chosen}, tuned.stopped


def guarded(
    recipe: MlpRecipe,
    turbine: Turbine,
    initial_state: InitialState,
    layers: tuple[Array, ...],
    train: Samples,
    validation: Samples,
    made: Mapping[str, Any],
    text: str = "",
) -> Corrector:
    """Corrector of trained layers: threshold from the training set, bounds from it and the validation winds, figures from those."""
    from fatigue_runner.corrector.guard import bounded, from_training_set
    from fatigue_runner.integrators.correcting import SHARING

    if recipe.method not in SHARING:
        raise InputError(
            f"{recipe.method} shares its stages with no method of the next order; networks are trained for heun"
        )
    g = recipe.guard
    open_guard = Guard(0.0, g.norm, g.kappa, g.quantile, (1.0,) * 16, (0.0,) * 16)
    corrector = Corrector(
        name=recipe.name, family=recipe.family, method=recipe.method, step=recipe.step,
        turbine=turbine.name, turbine_hash=turbine.hash, kind=features.RAW, factors=(), linear=None, layers=layers,
        activation=recipe.settings().activation, guard=open_guard,
        wind_range=(min(recipe.speeds.train), max(recipe.speeds.train)), training=dict(made), recipe=text,
    )  # fmt: skip
    guard = from_training_set(corrector, turbine, train, g.norm, g.kappa, g.quantile, g.rtol, 0)
    if g.margin is not None:
        seen = [samples.features(corrector.kind) for samples in (train, validation)]
        guard = bounded(guard, np.concatenate(seen), g.margin)
    corrector = replace(corrector, guard=guard)
    return replace(corrector, validation=_judged(recipe, turbine, initial_state, corrector, validation))


def _judged(
    recipe: MlpRecipe,
    turbine: Turbine,
    initial_state: InitialState,
    corrector: Corrector,
    validation: Samples,
) -> dict[str, float]:
    """Figures on the validation winds, named as `affine.validate` names them."""
    from fatigue_runner.channels import STATE_NAMES
    from fatigue_runner.corrector.affine import rollout_errors
    from fatigue_runner.corrector.fit import relative_residual
    from fatigue_runner.corrector.samples import references

    winds, start = _starts(recipe, turbine, initial_state, recipe.speeds.validation)
    runs = references(turbine, winds, start, recipe.duration, recipe.step)
    out: dict[str, float] = {}
    for mode in ("plain", "enhanced", "hybrid"):
        errors, accepted = rollout_errors(
            turbine, corrector, None if mode == "plain" else mode, winds, start, recipe.duration, runs
        )
        out |= {f"nrmse_{mode}": float(np.median(errors)), f"nrmse_{mode}_worst": float(errors.max())}
    out["acceptance"] = accepted
    left = relative_residual(corrector.predict(validation), validation.defect)
    out |= {f"residual_{name}": float(value) for name, value in zip(STATE_NAMES, left, strict=True)}
    return {name: value for name, value in out.items() if np.isfinite(value)}
