"""What an integrator needs of a learned corrector: the rules for whoever makes one, and what its map gives the compiled loops.

The integrators know this file, never `corrector`. A new kind of map is a NamedTuple of arrays of its own, which the compiled loop tells
from the others by its type.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Sequence

    from fatigue_runner.turbine import Turbine

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]


class StageMapData(NamedTuple):
    """A map of what a Runge-Kutta step has computed anyway: the rows of `correction.features`.

    ratio: of the gearbox; history: earlier steps whose first slopes follow the stages. The linear part sees all rows, and all rows
    times each row of `factors`; the net sees the rows alone. linear, net: weights as `dense.pack` orders them, one layer after
    the other, scaled to the defect; sizes: outputs of the layers behind a 0. Empty where there is no such part.
    """

    ratio: float
    history: int
    factors: Numbers
    linear: Array
    net: Array
    sizes: Numbers
    activation: int


class RawNetworkData(NamedTuple):
    """A network of the rows of `correction.raw_features`, the state as it is and the wind; fields as in `StageMapData`."""

    net: Array
    sizes: Numbers
    activation: int


class MultiBladeData(NamedTuple):
    """Predictor and corrector of an exponential Adams method on the rows of `multi_blade`, in multi-blade coordinates.

    ahead, weights: with their learned parts; plain: the corrector without, by which the hybrid judges; packed by `dense.pack`.
    again: where the map sees what is commanded within the step (`command_rows`), the predictor's second product, which sees that as well;
    else empty. factors: rows that multiply all rows of the corrector.
    """

    ahead: Array
    again: Array
    weights: Array
    plain: Array
    factors: Numbers


class Guard(Protocol):
    """The hybrid's acceptance test: |corrected - fallback| in units of atol + max(|x|, |fallback|) rtol is at most `limit`.

    norm: `max` or `rms`; atol, rtol (states,). substeps: the fallback is that many smaller steps of the method itself, or of RK4 where
    that is an exponential Adams method; 0: the method of the next order that shares the stages. low, high: bounds of the features
    behind the leading 1, or empty. ahead_atol: atol of the distance from what an exponential Adams method has predicted, in the
    units of the same limit; empty for methods that predict nothing.
    """

    @property
    def limit(self) -> float: ...
    @property
    def norm(self) -> str: ...
    @property
    def atol(self) -> tuple[float, ...]: ...
    @property
    def rtol(self) -> tuple[float, ...]: ...
    @property
    def substeps(self) -> int: ...
    @property
    def low(self) -> tuple[float, ...]: ...
    @property
    def high(self) -> tuple[float, ...]: ...
    @property
    def ahead_atol(self) -> tuple[float, ...]: ...


class StepCorrector(Protocol):
    """A learned correction of one method's local error, for one turbine and step."""

    @property
    def name(self) -> str: ...
    @property
    def family(self) -> str:
        """What kind of learning it is, for tables."""
        ...

    @property
    def wind_range(self) -> tuple[float, float]:
        """Slowest and fastest wind [m/s] that it was trained on: beyond, a run is told so."""
        ...

    @property
    def method(self) -> str: ...
    @property
    def step(self) -> float:
        """[s]"""
        ...

    @property
    def history(self) -> int:
        """Earlier steps whose first slopes the map of a Runge-Kutta method sees; the run begins with as many steps of the fallback."""
        ...

    @property
    def past(self) -> int:
        """Earlier nonlinear parts that the map of an exponential Adams method sees, at least the method's own; 0 for other methods."""
        ...

    @property
    def damping(self) -> float:
        """[1/s] added to the generator's in the linear part of an exponential method."""
        ...

    @property
    def guard(self) -> Guard: ...
    @property
    def rungs(self) -> Sequence[StepCorrector]:
        """Correctors at a half, a quarter, ... of the step: what this one's guard refuses is made by the first of them that accepts it,
        before RK4 makes it; empty for most, and for Runge-Kutta methods."""
        ...

    def bind(self, turbine: Turbine, method: str, step: float) -> None:
        """Raises InputError unless it was made for this turbine, method and step [s]."""
        ...

    def map_data(
        self, turbine: Turbine, pitch: float = 0.0, speed: float = 0.0, harmonics: bool = False
    ) -> Any:
        """What the compiled loop reads: `StageMapData`, `RawNetworkData`, `MultiBladeData` or another type with code of its own.

        speed [m/s]: mean wind of the cases that it is for, where the method or the map differs between winds; harmonics: whether the
        equations take azimuthal ones.
        """
        ...
