"""Methods as the arrays that the compiled loops read: only the terms that are not zero, padded to passes of four."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.integrators.multistep import BACK, LinearMultistep
from fatigue_runner.integrators.tableaux import ButcherTableau

RING = 3
ERROR_TERMS = 8
Terms = list[tuple[int, float]]  # (row of k, weight)


def _padded(terms: Terms, width: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    # row 0 with weight 0 as padding: that row is always finite
    rows, weights = np.zeros(width, np.int64), np.zeros(width)
    for j, (row, weight) in enumerate(terms):
        rows[j], weights[j] = row, weight
    return rows, weights


def _width(count: int) -> int:
    return -(-count // 4) * 4


def _terms(weights: NDArray[np.float64]) -> Terms:
    """Stage 0 first, even with weight 0, since its row changes from step to step."""
    return [(0, float(weights[0]))] + [(RING - 1 + j, float(w)) for j, w in enumerate(weights) if j and w]


def _single(terms: Terms) -> tuple[Any, Any, int]:
    """rows, weights (1, width), count"""
    rows, weights = _padded(terms, _width(max(len(terms), 1)))
    return rows[None], weights[None], len(terms)


def stage_table(tableau: ButcherTableau) -> tuple[Any, Any, Any, Any]:
    """(rows, weights (stages, width), counts, c (stages,)) of the stages that are computed within the step."""
    a, _, _, c = tableau.arrays()
    computed = tableau.evaluations_per_step
    terms = [_terms(a[i, :i]) if i else [] for i in range(computed)]
    width = _width(max(len(t) for t in terms) or 1)
    padded = [_padded(t, width) for t in terms]
    rows, weights = np.array([r for r, _ in padded]), np.array([w for _, w in padded])
    return rows, weights, np.array([len(t) for t in terms]), c[:computed].copy()


def stage_rows(stages: int) -> NDArray[np.int64]:
    """Rows of the loops' slopes that hold the stages; the first one's is set anew in every step."""
    return np.array([0, *(RING - 1 + i for i in range(1, stages))], dtype=np.int64)


def runge_kutta_data(tableau: ButcherTableau) -> tuple[Any, ...]:
    """`method` of `loops.runge_kutta`: (stages, result, error), each rows, weights, count(s)."""
    _, b, e, _ = tableau.arrays()
    computed = tableau.evaluations_per_step
    error: Terms = []
    if np.any(e):
        # this step's first slope, the next one's (a shared last stage), the stages between
        error = [(0, e[0]), (0, e[-1] if tableau.first_same_as_last else 0.0)]
        error += [(RING - 1 + j, e[j]) for j in range(1, computed) if e[j]]
    if len(error) > ERROR_TERMS:
        raise ValueError(f"{tableau.name}: the loop adds up {ERROR_TERMS} error terms, not {len(error)}")
    return stage_table(tableau), _single(_terms(b[:computed])), _single(error)


def multistep_data(method: LinearMultistep) -> tuple[Any, ...]:
    """`method` of `loops.multistep`: the start, then rows and weights of predictor and corrector, and where history lies."""
    _, b, _, _ = method.start.arrays()
    oldest = RING - 1 + method.start.evaluations_per_step
    weights = np.array([[float(x) for x in w] for w in (method.predictor, method.corrector or [0] * BACK)])
    order = np.zeros((2, BACK), np.int64)
    correcting = method.corrector is not None
    return stage_table(method.start), _single(_terms(b)), (order, weights, correcting, oldest)


def slope_rows(method: ButcherTableau | LinearMultistep) -> int:
    """Rows of the loops' `k`."""
    if isinstance(method, ButcherTableau):
        return RING - 1 + method.evaluations_per_step
    return RING - 1 + method.start.evaluations_per_step + 2
