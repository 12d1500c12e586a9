"""A trained corrector: what it is bound to, its map, its guard, and what is known of its making."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.corrector.binding import SAME_STEP, Binding
from fatigue_runner.corrector.errors import CorrectorError
from fatigue_runner.corrector.guard import Guard
from fatigue_runner.corrector.maps import Map
from fatigue_runner.corrector.maps.map import Run
from fatigue_runner.integrators.step_ladder import ENDS, reaches
from fatigue_runner.integrators.tableaux import RK4

if TYPE_CHECKING:
    from fatigue_runner.turbine import Turbine

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class Corrector:
    """N(x, p) of x+ = eta_h(x) + h^(p+1) N, for one turbine, method and step [s]: a `integrators.protocol.StepCorrector`.

    Of its making: wind_range [m/s] of the training, figures on winds that were not trained on (`validation`), facts of the training,
    the text of the recipe. rungs: correctors at a half, a quarter, ... of the step that make what this one's guard refuses, see
    `integrators.step_ladder`. Raises CorrectorError where binding, map, guard and rungs do not fit together.
    """

    name: str
    family: str
    binding: Binding
    map: Map
    guard: Guard
    wind_range: tuple[float, float] = (0.0, 0.0)
    validation: Mapping[str, float] = field(default_factory=dict)
    training: Mapping[str, Any] = field(default_factory=dict)
    recipe: str = ""
    licence: str = "Apache-2.0"
    rungs: tuple[Corrector, ...] = ()

    def __post_init__(self) -> None:
        method = self.binding.found
        if method.family != self.map.methods:
            raise CorrectorError(
                f"corrector {self.name}: features {self.map.kind!r} do not exist for {method.name}"
            )
        try:
            self.map.check(method, self.guard)
        except CorrectorError as error:
            raise CorrectorError(f"corrector {self.name}: {error}") from None
        if not all(np.isfinite(weights).all() for weights in self.map.tensors().values()):
            raise CorrectorError(f"corrector {self.name}: a weight is not a finite number; train it anew")
        for number, rung in enumerate(self.rungs, start=1):
            self._check_rung(rung, 2**number)

    def _check_rung(self, rung: Corrector, steps: int) -> None:
        what, other = f"corrector {self.name}: its rung at {rung.step * 1e3:g} ms", rung.binding
        if not (self.past and rung.past):
            raise CorrectorError(f"{what}: only exponential Adams methods have a ladder of steps")
        if abs(rung.step * steps - self.step) > SAME_STEP * self.step:
            raise CorrectorError(f"{what} must be at {self.step / steps * 1e3:g} ms")
        if (other.turbine_hash, other.operation) != (self.turbine_hash, self.binding.operation):
            raise CorrectorError(f"{what} is for another turbine")
        if rung.map.commands != self.map.commands:
            raise CorrectorError(f"{what} must see commands where the step above it does")
        if rung.rungs:
            raise CorrectorError(f"{what} has rungs of its own; list them all here")
        if reaches(rung.past, steps) > min(self.past, ENDS) - 1:
            raise CorrectorError(f"{what} looks back further than the steps above it")

    def __repr__(self) -> str:
        return f"Corrector({self.name!r}, {self.family}, {self.turbine}, {self.method} at {self.step * 1e3:g} ms)"

    @property
    def turbine(self) -> str:
        """Its name."""
        return self.binding.turbine

    @property
    def turbine_hash(self) -> str:
        return self.binding.turbine_hash

    @property
    def method(self) -> str:
        return self.binding.method

    @property
    def step(self) -> float:
        """[s]"""
        return self.binding.step

    @property
    def history(self) -> int:
        return self.map.history

    @property
    def past(self) -> int:
        return self.map.past

    @property
    def damping(self) -> float:
        return self.map.damping

    @property
    def fallback(self) -> tuple[str, float] | None:
        """Method and step [s] that make what the guard refuses; None: the method of the next order that shares the stages."""
        if not self.guard.substeps:
            return None
        return RK4.name if self.past else self.method, self.step / self.guard.substeps

    def bind(self, turbine: Turbine, method: str, step: float) -> None:
        """Raises CorrectorError unless it was trained for this turbine, method and step [s]."""
        refusal = self.binding.refusal(turbine, method, step)
        if not refusal and turbine.layout.names != self.map.layout.names:
            refusal = f"was trained for a turbine of {self.map.layout.size} states, this one has {turbine.layout.size}; train one"
        seen, there = (", ".join(c.name for c in layout.wind) for layout in (self.map.layout, turbine.layout))
        if not refusal and seen != there:
            refusal = (
                f"was trained for the wind's {seen}, the equations of this turbine know {there}; train one"
            )
        if refusal:
            raise CorrectorError(f"corrector {self.name} {refusal}")

    def map_data(
        self, turbine: Turbine, pitch: float = 0.0, speed: float = 0.0, harmonics: bool = False
    ) -> NamedTuple:
        """What the compiled loop reads of the map; see `integrators.protocol.StepCorrector`."""
        return self.map.data(self.binding, turbine, Run(pitch, speed, harmonics))

    def predict(self, sampled: Any) -> Array:
        """Defects (n, states) [state units] of sampled steps, as the kernel computes them."""
        return self.map.predict(sampled, self.binding.size)
