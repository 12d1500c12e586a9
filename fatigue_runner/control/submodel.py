"""What a controller is: first-order states of its own, and the pitch and generator torque that follow from them.

Its formulas are written once, in `outputs` and `rates`, with the mathematics handed in: the derivation calls them with symbols, logs and
operating points with numpy arrays. Continuous time and no kink: a corner that a trajectory passes costs every method its order.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fatigue_runner.layout import PITCH_RATE, PITCH_RATE_LIMITED, Channel, FirstOrder

Values = Mapping[str, Any]
Root = Callable[[Any], Any]


@dataclass(frozen=True, eq=False)
class Submodel:
    """name: in generated modules; states: behind the turbine's; parameters: what its formulas take, with their meaning [unit].

    outputs(states, parameters, sqrt) -> {"pitch": [rad], "generator_torque": [N m], ...}, of the turbine's and its own states by name;
    rates(states, parameters, sqrt) -> {own state: its derivative};
    read(section, law, pitching) -> parameters, from a turbine file's `control` section and the generator's torque law
    (`turbine.parameters.generator_law`), without `pitching` with the blades at fine pitch;
    start(parameters, generator speed [rad/s], pitch [rad]) -> its own states in steady operation;
    speeds(parameters) -> slowest and fastest generator speed of steady operation [rad/s];
    signals, observe(states, parameters) -> {signal: values}: what a person should see besides, of numpy arrays.
    """

    name: str
    states: tuple[FirstOrder, ...]
    parameters: Mapping[str, str]
    outputs: Callable[[Values, Values, Root], dict[str, Any]]
    rates: Callable[[Values, Values, Root], dict[str, Any]]
    read: Callable[[Values, Values, bool], dict[str, float]]
    start: Callable[[Values, float, float], tuple[float, ...]]
    speeds: Callable[[Values], tuple[float, float]]
    signals: tuple[Channel, ...] = ()
    observe: Callable[[Values, Values], dict[str, Any]] = lambda states, parameters: {}

    @property
    def names(self) -> tuple[str, ...]:
        """Of its states."""
        return tuple(state.signal.name for state in self.states)

    @property
    def seen(self) -> tuple[Channel, ...]:
        """What `observed` gives: the pitch's rate, whether that is beyond its limit, and the controller's own signals."""
        return (PITCH_RATE, PITCH_RATE_LIMITED, *self.signals)

    def observed(self, states: Values, parameters: Values, rate_limit: float) -> dict[str, Any]:
        """`seen` of states by name, arrays; rate_limit [rad/s], which does not act here.

        The pitch's rate by a complex step: its formulas are analytic, so that the step's size does not matter.
        """
        step = 1e-20
        slopes = self.rates(states, parameters, np.sqrt)
        moved = dict(states) | {name: states[name] + 1j * step * slope for name, slope in slopes.items()}
        pitch = self.outputs(moved, parameters, np.sqrt)["pitch"]
        rate = np.imag(pitch) / step + np.zeros(np.shape(states[self.names[0]]))
        beyond = (np.abs(rate) > rate_limit).astype(float)
        own = self.observe(states, parameters)
        return {PITCH_RATE.name: rate, PITCH_RATE_LIMITED.name: beyond, **own}


def larger(a: Any, b: Any, blend: Any, sqrt: Root) -> Any:
    """max(a, b) with its corner rounded over `blend`."""
    difference = a - b
    return (a + b + sqrt(difference * difference + blend * blend)) / 2


def smaller(a: Any, b: Any, blend: Any, sqrt: Root) -> Any:
    """min(a, b) with its corner rounded over `blend`."""
    difference = a - b
    return (a + b - sqrt(difference * difference + blend * blend)) / 2
