"""What a method is: the rules for whoever implements one.

A method is an object with the members of `Method`, made in the file of its family and found there by `methods`. Its `prepare` turns
it into the arrays of one run, a NamedTuple whose type picks the compiled step: that file registers `begin`, `advance`, `recover`,
`finish` and `note` for it (see `stepper`). Nothing else knows the family.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from fatigue_runner.integrators.protocol import StepCorrector
    from fatigue_runner.integrators.signals import Signals
    from fatigue_runner.layout import Layout
    from fatigue_runner.turbine import Turbine

Array = NDArray[np.float64]
Aligned = Callable[[NDArray[Any]], NDArray[Any]]


@dataclass(frozen=True)
class Task:
    """What a method is prepared for: step [s]; pitch [rad], that of the start where it varies in time; a corrector and its mode."""

    turbine: Turbine
    layout: Layout
    step: float
    pitch: float
    corrector: StepCorrector | None = None
    mode: str = ""


@dataclass(frozen=True)
class Lanes:
    """What the cases of one group begin with: states (width,), signals, mean wind speeds (LANES,) [m/s]."""

    start: Array
    signals: Signals
    speeds: tuple[float, ...]


@dataclass(frozen=True)
class Prepared:
    """A method made ready for the runs of one block.

    arrays: from a group's lanes and a function that copies onto cache lines, to the NamedTuple that the compiled step takes, with room of
    its own; slopes: rows of k; evaluations: of f in a run of so many steps; limit: of the hybrid's discrepancy, NaN where no step is
    tested; extra: evaluations beyond those, per lane (LANES,), from the arrays of a run that has ended.
    """

    arrays: Callable[[Lanes, Aligned], Any]
    slopes: int
    evaluations: Callable[[int], int]
    limit: float = np.nan
    extra: Callable[[Any], NDArray[np.int64]] | None = None


class Method(Protocol):
    """A fixed-step method.

    family: what its learned corrections have in common (`runge-kutta`, `adams`, ...); varying_pitch: whether it takes a pitch that
    varies in time; correctable: whether correctors are made for it.
    """

    @property
    def family(self) -> str: ...
    @property
    def varying_pitch(self) -> bool: ...
    @property
    def correctable(self) -> bool: ...
    @property
    def name(self) -> str: ...
    @property
    def order(self) -> int: ...
    @property
    def source(self) -> str: ...
    @property
    def evaluations_per_step(self) -> int: ...

    def evaluations(self, steps: int) -> int:
        """Evaluations of f in a run of `steps` steps, the initial one and a start-up included."""
        ...

    def growth(self, z: NDArray[np.complex128]) -> Array | None:
        """Largest growth per step of a solution of x' = lambda x at z = h lambda; None where that says nothing."""
        ...

    def prepare(self, task: Task) -> Prepared:
        """Ready for a block. Raises InputError where it cannot be, CorrectorError where the corrector does not fit."""
        ...
