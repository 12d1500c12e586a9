"""What a network is trained on: scaled pairs of features and defects, and the scaling folded into its first and last layer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Pairs:
    """n samples of what a network sees and gives: inputs (n, k) without the leading 1, targets (n, m)."""

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
