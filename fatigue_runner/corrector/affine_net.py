"""A small smooth network on what an affine map leaves of the defects: recipe keys `network` of the family `affine+net`.

network: `hidden` (default [24, 24]; multiples of 8 fill the kernel's blocks), `epochs` (150), `learning_rate` (3e-3, falls to 1/300 of it
by a cosine), `batch` (256), `seed` (0).

The layers see the same stage-aware rows, without factors. Those are nearly collinear (three winds in one step, stages that differ by h),
so they are whitened by the training set; the whitening is folded into the first layer, the units of the outputs into the last.
The network begins at zero, that is at the affine map, and the epoch that is best on the validation winds is kept.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, field_validator

from fatigue_runner.corrector.fit import KNEE

if TYPE_CHECKING:
    from fatigue_runner.corrector.artefact import Corrector
    from fatigue_runner.corrector.samples import Samples

Array = NDArray[np.float64]
Progress = Callable[[dict[str, float]], None]

FLOOR = (
    1e-4  # of the whitening: directions smaller than this share of the usual are noise, not stretched further
)
UNWATCHED = 0.1  # weight of the outputs that no error of a run comes from
LAST_RATE = 1 / 300


class NetworkRecipe(BaseModel):
    """How the network is made and trained; see the module."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
    hidden: list[int] = Field(default=[24, 24], min_length=1, max_length=4)
    epochs: int = Field(default=150, ge=1, le=100_000)
    learning_rate: float = Field(default=3e-3, gt=0, le=1)
    batch: int = Field(default=256, ge=1)
    seed: int = Field(default=0, ge=0)

    @field_validator("hidden")
    @classmethod
    def _sizes(cls, value: list[int]) -> list[int]:
        if not all(1 <= width <= 256 for width in value):
            raise ValueError(f"hidden layers have 1 to 256 units, got {value}")
        return value


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
    """(n,) loss of each step from what is left (n, 16) in units of the affine map's medians: of Cauchy's kind, so that the few
    steps that no smooth map can follow weigh as little as in `fit.robust`."""
    return (1.0 + (left * left * weights).sum(1) / KNEE**2).log() * KNEE**2


def add(
    corrector: Corrector,
    train: Samples,
    validation: Samples,
    settings: NetworkRecipe,
    watched: tuple[int, ...],
    progress: Progress | None = None,
) -> tuple[Corrector, dict[str, Any]]:
    """The affine `corrector` with layers on its residual, and what to say of their training.

    watched: the outputs that an error of a run comes from. progress: told epoch, epochs, train, validation, best, rate after every epoch.
    One thread, double precision: the same seed gives the same bits.
    """
    begin = time.perf_counter()
    x, y = ((s.features(corrector.kind)[:, 1:], s.defect - corrector.predict(s)) for s in (train, validation))
    unit = np.median(np.abs(x[1]), axis=0)
    unit[unit == 0] = 1.0
    whitening = Whitening.of(x[0])
    weights = np.full(16, UNWATCHED)
    weights[list(watched)] = 1.0
    layers, history = _train(
        (whitening(x[0]), x[1] / unit), (whitening(y[0]), y[1] / unit), settings, weights / weights.sum(), progress
    )  # fmt: skip
    size = corrector.step ** (corrector.order + 1)
    layers[0] = whitening.folded(layers[0])
    layers[-1] = layers[-1] * (unit / size)[:, None]
    best = int(np.argmin(history))
    made = {
        "network_epochs": settings.epochs, "network_best_epoch": best, "network_seed": settings.seed,
        "network_loss": f"{history[0]:.3g} -> {history[best]:.3g}", "network_seconds": round(time.perf_counter() - begin, 1),
    }  # fmt: skip
    return replace(corrector, layers=tuple(layers), activation="isru"), made


def _train(
    train: tuple[Array, Array],
    validation: tuple[Array, Array],
    settings: NetworkRecipe,
    weights: Array,
    progress: Progress | None,
) -> tuple[list[Array], list[float]]:
    """Layers (outputs, 1 + inputs) of the best epoch, and the validation loss of the affine map and after every epoch."""
    import torch

    from fatigue_runner.corrector.training import MlpSettings, layers_of, network

    with _reproducible(settings.seed):
        x, y, xv, yv, by = (torch.from_numpy(np.ascontiguousarray(a)) for a in (*train, *validation, weights))
        plain = MlpSettings(hidden=tuple(settings.hidden), activation="isru")
        model = network(x.shape[1], 16, plain).double()
        for parameter in model[-1].parameters():
            torch.nn.init.zeros_(parameter)
        optimizer = torch.optim.AdamW(model.parameters(), settings.learning_rate, weight_decay=1e-4)
        rates = torch.optim.lr_scheduler.CosineAnnealingLR(
            optimizer, settings.epochs, eta_min=settings.learning_rate * LAST_RATE
        )
        history = [float(loss(yv, by).mean())]
        kept = layers_of(model.state_dict())
        for epoch in range(1, settings.epochs + 1):
            total, rate = 0.0, float(rates.get_last_lr()[0])
            for pick in torch.randperm(len(x)).split(settings.batch):
                optimizer.zero_grad()
                value = loss(y[pick] - model(x[pick]), by).mean()
                value.backward()
                optimizer.step()
                total += float(value.detach()) * len(pick)
            rates.step()
            with torch.no_grad():
                judged = float(loss(yv - model(xv), by).mean())
            if judged < min(history):
                kept = layers_of(model.state_dict())
            history.append(judged)
            if progress is not None:
                progress({
                    "epoch": epoch, "epochs": settings.epochs, "train": total / len(x), "validation": judged,
                    "best": min(history), "rate": rate,
                })  # fmt: skip
    return list(kept), history


@contextmanager
def _reproducible(seed: int) -> Iterator[None]:
    """The seed's random numbers and one thread inside, the caller's own outside."""
    import torch

    threads = torch.get_num_threads()
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        torch.set_num_threads(1)
        try:
            yield
        finally:
            torch.set_num_threads(threads)
