"""Family `mlp`: the network of arXiv:2504.05493, which sees the state and the wind as they are. The paper's experiment as data.

speeds        constant winds [m/s]: `train` and `validation`; the test winds stand in neither list
duration      of the trajectories [s] (default 20)
sampling      time between the samples of the training set [s]; every step where it is not given
perturbation  `copies` of the samples (default 0) moved off the trajectories by `size` (0.01) times each state's deviation
training      the fields of `network.settings`
guard         norm (default `rms`), kappa (1), quantile (1: the largest), rtol (0), margin: bounds, see `threshold.bounded`; default none

Defaults of all recipes that differ here: turbine `t2b1i1cg`, method `heun`, initial `paper-spinning`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, field_validator

from fatigue_runner.corrector.corrector import Corrector
from fatigue_runner.corrector.fit import relative_residual
from fatigue_runner.corrector.maps import RawNetwork
from fatigue_runner.corrector.network.pairs import Pairs
from fatigue_runner.corrector.network.settings import NetworkSettings
from fatigue_runner.corrector.recipe import Array, GuardRecipe, Learned, Progress, Recipe
from fatigue_runner.corrector.samples import Samples, accurate_runs, moves, single_steps, wind_pieces
from fatigue_runner.corrector.threshold import bounded, from_training_set
from fatigue_runner.inputs.section import Section, problem
from fatigue_runner.integrators.methods import SHARING

if TYPE_CHECKING:
    from fatigue_runner.trajectory import Trajectory
    from fatigue_runner.turbine import Turbine

TUNED = ("batch", "learning_rate", "smallest_rate", "scheduler", "factor", "patience")


class ConstantSpeeds(Section):
    """[m/s]"""

    train: list[float] = Field(min_length=1)
    validation: list[float] = Field(min_length=1)


class Perturbation(Section):
    """Copies of the samples moved off the trajectories; size in units of each state's deviation over the training set."""

    copies: int = Field(default=0, ge=0, le=100)
    size: float = Field(default=0.01, ge=0)


class BoundedGuard(GuardRecipe):
    """Acceptance test with bounds of the features."""

    norm: Literal["max", "rms"] = "rms"
    kappa: float = Field(default=1.0, ge=1)
    quantile: float = Field(default=1.0, gt=0, le=1)
    margin: float | None = Field(default=None, ge=0)


class MlpRecipe(Recipe):
    """See the module."""

    methods = RawNetwork.methods
    seed_key: ClassVar[tuple[str, ...]] = ("training", "seed")

    family: Literal["mlp"]
    turbine: str = "t2b1i1cg"
    method: str = "heun"
    speeds: ConstantSpeeds
    initial: str = "paper-spinning"
    duration: float = Field(default=20.0, gt=0)
    sampling: float | None = Field(default=None, gt=0)
    perturbation: Perturbation = Perturbation()
    training: NetworkSettings = NetworkSettings()
    guard: BoundedGuard = BoundedGuard()

    @field_validator("method")
    @classmethod
    def _cheap_fallback(cls, value: str) -> str:
        if value not in SHARING:
            raise problem(
                f"{value} shares its stages with no method of the next order; networks are trained for {', '.join(SHARING)}"
            )
        return value

    def sample_sets(self, turbine: Turbine) -> tuple[Samples, Samples]:
        """Training and validation samples; only the training ones are perturbed."""
        perturbed = self.perturbation.copies, self.perturbation.size
        return (
            self._samples(turbine, self.speeds.train, self.sampling, *perturbed),
            self._samples(turbine, self.speeds.validation, None, 0, 0.0),
        )

    def _samples(
        self, turbine: Turbine, speeds: list[float], sampling: float | None, copies: int, size: float
    ) -> Samples:
        winds = _winds(speeds)
        return along_trajectories(
            turbine,
            self.method,
            self.step,
            winds,
            self.starts(turbine, winds),
            self.duration,
            sampling,
            copies,
            size,
        )

    def pair_sets(self, turbine: Turbine, train: Samples, validation: Samples) -> tuple[Pairs, Pairs]:
        """What the network sees and gives, r / h^(p+1)."""
        size = self.bound_to(turbine).size
        seen, unseen = (Pairs(s.raw[:, 1:], s.defect / size) for s in (train, validation))
        return seen, unseen

    def train(self, turbine: Turbine, progress: Progress) -> Learned:
        """The checkpoint is removed when the training has ended by itself: another seed or setting would be refused by it."""
        from fatigue_runner.corrector.network.training import train_scaled

        progress.say("making the samples")
        train, validation = self.sample_sets(turbine)
        pairs = self.pair_sets(turbine, train, validation)
        layers, history = train_scaled(*pairs, self.training, progress.epoch, progress.checkpoint)
        if progress.checkpoint is not None and not history.stopped:
            progress.checkpoint.unlink(missing_ok=True)
        facts = {
            "samples": len(train.plain), "epochs": len(history.train), "best_epoch": history.best_epoch,
            "validation_loss": history.best, "training_loss": history.train[history.best_epoch - 1],
            "seconds": round(history.seconds, 1), "device": history.device, "seed": self.training.seed,
            "initial": self.initial, "duration": self.duration,
            "train_speeds": list(self.speeds.train), "validation_speeds": list(self.speeds.validation),
        }  # fmt: skip
        learned = RawNetwork(layers, self.training.activation, turbine.layout)
        guard = from_training_set(
            learned, self.bound_to(turbine), turbine, train, **self.guard.threshold, substeps=0
        )
        if self.guard.margin is not None:
            guard = bounded(guard, np.concatenate([train.raw, validation.raw]), self.guard.margin)
        return Learned(learned, guard, (min(self.speeds.train), max(self.speeds.train)), facts)

    def judged_under(self) -> tuple[list[Any], float]:
        return _winds(self.speeds.validation), self.duration

    def residual(
        self, corrector: Corrector, turbine: Turbine, winds: Sequence[Any], runs: Sequence[Trajectory]
    ) -> Array:
        """Along every step of the validation winds, as the training judges."""
        found = self._samples(turbine, self.speeds.validation, None, 0, 0.0)
        return relative_residual(corrector.predict(found), found.defect)

    def tune(
        self, turbine: Turbine, trials: int, epochs: int, storage: Path, told: Any = None
    ) -> tuple[dict[str, Any], bool]:
        """Settings for `training`, the recipe's own with the best trial's in them; and whether Ctrl-C ended the search."""
        from fatigue_runner.corrector.network.tuning import tune

        pairs = self.pair_sets(turbine, *self.sample_sets(turbine))
        tuned = tune(*pairs, self.training, trials, epochs, storage, told)
        own = self.training.model_dump(mode="json", exclude_unset=True)
        return own | {name: getattr(tuned.settings, name) for name in TUNED}, tuned.stopped


def _winds(speeds: list[float]) -> list[Any]:
    from fatigue_runner.wind import ConstantWind

    return [ConstantWind(speed) for speed in speeds]


def along_trajectories(
    turbine: Turbine,
    method: str,
    step: float,
    winds: Sequence[Any],
    initial: Array,
    duration: float,
    sampling: float | None = None,
    perturbed: int = 0,
    perturbation: float = 0.01,
    seed: int = 0,
) -> Samples:
    """Single steps of `method` from states along accurate trajectories, as arXiv 2504.05493 samples them.

    initial (n, states), one per wind; step, duration [s]; sampling: time between the states [s], a step by default.
    `perturbed`: how many more copies of them are moved off the trajectories, by a normal deviation of `perturbation` times
    each state's own over the set; the azimuths stay, the shaft's twist and its rate move as little as they do in operation.
    Raises InputError where an accurate trajectory diverges.
    """
    sampling = sampling or step
    runs = accurate_runs(turbine, winds, initial, duration, sampling, sampling)
    states = np.concatenate([run.state[:-1] for run in runs])
    pieces = np.concatenate(
        [wind_pieces(turbine, w, run.time[:-1], step) for w, run in zip(winds, runs, strict=True)]
    )
    sets = [states]
    rng, scale = np.random.Generator(np.random.PCG64(seed)), np.std(states, axis=0)
    sets += [states + moves(rng, states.shape, scale, perturbation, turbine) for _ in range(perturbed)]
    return single_steps(turbine, method, step, np.concatenate(sets), np.concatenate([pieces] * len(sets)))
