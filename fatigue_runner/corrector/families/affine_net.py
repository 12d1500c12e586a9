"""Family `affine+net`: the map of family `affine` and a small smooth network on what it leaves of the defects.

Keys beside those of `affine`:
network   hidden (default [24, 24]; multiples of 8 fill the kernel's blocks), epochs (150), learning_rate (3e-3, falls to 1/300 of it
          by a cosine), batch (256), seed (0)

The layers see the same stage-aware rows, without factors. Those are nearly collinear (three winds in one step, stages that differ by h),
so they are whitened by the training set; the whitening is folded into the first layer, the units of the outputs into the last.
The network begins at zero, that is at the affine map, and the epoch that is best on the validation winds is kept. One thread, double
precision: the same seed gives the same bits.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from pydantic import Field, field_validator

from fatigue_runner.corrector.families.affine import AffineRecipe
from fatigue_runner.corrector.features import drive
from fatigue_runner.corrector.fit import KNEE
from fatigue_runner.corrector.maps import StageMap
from fatigue_runner.corrector.network.pairs import Pairs
from fatigue_runner.corrector.network.settings import Hidden, NetworkSettings
from fatigue_runner.corrector.recipe import Array, Learned, Progress
from fatigue_runner.corrector.samples import Samples
from fatigue_runner.inputs.section import Section, problem

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine

# of the whitening: directions smaller than this share of the usual are noise, not stretched further
FLOOR = 1e-4
UNWATCHED = 0.1  # weight of the outputs that no error of a run comes from
LAST_RATE = 1 / 300
WEIGHT_DECAY = 1e-4


class NetworkRecipe(Section):
    """How the network is made and trained; see the module."""

    hidden: Hidden = Field(default=(24, 24), min_length=1, max_length=4)
    epochs: int = Field(default=150, ge=1, le=100_000)
    learning_rate: float = Field(default=3e-3, gt=0, le=1)
    batch: int = Field(default=256, ge=1)
    seed: int = Field(default=0, ge=0)

    @property
    def settings(self) -> NetworkSettings:
        return NetworkSettings(
            **self.model_dump(), activation="isru", scheduler="cosine", smallest_rate=self.learning_rate * LAST_RATE,
            weight_decay=WEIGHT_DECAY, precision="float64", threads=1,
        )  # fmt: skip


class AffineNetRecipe(AffineRecipe):
    """See the module."""

    methods = StageMap.methods

    family: Literal["affine+net"]  # type: ignore[assignment]  # another name of the same kind
    network: NetworkRecipe

    @field_validator("loss")
    @classmethod
    def _of_single_steps(cls, value: str) -> str:
        if value != "defect":
            raise problem(
                f"family affine+net knows `defect` alone, since its network learns what is left of single steps; got {value!r}; "
                "leave it out, or use family affine"
            )
        return value

    def train(self, turbine: Turbine, progress: Progress) -> Learned:
        made = self.fitted(turbine, progress)
        progress.say("the network's validation steps")
        unseen = self.validation.build()
        judged = self.sampled(turbine, unseen, self.validation.duration, self.judging_seed)
        size = self.bound_to(turbine).size
        learned, facts = add(
            made.map, size, made.samples, judged, self.network, drive(turbine.layout), progress
        )
        return self.guarded(turbine, replace(made, map=learned, facts=made.facts | facts), progress)


@dataclass(frozen=True)
class Whitening:
    """z = (x - mean) @ map: unit size in every direction that the rows move in; map (k, k)."""

    mean: Array
    map: Array

    @classmethod
    def of(cls, rows: Array) -> Whitening:
        """From rows (n, k); a row that never changes is left out."""
        mean, spread = rows.mean(axis=0), rows.std(axis=0)
        still = spread <= 1e-12 * (1e-12 + np.abs(mean))
        inverse = np.where(still, 0.0, 1.0 / np.where(still, 1.0, spread))
        values, vectors = np.linalg.eigh(np.cov(((rows - mean) * inverse).T))
        stretch = 1.0 / np.maximum(np.sqrt(np.maximum(values, 0.0)), FLOOR)
        return cls(mean, inverse[:, None] * vectors * stretch)

    def __call__(self, rows: Array) -> Array:
        return (rows - self.mean) @ self.map

    def folded(self, layer: Array) -> Array:
        """The layer (outputs, 1 + k) on whitened rows as one on plain rows."""
        weights = layer[:, 1:] @ self.map.T
        return np.concatenate([(layer[:, 0] - weights @ self.mean)[:, None], weights], axis=1)


def loss(left: Any, weights: Any) -> Any:
    """(n,) loss of each step from what is left (n, states) in units of the affine map's medians: of Cauchy's kind, so that the few
    steps that no smooth map can follow weigh as little as in `fit.robust`."""
    return (1.0 + (left * left * weights).sum(1) / KNEE**2).log() * KNEE**2


def add(
    learned: StageMap,
    size: float,
    train: Samples,
    validation: Samples,
    recipe: NetworkRecipe,
    watched: tuple[int, ...],
    progress: Progress | None = None,
) -> tuple[StageMap, dict[str, Any]]:
    """The affine map with layers on its residual, and what to say of their training; size: h^(p+1).

    watched: the outputs that an error of a run comes from.
    """
    import torch

    from fatigue_runner.corrector.network.training import Problem
    from fatigue_runner.corrector.network.training import train as train_network

    progress = progress or Progress()
    progress.say("the network")
    rows, left = train.rows[:, 1:], train.defect - learned.predict(train, size)
    unit = np.median(np.abs(left), axis=0)
    unit[unit == 0] = 1.0
    whitening = Whitening.of(rows)
    weights = np.full(len(unit), UNWATCHED)
    weights[list(watched)] = 1.0
    share = torch.from_numpy(weights / weights.sum())
    unseen = Pairs(
        whitening(validation.rows[:, 1:]), (validation.defect - learned.predict(validation, size)) / unit
    )
    problem = Problem(
        Pairs(whitening(rows), left / unit), unseen,
        lambda result, target: loss(target - result, share.to(target.device)).mean(), from_zero=True,
    )  # fmt: skip
    layers, history = train_network(problem, recipe.settings, progress.epoch, progress.checkpoint)
    plain = [whitening.folded(layers[0]), *layers[1:]]
    plain[-1] = plain[-1] * (unit / size)[:, None]
    facts = {
        "network_epochs": len(history.train), "network_best_epoch": history.best_epoch, "network_seed": recipe.seed,
        "network_loss": f"{history.start:.3g} -> {history.best:.3g}", "network_seconds": round(history.seconds, 1),
    }  # fmt: skip
    if progress.checkpoint is not None and not history.stopped:
        progress.checkpoint.unlink(missing_ok=True)
    return replace(learned, layers=tuple(plain), activation="isru"), facts
