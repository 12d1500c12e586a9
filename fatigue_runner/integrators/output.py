"""Dense output: weights that interpolate positions, velocities and accelerations at step ends to the output times.

Every state is a position or its velocity, so the Hermite polynomial through (q, q', q'') at the two ends of a step has order 5
for q and its derivative order 4 for q'; through three step ends 8 and 7. The higher one serves the methods above order 4.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import factorial

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class OutputPlan:
    """time (n,) [s]; `step` (n,) the step after which each output is known (0: the start); `exact` where it is the step's end.

    position, velocity (n, 9): weights of q, h q', h^2 q'' at the ends n-1, n, n+1 (node by node) for q and for h q'.
    """

    time: Array
    step: NDArray[np.int64]
    exact: NDArray[np.bool_]
    position: Array
    velocity: Array


@lru_cache(maxsize=4096)
def hermite_weights(theta: float, nodes: tuple[float, ...]) -> tuple[Array, Array]:
    """(3 nodes,) weights for value and derivative at `theta` [steps], from value, slope and curvature at the nodes."""
    size = 3 * len(nodes)
    rows = np.zeros((size, size))
    for i, x in enumerate(nodes):
        for derivative in range(3):
            for power in range(derivative, size):
                scale = factorial(power) / factorial(power - derivative)
                rows[3 * i + derivative, power] = scale * x ** (power - derivative)
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
    position, velocity = np.zeros((len(time), 9)), np.zeros((len(time), 9))
    three = order > 4 and steps > 1
    if three and np.any((number == 1) & ~exact):
        # the first step's outputs wait for the second step's end, to have three step ends; so its own end must wait, too, and is
        # then the one before the newest: weight 1 on its value and on its slope
        position[(number == 1) & exact, 3] = velocity[(number == 1) & exact, 4] = 1.0
        waiting = number == 1
        number[waiting] = 2
    else:
        waiting = np.zeros(len(time), bool)
    for i in np.flatnonzero(~exact):
        # theta is rounded so that equal places of different steps share their weights
        theta = round(float(place[i] - (number[i] - 1)), 9)
        nodes = (-1.0, 0.0, 1.0) if three else (0.0, 1.0)
        q, v = hermite_weights(theta, nodes)
        position[i, 9 - len(q) :], velocity[i, 9 - len(v) :] = q, v
    exact &= ~waiting
    return OutputPlan(time, number, exact, position, velocity)
