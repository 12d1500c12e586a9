"""What a corrector is made for: one turbine, one method, one step. Elsewhere it is refused, in a sentence that says what to do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from fatigue_runner.errors import InputError
from fatigue_runner.integrators import method as find_method
from fatigue_runner.turbine import load_turbine
from fatigue_runner.turbine.distance import apart
from fatigue_runner.turbine.turbine import FIXED

if TYPE_CHECKING:
    from fatigue_runner.integrators.contract import Method
    from fatigue_runner.turbine import Turbine

SAME_STEP = 1e-9  # relative


@dataclass(frozen=True)
class Binding:
    """A turbine by the hash of its equations, parameters and tables; the name of a method; its step [s]; the turbine's operation.

    Raises InputError for a method that no correctors are made for.
    """

    turbine: str
    turbine_hash: str
    method: str
    step: float
    operation: str = FIXED

    def __post_init__(self) -> None:
        correctable(self.method)

    @classmethod
    def to(cls, turbine: Turbine, method: str, step: float) -> Binding:
        return cls(turbine.name, turbine.hash, method, step, turbine.operation)

    @property
    def found(self) -> Method:
        """The method itself."""
        return find_method(self.method)

    @property
    def size(self) -> float:
        """h^(p+1): what a map's outputs are multiplied with to be a defect."""
        return self.step ** (self.found.order + 1)

    def refusal(self, turbine: Turbine, method: str, step: float) -> str:
        """Why the corrector does not fit a run, and the way out; empty where it fits."""
        if turbine.hash != self.turbine_hash:
            if self._fits_operated_otherwise(turbine):
                here = f"`operation: {turbine.operation}`"
                return (
                    f"was trained for {self.turbine} with `operation: {self.operation}`, the run has {here} and other equations; "
                    f"use one for {turbine.operation} (`fatigue-runner correctors list`), or train one with {here} in its recipe"
                )
            file = turbine.file or "FILE"
            return (
                f"was trained for turbine {self.turbine} ({self.turbine_hash[:12]}), this is {turbine.name} "
                f"({turbine.hash[:12]}){self._difference(turbine)}; `fatigue-runner train --turbine {file}` trains the standard set for it"
            )
        if method != self.method:
            return f"was trained for {self.method}, the campaign uses {method}; use `method: {self.method}` or train one"
        if abs(step - self.step) > SAME_STEP * self.step:
            return (
                f"was trained for step {self.step:g} s, the campaign uses {step:g} s; "
                f"train one with `fatigue-runner train RECIPE --step {step:g}`"
            )
        return ""

    def _difference(self, turbine: Turbine) -> str:
        """How far a turbine is from the one of the training, where that is shipped and unchanged."""
        try:
            trained = load_turbine(self.turbine).operated(turbine.operation)
            known = self.turbine_hash in (trained.hash, trained.operated(self.operation).hash)
        except InputError:
            return ""
        return f", which differs in {apart(turbine, trained)}" if known else ""

    def _fits_operated_otherwise(self, turbine: Turbine) -> bool:
        if turbine.operation == self.operation or (self.operation != FIXED and turbine.control is None):
            return False
        return turbine.operated(self.operation).hash == self.turbine_hash


def correctable(method: str) -> Method:
    """The method of this name. Raises InputError for one that no correctors are made for."""
    found = find_method(method)
    if not found.correctable:
        raise InputError(
            f"correctors exist for Runge-Kutta and exponential Adams methods; {method} is none: use heun, rk3, rk4, tsit5 or etdabm3"
        )
    return found
