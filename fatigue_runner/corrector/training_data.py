"""What a network is trained on: scaled pairs of features and defects, and the scaling folded into its first and last layer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.corrector import features
from fatigue_runner.corrector.samples import ACCURATE, Samples, single_steps, tableau, wind_pieces
from fatigue_runner.errors import InputError

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Pairs:
    """n samples of what a network sees and gives: inputs (n, k) without the leading 1, targets (n, 16) = r / h^(p+1)."""

    inputs: Array
    targets: Array

    def __post_init__(self) -> None:
        if len(self.inputs) != len(self.targets) or len(self.inputs) == 0:
            raise InputError(
                f"training needs as many inputs as targets, got {len(self.inputs)} and {len(self.targets)}"
            )
        if not (np.isfinite(self.inputs).all() and np.isfinite(self.targets).all()):
            raise InputError(
                "training samples hold values that are not finite; leave the diverging wind out of the recipe"
            )


def pairs(
    samples: Samples, method: str, step: float, kind: str = features.RAW, linear: Array | None = None
) -> Pairs:
    """Pairs of `samples` for a network of features `kind`; with `linear` (16, k), for what that map leaves of r / h^(p+1)."""
    seen = samples.features(kind)
    target = samples.defect / step ** (tableau(method).order + 1)
    if linear is not None:
        target = target - seen @ linear.T
    return Pairs(seen[:, 1:], target)


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

    initial (n, 16), one per wind; step, duration [s]; sampling: time between the states [s], a step by default.
    `perturbed`: how many more copies of them are moved off the trajectories, by a normal deviation of `perturbation` times
    each state's own over the set; the azimuths stay, the shaft's twist and its rate move as little as they do in operation.
    Raises InputError where an accurate trajectory diverges.
    """
    from fatigue_runner.corrector.samples import _move
    from fatigue_runner.integrators import simulate_block

    sampling = sampling or step
    runs = simulate_block(turbine, ACCURATE, sampling, winds, initial, duration, sampling)
    for wind, run in zip(winds, runs, strict=True):
        if run.diverged_at is not None:
            raise InputError(
                f"training wind {wind.label}: the reference diverged at {run.diverged_at:g} s; leave this wind out of the recipe"
            )
    states = np.concatenate([run.state[:-1] for run in runs])
    pieces = np.concatenate([wind_pieces(w, run.time[:-1], step) for w, run in zip(winds, runs, strict=True)])
    sets = [states]
    rng, scale = np.random.Generator(np.random.PCG64(seed)), np.std(states, axis=0)
    for _ in range(perturbed):
        sets.append(states + _move(rng, states.shape, scale, perturbation, turbine.parameters["g_ratio"]))
    return single_steps(turbine, method, step, np.concatenate(sets), np.concatenate([pieces] * len(sets)))


@dataclass(frozen=True)
class Scaling:
    """Maps each column's range in the training set to [-1, 1]: scaled = (value - centre) / half; both (k,)."""

    centre: Array
    half: Array

    @classmethod
    def fitted(cls, values: Array) -> Scaling:
        """Min-max scaling of values (n, k). A constant column is centred and left in its unit: it has no range."""
        low, high = values.min(axis=0), values.max(axis=0)
        half = (high - low) / 2
        half[half <= 1e-12 * np.abs(high)] = 1.0
        return cls((high + low) / 2, half)

    def scale(self, values: Array) -> Array:
        return (values - self.centre) / self.half


def fold(layers: Sequence[Array], inputs: Scaling, outputs: Scaling) -> tuple[Array, ...]:
    """Layers (outputs, 1 + inputs), bias first, that act on scaled values -> layers that take and give plain ones.

    The scaling is affine, as are the first and the last layer, so it disappears in them without changing the network.
    """
    plain = [np.array(layer, dtype=np.float64) for layer in layers]
    first = plain[0]
    first[:, 1:] /= inputs.half
    first[:, 0] -= first[:, 1:] @ inputs.centre
    last = plain[-1]
    last *= outputs.half[:, None]
    last[:, 0] += outputs.centre
    return tuple(plain)


def apply(layers: Sequence[Array], inputs: Array, activation: str = "relu") -> Array:
    """Network of (outputs, 1 + inputs) layers on inputs (n, k) -> (n, outputs), as `artefact.Corrector.predict`."""
    value = inputs
    for number, layer in enumerate(layers):
        value = layer[:, 0] + value @ layer[:, 1:].T
        if number < len(layers) - 1:
            value = np.maximum(value, 0) if activation == "relu" else value / np.sqrt(1 + value**2)
    return value
