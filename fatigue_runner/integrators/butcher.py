"""Butcher tableaux of explicit Runge-Kutta methods: data, checked when made."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.integrators import corrected
from fatigue_runner.integrators.contract import Prepared, Task
from fatigue_runner.integrators.runge_kutta import runge_kutta_arrays, slope_rows

Number = Fraction | float
Array = NDArray[np.float64]


@dataclass(frozen=True)
class ButcherTableau:
    """An explicit Runge-Kutta method.

    A: rows 2..s, row i with at most i - 1 entries; b (s,) weights of the result, of `order`; b_hat (s,) weights of the embedded
    result, of `embedded_order`, or None. c follows from A. Exact rationals where the source gives them.
    Raises ValueError where the weights do not add up to 1 or a row is too long.
    """

    name: str
    order: int
    A: tuple[tuple[Number, ...], ...]
    b: tuple[Number, ...]
    source: str
    b_hat: tuple[Number, ...] | None = None
    embedded_order: int = 0
    # the method of the next order that has the same first stages: the cheapest fallback of a corrected step
    shared_by: ButcherTableau | None = None

    family = "runge-kutta"
    varying_pitch = True
    correctable = True

    def __post_init__(self) -> None:
        for row, weights in enumerate(self.A, start=1):
            if len(weights) > row:
                raise ValueError(
                    f"{self.name}: row {row + 1} of A has {len(weights)} entries, an explicit method has {row}"
                )
        if len(self.A) != self.stages - 1:
            raise ValueError(f"{self.name}: {len(self.A)} rows of A for {self.stages} stages")
        for label, total in (("b", self.b), ("b_hat", self.b_hat)):
            if total is not None and abs(float(sum(total)) - 1) > 1e-14:
                raise ValueError(f"{self.name}: {label} adds up to {float(sum(total))}, not 1")

    @property
    def stages(self) -> int:
        return len(self.b)

    @property
    def first_same_as_last(self) -> bool:
        """Whether the last stage is the first one of the next step, so that it costs nothing."""
        return self.stages > 1 and self.b[-1] == 0 and tuple(self.A[-1]) == tuple(self.b[: len(self.A[-1])])

    @property
    def evaluations_per_step(self) -> int:
        return self.stages - self.first_same_as_last

    def evaluations(self, steps: int) -> int:
        """Of a run of `steps` steps, with the initial slope."""
        return 1 + steps * self.evaluations_per_step

    @property
    def c(self) -> tuple[Number, ...]:
        """Stage times in steps."""
        return (Fraction(0), *(sum(row, start=Fraction(0)) for row in self.A))

    def arrays(self) -> tuple[Array, Array, Array, Array]:
        """A (s, s), b (s,), error weights b - b_hat (s,) (zeros without an embedded method), c (s,)."""
        return _arrays(self)

    def stability_function(self, z: NDArray[np.complex128]) -> NDArray[np.complex128]:
        """R(z) = 1 + z b^T (1 + z A 1 + z^2 A^2 1 + ...)."""
        a, b, _, _ = self.arrays()
        total, power = np.ones_like(z, dtype=complex), np.ones(self.stages)
        factor = z.astype(complex)
        for _ in range(self.stages):
            total = total + factor * (b @ power)
            power, factor = a @ power, factor * z
        return total

    def growth(self, z: NDArray[np.complex128]) -> Array:
        """|R(z)|"""
        return np.abs(self.stability_function(z))

    def prepare(self, task: Task) -> Prepared:
        """See `contract.Method`."""
        if task.corrector is not None:
            return corrected.prepare(self, task, task.corrector)
        arrays = runge_kutta_arrays(self)
        return Prepared(lambda _lanes, _aligned: arrays, slope_rows(self), self.evaluations)


@lru_cache(maxsize=64)
def _arrays(tableau: ButcherTableau) -> tuple[Array, Array, Array, Array]:
    s = tableau.stages
    a = np.zeros((s, s))
    for i, row in enumerate(tableau.A, start=1):
        a[i, : len(row)] = [float(x) for x in row]
    b = np.array([float(x) for x in tableau.b])
    hat = b if tableau.b_hat is None else np.array([float(x) for x in tableau.b_hat])
    return a, b, b - hat, np.array([float(x) for x in tableau.c])


def tableau(
    name: str,
    order: int,
    rows: list[str],
    b: str,
    source: str,
    b_hat: str = "",
    embedded_order: int = 0,
    shared_by: ButcherTableau | None = None,
) -> ButcherTableau:
    """Tableau from rows of rationals."""
    return ButcherTableau(
        name, order, tuple(tuple(F(r)) for r in rows), tuple(F(b)), source, tuple(F(b_hat)) or None, embedded_order, shared_by
    )  # fmt: skip


def F(text: str) -> list[Number]:
    """Exact row: '1/4 1/4' -> fractions."""
    return [Fraction(word) for word in text.split()]
