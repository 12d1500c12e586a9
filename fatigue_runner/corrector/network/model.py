"""Networks as PyTorch has them, and their layers as the artefact has them."""

from __future__ import annotations

import itertools

import numpy as np
import torch
from numpy.typing import NDArray

from fatigue_runner.corrector.network.settings import NetworkSettings

Array = NDArray[np.float64]


class _ISRU(torch.nn.Module):
    """x / sqrt(1 + x^2), as the lane kernel has it."""

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        return x * torch.rsqrt(1 + x * x)


def network(inputs: int, outputs: int, settings: NetworkSettings) -> torch.nn.Sequential:
    """Affine layers with the activation between them."""
    sizes = (inputs, *settings.hidden, outputs)
    parts: list[torch.nn.Module] = []
    for a, b in itertools.pairwise(sizes):
        parts += [torch.nn.Linear(a, b), torch.nn.ReLU() if settings.activation == "relu" else _ISRU()]
    return torch.nn.Sequential(*parts[:-1])


def layers_of(state: dict[str, torch.Tensor]) -> tuple[Array, ...]:
    """(outputs, 1 + inputs) matrices with the bias first, float64, of a `network`'s parameters."""
    numbers = sorted({int(name.split(".")[0]) for name in state})
    out = []
    for i in numbers:
        weight, bias = (state[f"{i}.{part}"].cpu().double().numpy() for part in ("weight", "bias"))
        out.append(np.concatenate([bias[:, None], weight], axis=1))
    return tuple(out)
