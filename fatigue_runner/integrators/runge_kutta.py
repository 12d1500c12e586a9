"""Explicit Runge-Kutta methods, compiled: the arrays that a step reads of a Butcher tableau, and the step."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.compiled import INLINE, njit
from fatigue_runner.integrators.choice import compiled_for
from fatigue_runner.integrators.signals import signals_at
from fatigue_runner.integrators.stepper import RING, advance, begin, finish, note, recover
from fatigue_runner.integrators.stepping import combine, combine_new, largest_error, scaled_error
from fatigue_runner.turbine.model import rhs, width

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

ERROR_TERMS = 8


class Tableau(Protocol):
    """What is read here of a `butcher.ButcherTableau`."""

    @property
    def name(self) -> str: ...
    @property
    def evaluations_per_step(self) -> int: ...
    @property
    def first_same_as_last(self) -> bool: ...

    def arrays(self) -> tuple[Array, Array, Array, Array]:
        """A, b, error weights b - b_hat, c."""
        ...


# --- what the compiled step reads: only the terms that are not zero, padded to passes of four ---


class Stages(NamedTuple):
    """The stages that are computed within the step: rows of k and weights (stages, terms), counts and times c [steps] (stages,)."""

    rows: Rows
    weights: Array
    counts: Rows
    c: Array


class Sum(NamedTuple):
    """A weighted sum of slopes: rows of k and weights (1, terms)."""

    rows: Rows
    weights: Array
    terms: int


class RungeKuttaArrays(NamedTuple):
    stages: Stages
    result: Sum
    error: Sum


Terms = list[tuple[int, float]]  # (row of k, weight)


def _padded(terms: Terms, width: int) -> tuple[Rows, Array]:
    # row 0 with weight 0 as padding: that row is always finite
    rows, weights = np.zeros(width, np.int64), np.zeros(width)
    for j, (row, weight) in enumerate(terms):
        rows[j], weights[j] = row, weight
    return rows, weights


def _passes(count: int) -> int:
    return -(-count // 4) * 4


def _terms(weights: Array) -> Terms:
    """Stage 0 first, even with weight 0, since its row changes from step to step."""
    return [(0, float(weights[0]))] + [(RING - 1 + j, float(w)) for j, w in enumerate(weights) if j and w]


def _single(terms: Terms) -> Sum:
    rows, weights = _padded(terms, _passes(max(len(terms), 1)))
    return Sum(rows[None], weights[None], len(terms))


def stages_of(tableau: Tableau) -> Stages:
    """The stages but those that are the next step's."""
    a, _, _, c = tableau.arrays()
    computed = tableau.evaluations_per_step
    terms = [_terms(a[i, :i]) if i else [] for i in range(computed)]
    wide = _passes(max(len(t) for t in terms) or 1)
    padded = [_padded(t, wide) for t in terms]
    rows, weights = np.array([r for r, _ in padded]), np.array([w for _, w in padded])
    return Stages(rows, weights, np.array([len(t) for t in terms]), c[:computed].copy())


def result_of(tableau: Tableau) -> Sum:
    """The step's result."""
    return _single(_terms(tableau.arrays()[1][: tableau.evaluations_per_step]))


def stage_rows(stages: int) -> Rows:
    """Rows of k that hold the stages; the first one's is set anew in every step."""
    return np.array([0, *(RING - 1 + i for i in range(1, stages))], dtype=np.int64)


def runge_kutta_arrays(tableau: Tableau) -> RungeKuttaArrays:
    """A copy of its own for each run: the step writes rows of the current slope into these tables."""
    _, _, e, _ = tableau.arrays()
    error: Terms = []
    if np.any(e):
        # this step's first slope, the next one's (a shared last stage), the stages between
        error = [(0, e[0]), (0, e[-1] if tableau.first_same_as_last else 0.0)]
        error += [(RING - 1 + j, e[j]) for j in range(1, tableau.evaluations_per_step) if e[j]]
    if len(error) > ERROR_TERMS:
        raise ValueError(f"{tableau.name}: the step adds up {ERROR_TERMS} error terms, not {len(error)}")
    return RungeKuttaArrays(stages_of(tableau), result_of(tableau), _single(error))


def slope_rows(tableau: Tableau) -> int:
    """Rows of k; one more for the last stage of a fallback of the next order."""
    return RING + tableau.evaluations_per_step


# --- the step ---


@njit(**INLINE)
def stages_of_step(model, stages, n, h, now, states, k, signals, data, stage):
    """Slopes of one step's stages but the first, which stands in k[now]; returns the last stage's time in steps."""
    at, slopes = 0.0, k.reshape(k.size)
    for i in range(1, len(stages.c)):
        stages.rows[i, 0] = now  # stage 0 is the first term everywhere, its row changes from step to step
        combine(model, states, now, k, stages.rows, stages.weights, i, stages.counts[i], h, stage)
        if signals.changing and stages.c[i] != at:
            at = stages.c[i]
            signals_at(model, (n + at) * h, signals)
        rhs(model, stage, signals.p, signals.u, slopes, (RING - 1 + i) * width(model), data)
    return at


@njit(**INLINE)
def result_of_step(model, result, h, now, new, ring):
    """ring.current and ring.states[new] = the step's result; returns whether it is within the bounds."""
    result.rows[0, 0] = now
    return combine_new(
        model, ring.states, now, new, ring.k, result.rows, result.weights, 0, result.terms, h, ring.current
    )


@compiled_for(begin, RungeKuttaArrays)
@njit(**INLINE)
def first_slope(method, model, h, signals, data, ring):
    """k[0] = slope at the start."""
    rhs(model, ring.restart, signals.p, signals.u, ring.k.reshape(ring.k.size), 0, data)


@compiled_for(advance, RungeKuttaArrays)
@njit(**INLINE)
def _advance(method, model, n, h, now, new, signals, data, ring):
    stages_of_step(model, method.stages, n, h, now, ring.states, ring.k, signals, data, ring.current)
    return result_of_step(model, method.result, h, now, new, ring)


@compiled_for(recover, RungeKuttaArrays)
@njit(**INLINE)
def nothing_to_forget(method):
    pass


@compiled_for(finish, RungeKuttaArrays)
@njit(**INLINE)
def _finish(method, model, n, h, now, new, wanted, signals, data, ring):
    c = method.stages.c
    if signals.changing and c[len(c) - 1] != 1.0:
        signals_at(model, (n + 1) * h, signals)
    rhs(model, ring.current, signals.p, signals.u, ring.k.reshape(ring.k.size), new * width(model), data)
    if method.error.terms > 0:
        error = method.error
        # the error's terms begin with this step's first slope and the next one's
        error.rows[0, 0], error.rows[0, 1] = now, new
        largest_error(model, ring.k, error.rows, error.weights, error.terms, h, ring.largest)


@compiled_for(note, RungeKuttaArrays)
@njit(**INLINE)
def _note(method, model, ring, out, interval):
    if method.error.terms > 0:
        scaled_error(model, ring.largest, ring.current, out.errors, interval)
