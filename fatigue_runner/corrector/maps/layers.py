"""Dense layers with an activation between them, (outputs, 1 + inputs) with the bias first: numpy's and the compiled loop's form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.corrector.errors import CorrectorError

Array = NDArray[np.float64]
Layers = tuple[Array, ...]

ACTIVATIONS = ("identity", "relu", "isru")
MOST_UNITS = 500  # of a hidden layer: room of the compiled loop


def apply(layers: Sequence[Array], inputs: Array, activation: str = "relu") -> Array:
    """(n, outputs) of inputs (n, k)."""
    value = inputs
    for number, layer in enumerate(layers):
        value = layer[:, 0] + value @ layer[:, 1:].T
        if number < len(layers) - 1:
            value = np.maximum(value, 0) if activation == "relu" else value / np.sqrt(1 + value**2)
    return value


def check(layers: Layers, inputs: int, outputs: int, activation: str) -> None:
    """Raises CorrectorError unless the layers lead from `inputs` to `outputs` values."""
    if activation not in ACTIVATIONS:
        raise CorrectorError(f"activation {activation!r} does not exist; known: {', '.join(ACTIVATIONS)}")
    width = inputs
    for number, layer in enumerate(layers, start=1):
        if layer.ndim != 2 or layer.shape[1] != width + 1 or layer.shape[0] > MOST_UNITS:
            raise CorrectorError(f"layer {number} has shape {layer.shape}, it needs {width + 1} inputs")
        width = layer.shape[0]
    if layers and width != outputs:
        raise CorrectorError(f"the last layer has {width} outputs instead of {outputs}")


def packed(layers: Layers, activation: str, size: float) -> tuple[Array, NDArray[np.int64], int]:
    """`net`, `sizes` and `activation` of `integrators.protocol.StageMapData`; size: what the outputs are multiplied with."""
    from fatigue_runner.integrators.correction import IDENTITY, ISRU, RELU
    from fatigue_runner.integrators.dense import pack

    parts, sizes = [], [0]
    for number, layer in enumerate(layers):
        # rows of ones: first among the features, last among hidden values
        weights = layer if number == 0 else np.concatenate([layer[:, 1:], layer[:, :1]], axis=1)
        parts.append(pack(weights * size if number == len(layers) - 1 else weights)[0])
        sizes.append(layer.shape[0])
    net = np.concatenate(parts) if parts else np.zeros(0)
    return net, np.array(sizes), {"identity": IDENTITY, "relu": RELU, "isru": ISRU}[activation]


def tensors(layers: Layers) -> dict[str, Array]:
    """Their names in an artefact."""
    return {f"layer{i}": weights for i, weights in enumerate(layers)}


def read(count: int, found: Mapping[str, Array]) -> Layers:
    """`count` layers of an artefact's arrays. Raises KeyError for a missing one."""
    return tuple(found[f"layer{i}"] for i in range(count))
