"""Piecewise cubics on uniform time cells: the one form in which wind reaches the kernels.

On cell i = min(int(t / cell_duration + 1e-9), n_cells - 1), with u = t - i * cell_duration [s], signal s is
((c[i, 3, s] u + c[i, 2, s]) u + c[i, 1, s]) u + c[i, 0, s]; coefficients have shape (n_cells, 4, n_signals).
"""

from __future__ import annotations

import math

import numpy as np

# A duration of n cells must not need cell n + 1, nor a time on a step fall before it, because of a rounded
# quotient (0.3 / 0.1 = 2.9999999999999996).
ROUNDING = 1e-9


def cell_count(duration: float, cell_duration: float) -> int:
    """Number of cells that cover `duration` [s]; at least one."""
    return max(1, math.ceil(duration / cell_duration - ROUNDING))


def evaluate(cell_duration: float, coefficients: np.ndarray, time: np.ndarray) -> np.ndarray:
    """Signals (n, n_signals) at `time` (n,) [s]; the last cell's cubic goes on beyond its end."""
    i = np.clip((time / cell_duration + ROUNDING).astype(np.int64), 0, len(coefficients) - 1)
    u = (time - i * cell_duration)[:, None]
    c = coefficients[i]
    return ((c[:, 3] * u + c[:, 2]) * u + c[:, 1]) * u + c[:, 0]


def minimum(cell_duration: float, cubics: np.ndarray) -> tuple[float, float]:
    """Least value of one signal's cubics (n_cells, 4), between the samples too, and the time [s] of it."""
    c0, c1, c2, c3 = cubics.T
    with np.errstate(all="ignore"):
        # The roots of the slope 3 c3 u^2 + 2 c2 u + c1, without cancellation.
        q = -(c2 + np.copysign(np.sqrt(c2 * c2 - 3 * c3 * c1), c2))
        inner = [q / (3 * c3), c1 / q]
    u = np.stack([np.zeros_like(c0), np.full_like(c0, cell_duration), *inner])
    u[~((u >= 0) & (u <= cell_duration))] = 0.0  # no root, or outside: the cell's start stands in
    values = ((c3 * u + c2) * u + c1) * u + c0
    candidate, cell = np.unravel_index(np.argmin(values), values.shape)
    return float(values[candidate, cell]), float(cell * cell_duration + u[candidate, cell])
