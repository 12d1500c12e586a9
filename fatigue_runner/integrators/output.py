"""Dense output: weights that interpolate positions, velocities and accelerations at step ends to the output times.

A position and its velocity come in pairs, so the Hermite polynomial through (q, q', q'') at the two ends of a step has order 5
for q and its derivative order 4 for q'; through three step ends 8 and 7. The higher one serves the methods above order 4. A
first-order state has its value and slope only: order 3 through two step ends, 5 through three.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import factorial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class PlanArrays(NamedTuple):
    """What the compiled loop reads of an `OutputPlan`, or of a part of it."""

    step: NDArray[np.int64]
    exact: NDArray[np.bool_]
    line: NDArray[np.int64]
    position: Array
    velocity: Array
    first_order: Array


@dataclass(frozen=True)
class OutputPlan:
    """time (n,) [s]; `step` (n,) the step after which each output is known (0: the start); `exact` where it is the step's end; `line` (n,)
    of the weights, which outputs at equal places within their steps share.

    position, velocity (lines, 9): weights of q, h q', h^2 q'' at the ends n-1, n, n+1 (node by node) for q and for h q';
    first_order (lines, 6): of x, h x' for a first-order state x.
    """

    time: Array
    step: NDArray[np.int64]
    exact: NDArray[np.bool_]
    line: NDArray[np.int64]
    position: Array
    velocity: Array
    first_order: Array

    @property
    def most_in_a_step(self) -> int:
        """Outputs that become known with one step, at most."""
        return int(np.unique(self.step, return_counts=True)[1].max())

    def part(self, begin: int, end: int) -> PlanArrays:
        """The outputs from number `begin` to before `end`."""
        own = slice(begin, end)
        return PlanArrays(
            self.step[own], self.exact[own], self.line[own], self.position, self.velocity, self.first_order
        )


@lru_cache(maxsize=4096)
def hermite_weights(theta: float, nodes: tuple[float, ...], derivatives: int = 3) -> tuple[Array, Array]:
    """(derivatives * nodes,) weights for value and derivative at `theta` [steps], from value, slope and curvature at the nodes (or
    value and slope, with two derivatives)."""
    size = derivatives * len(nodes)
    rows = np.zeros((size, size))
    for i, x in enumerate(nodes):
        for derivative in range(derivatives):
            for power in range(derivative, size):
                scale = factorial(power) / factorial(power - derivative)
                rows[derivatives * i + derivative, power] = scale * x ** (power - derivative)
    powers = np.arange(size)
    value = theta**powers
    slope = np.where(powers > 0, powers * theta ** np.maximum(powers - 1, 0), 0.0)
    both = np.linalg.solve(rows.T, np.stack([value, slope], axis=1)).astype(np.float64)
    return both[:, 0].copy(), both[:, 1].copy()


def plan_output(
    duration: float, step: float, steps: int, output_step: float | None, order: int
) -> OutputPlan:
    """Output at multiples of `output_step` [s] (None: at every step) for a run of `steps` steps."""
    if output_step is None:
        time: Array = np.arange(steps + 1, dtype=np.float64) * step
    else:
        time = np.arange(int(np.floor(duration / output_step + 1e-9)) + 1, dtype=np.float64) * output_step
    place = time / step
    nearest = np.rint(place)
    exact = np.abs(place - nearest) < 1e-6
    number = np.where(exact, nearest, np.ceil(place)).astype(np.int64)
    three = order > 4 and steps > 1
    waiting = np.zeros(len(time), bool)
    if three and np.any((number == 1) & ~exact):
        # the first step's outputs wait for the second step's end, to have three step ends; so its own end must wait, too, and is
        # then the one before the newest
        waiting = number == 1
        number[waiting] = 2
    # theta is rounded so that equal places of different steps share their weights
    theta = np.round(place - (number - 1), 9)
    at_end, exact = exact & waiting, exact & ~waiting
    theta[at_end], theta[exact] = 0.0, 1.0
    places, line = np.unique(theta, return_inverse=True)
    nodes = (-1.0, 0.0, 1.0) if three else (0.0, 1.0)
    position, velocity, first = (np.zeros((len(places), width)) for width in (9, 9, 6))
    for i, found in enumerate(places.tolist()):
        if found == 0.0:  # the first step's end, which waits
            position[i, 3] = velocity[i, 4] = first[i, 2] = 1.0
            continue
        q, v = hermite_weights(round(found, 9), nodes)
        position[i, 9 - len(q) :], velocity[i, 9 - len(v) :] = q, v
        x = hermite_weights(round(found, 9), nodes, 2)[0]
        first[i, 6 - len(x) :] = x
    return OutputPlan(time, number, exact, line.astype(np.int64), position, velocity, first)


def places_between(places: Sequence[float]) -> PlanArrays:
    """For values at `places` [steps, up to 0] from the newest of three step ends; one row and one line of weights each."""
    count = len(places)
    position, velocity, first = np.zeros((count, 9)), np.zeros((count, 9)), np.zeros((count, 6))
    nodes = (-1.0, 0.0, 1.0)
    for i, place in enumerate(places):
        position[i], velocity[i] = hermite_weights(round(1.0 + place, 9), nodes)
        first[i] = hermite_weights(round(1.0 + place, 9), nodes, 2)[0]
    lines = np.arange(count, dtype=np.int64)
    return PlanArrays(lines, np.zeros(count, np.bool_), lines, position, velocity, first)
