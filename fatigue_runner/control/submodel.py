"""What a controller is: first-order states of its own, and the pitch and generator torque that follow from them.

Its formulas are written once, in `outputs` and `rates`, with the mathematics handed in: the derivation calls them with symbols, logs and
operating points with numpy arrays. Continuous time and no kink: a corner that a trajectory passes costs every method its order.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from fatigue_runner.layout import FirstOrder

Values = Mapping[str, Any]
Root = Callable[[Any], Any]


@dataclass(frozen=True)
class Submodel:
    """name: in generated modules; states: behind the turbine's; parameters: what its formulas take, with their meaning [unit].

    outputs(states, parameters, sqrt) -> {"pitch": [rad], "generator_torque": [N m], ...}, of the turbine's and its own states by name;
    rates(states, parameters, sqrt) -> {own state: its derivative}.
    """

    name: str
    states: tuple[FirstOrder, ...]
    parameters: Mapping[str, str]
    outputs: Callable[[Values, Values, Root], dict[str, Any]]
    rates: Callable[[Values, Values, Root], dict[str, Any]]

    @property
    def names(self) -> tuple[str, ...]:
        """Of its states."""
        return tuple(state.signal.name for state in self.states)


def larger(a: Any, b: Any, blend: Any, sqrt: Root) -> Any:
    """max(a, b) with its corner rounded over `blend`."""
    difference = a - b
    return (a + b + sqrt(difference * difference + blend * blend)) / 2


def smaller(a: Any, b: Any, blend: Any, sqrt: Root) -> Any:
    """min(a, b) with its corner rounded over `blend`."""
    difference = a - b
    return (a + b - sqrt(difference * difference + blend * blend)) / 2
