"""Linear multistep methods (Adams): the methods as data, checked when made, and their step. A new one is one more entry here."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.compiled import INLINE, njit
from fatigue_runner.integrators.butcher import ButcherTableau, F, Number
from fatigue_runner.integrators.choice import compiled_for
from fatigue_runner.integrators.contract import Prepared, Task
from fatigue_runner.integrators.runge_kutta import (
    Stages,
    Sum,
    first_slope,
    nothing_to_forget,
    result_of,
    result_of_step,
    slope_rows,
    stages_of,
    stages_of_step,
)
from fatigue_runner.integrators.signals import signals_at
from fatigue_runner.integrators.stepper import advance, begin, finish, note, recover
from fatigue_runner.integrators.stepping import combine_new, move_line
from fatigue_runner.integrators.tableaux import RK4
from fatigue_runner.turbine.model import rhs, width

BACK = 4  # slopes that the step reads: now and three steps back


@dataclass(frozen=True)
class LinearMultistep:
    """An Adams method, started with a Runge-Kutta method.

    predictor: weights of the slopes now, one, two, ... steps back; corrector: of the predicted slope, then now, one, two, ...
    steps back (predict, evaluate, correct, evaluate), or None. Raises ValueError where weights do not add up to 1.
    """

    name: str
    order: int
    predictor: tuple[Number, ...]
    source: str
    corrector: tuple[Number, ...] | None = None
    start: ButcherTableau = RK4

    family = "adams"
    varying_pitch = True
    correctable = False

    def __post_init__(self) -> None:
        for label, weights in (("predictor", self.predictor), ("corrector", self.corrector)):
            if weights is None:
                continue
            if sum(weights) != 1:
                raise ValueError(f"{self.name}: the {label}'s weights add up to {sum(weights)}, not 1")
            if len(weights) != BACK:
                raise ValueError(
                    f"{self.name}: the {label} has {len(weights)} weights, the step is made for {BACK}"
                )
        if self.start.order < self.order - 1:
            raise ValueError(f"{self.name}: its start {self.start.name} would spoil order {self.order}")

    @property
    def evaluations_per_step(self) -> int:
        """Without the start; `evaluations` has it."""
        return 1 if self.corrector is None else 2

    def evaluations(self, steps: int) -> int:
        """Of a run of `steps` steps: the initial slope, the start's steps, the others."""
        starting = min(steps, BACK - 1)
        return 1 + starting * self.start.evaluations_per_step + (steps - starting) * self.evaluations_per_step

    def growth(self, z: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Largest growth per step of a solution of x' = lambda x at z = h lambda, same shape as z."""
        beta = np.array([float(b) for b in self.predictor])
        z = np.asarray(z, complex)
        companion = np.zeros((*z.shape, BACK, BACK), complex)
        companion[..., 1:, :-1] = np.eye(BACK - 1)
        predicted = z[..., None] * beta
        predicted[..., 0] += 1
        if self.corrector is None:
            companion[..., 0, :] = predicted
        else:
            gamma = np.array([float(b) for b in self.corrector])
            companion[..., 0, :] = z[..., None] * gamma[0] * predicted
            companion[..., 0, :-1] += z[..., None] * gamma[1:]
            companion[..., 0, 0] += 1
        return np.abs(np.linalg.eigvals(companion)).max(axis=-1)

    def prepare(self, task: Task) -> Prepared:
        """See `contract.Method`."""
        arrays = self._arrays()
        return Prepared(lambda _lanes, _aligned: arrays, slope_rows(self.start) + 1, self.evaluations)

    def _arrays(self) -> AdamsArrays:
        weights = np.array([[float(x) for x in w] for w in (self.predictor, self.corrector or [0] * BACK)])
        oldest = slope_rows(self.start) - 1
        return AdamsArrays(
            stages_of(self.start), result_of(self.start), np.zeros((2, BACK), np.int64), weights,
            self.corrector is not None, oldest,
        )  # fmt: skip


def _weights(text: str, denominator: int) -> tuple[Number, ...]:
    return tuple(Fraction(x) / denominator for x in F(text))


_ADAMS = "Bashforth & Adams (1883); Hairer, Norsett & Wanner (2008), III.1, eqs. 1.5 and 1.9'"
AB4 = LinearMultistep("ab4", 4, _weights("55 -59 37 -9", 24), _ADAMS + "; OpenFAST's AB4 with its RK4 start")
ABM4 = LinearMultistep(
    "abm4", 4, _weights("55 -59 37 -9", 24), _ADAMS + "; PECE, OpenFAST's ABM4 with its RK4 start",
    corrector=_weights("9 19 -5 1", 24),
)  # fmt: skip


class AdamsArrays(NamedTuple):
    """The start's stages and result; rows of k and weights (2, BACK) of predictor and corrector; whether there is a corrector; the
    row of k where the oldest slope stands, that of the prediction behind it."""

    stages: Stages
    result: Sum
    rows: NDArray[np.int64]
    weights: NDArray[np.float64]
    correcting: bool
    oldest: int


compiled_for(begin, AdamsArrays)(first_slope)
compiled_for(recover, AdamsArrays)(nothing_to_forget)


@compiled_for(advance, AdamsArrays)
@njit(**INLINE)
def _advance(method, model, n, h, now, new, signals, data, ring):
    states, k, current = ring.states, ring.k, ring.current
    rows, weights, oldest = method.rows, method.weights, method.oldest
    if n < weights.shape[1] - 1:
        stages_of_step(model, method.stages, n, h, now, states, k, signals, data, current)
        return result_of_step(model, method.result, h, now, new, ring)
    back1, back2 = (now + 2) % 3, new
    rows[0, 0], rows[0, 1], rows[0, 2], rows[0, 3] = now, back1, back2, oldest
    fine = combine_new(model, states, now, new, k, rows, weights, 0, 4, h, current)
    if method.correcting:
        if signals.changing:
            signals_at(model, (n + 1) * h, signals)
        rhs(model, current, signals.p, signals.u, k.reshape(k.size), (oldest + 1) * width(model), data)
        rows[1, 0], rows[1, 1], rows[1, 2], rows[1, 3] = oldest + 1, now, back1, back2
        fine = combine_new(model, states, now, new, k, rows, weights, 1, 4, h, current)
    return fine


@compiled_for(finish, AdamsArrays)
@njit(**INLINE)
def _finish(method, model, n, h, now, new, wanted, signals, data, ring):
    c = method.stages.c
    at = c[len(c) - 1] if n < method.weights.shape[1] - 1 else (1.0 if method.correcting else 0.0)
    if signals.changing and at != 1.0:
        signals_at(model, (n + 1) * h, signals)
    # the slope two steps back becomes the oldest; its place in the ring is the newest one's
    move_line(model, ring.k, new, method.oldest)
    rhs(model, ring.current, signals.p, signals.u, ring.k.reshape(ring.k.size), new * width(model), data)


@compiled_for(note, AdamsArrays)
@njit(**INLINE)
def _note(method, model, ring, out, interval):
    pass
