"""Linear multistep methods (Adams): data, checked when made. A new method is one more entry here and its name in methods.py."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.integrators.tableaux import RK4, ButcherTableau, F, Number

BACK = 4  # slopes that the loop keeps: now and three steps back


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

    def __post_init__(self) -> None:
        for label, weights in (("predictor", self.predictor), ("corrector", self.corrector)):
            if weights is None:
                continue
            if sum(weights) != 1:
                raise ValueError(f"{self.name}: the {label}'s weights add up to {sum(weights)}, not 1")
            if len(weights) != BACK:
                raise ValueError(
                    f"{self.name}: the {label} has {len(weights)} weights, the loop is made for {BACK}"
                )
        if self.start.order < self.order - 1:
            raise ValueError(f"{self.name}: its start {self.start.name} would spoil order {self.order}")

    @property
    def family(self) -> str:
        return "adams"

    @property
    def varying_pitch(self) -> bool:
        return True

    @property
    def correctable(self) -> bool:
        return False  # its start and its history would need correctors of their own

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


def _weights(text: str, denominator: int) -> tuple[Number, ...]:
    return tuple(Fraction(x) / denominator for x in F(text))


_ADAMS = "Bashforth & Adams (1883); Hairer, Norsett & Wanner (2008), III.1, eqs. 1.5 and 1.9'"
AB4 = LinearMultistep("ab4", 4, _weights("55 -59 37 -9", 24), _ADAMS + "; OpenFAST's AB4 with its RK4 start")
ABM4 = LinearMultistep(
    "abm4", 4, _weights("55 -59 37 -9", 24), _ADAMS + "; PECE, OpenFAST's ABM4 with its RK4 start",
    corrector=_weights("9 19 -5 1", 24),
)  # fmt: skip
