"""The registry of methods: name -> method.

Adding a Runge-Kutta method is one entry in tableaux.py, an Adams method one in multistep.py, and one word here; the
exponential ones stand in exponential.py and exponential_adams.py.
"""

from __future__ import annotations

from functools import cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.integrators import multistep as m
from fatigue_runner.integrators import tableaux as t
from fatigue_runner.integrators.exponential import ETDRK4
from fatigue_runner.integrators.exponential_adams import ETDABM3, ETDABM4


class Method(Protocol):
    """What every fixed-step method tells about itself."""

    @property
    def name(self) -> str: ...
    @property
    def order(self) -> int: ...
    @property
    def source(self) -> str: ...
    @property
    def evaluations_per_step(self) -> int: ...
    @property
    def family(self) -> str:
        """What its learned corrections have in common: `runge-kutta`, `adams`, `exponential-runge-kutta`, `exponential-adams`."""
        ...

    @property
    def varying_pitch(self) -> bool:
        """Whether it takes a pitch that varies in time."""
        ...

    @property
    def correctable(self) -> bool:
        """Whether correctors are made for methods of its kind."""
        ...

    def evaluations(self, steps: int) -> int:
        """Evaluations of f in a run of `steps` steps, the initial one and a start-up included."""
        ...

    def growth(self, z: NDArray[np.complex128]) -> NDArray[np.float64] | None:
        """Largest growth per step of a solution of x' = lambda x at z = h lambda; None where that says nothing."""
        ...


_BY_NAME: dict[str, Method] = {
    x.name: x
    for x in (
        t.EULER, t.HEUN, t.RK3, t.HEUN_RICHARDSON, t.BS32, t.RK4, t.DP5, t.TSIT5, t.RK7, m.AB4, m.ABM4,
        ETDRK4, ETDABM3, ETDABM4,
    )
}  # fmt: skip

METHODS = (*_BY_NAME, "dop853")


@cache
def method(name: str) -> Method:
    """The method of this name. Raises InputError with the nearest known one."""
    if name == "dop853":  # made from SciPy's coefficients: not before someone asks
        return t.dop853()
    if name not in _BY_NAME:
        raise InputError(f"unknown integrator {name!r}{did_you_mean(name, METHODS)}")
    return _BY_NAME[name]
