"""Adaptive DOP853 and Tsit5, case by case through SciPy: how many evaluations a step-size control needs for an accuracy.

SciPy's interpreter time says nothing about a compiled adaptive code, so two costs are given: the measured time, and evaluations
times the cost of f for one case alone, which no adaptive code can beat: cases with steps of their own cannot share vectors.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fatigue_runner.benchmark.speed import right_hand_side
from fatigue_runner.benchmark.study.cases import Cases
from fatigue_runner.benchmark.study.integrators import ADAPTIVE
from fatigue_runner.benchmark.study.points import Point, Reference, evaluate
from fatigue_runner.integrators import Integrator, simulate
from fatigue_runner.layout import Channel

METHODS = ("dop853-adaptive", "tsit5-adaptive")
# Absolute tolerance of a state as a fraction of its range: the states differ by four orders of magnitude.
ABSOLUTE = 1.0


@dataclass
class Solved:
    """What `points.evaluate` needs of a trajectory, and the evaluations it took."""

    time: np.ndarray
    state: np.ndarray
    wind: np.ndarray
    loads: dict[str, np.ndarray]
    evaluations: int
    seconds: float
    states: tuple[Channel, ...]
    pitch: np.ndarray
    control: dict[str, np.ndarray] = field(default_factory=dict)
    diverged_at: float | None = None

    @property
    def duration(self) -> float:
        return float(self.time[-1] - self.time[0])


def solver(name: str) -> Any:
    """SciPy's DOP853, or its Runge-Kutta class with this project's Tsit5 tableau."""
    from scipy.integrate import DOP853, RK45

    from fatigue_runner.integrators.tableaux import TSIT5

    if name == "dop853-adaptive":
        return DOP853
    a, b, e, c = TSIT5.arrays()
    n = TSIT5.evaluations_per_step

    class Tsit5(RK45):  # type: ignore[misc]  # SciPy has no hints
        A, B, C, E, n_stages = a[:n, :n], b[:n], c[:n], -e, n

    return Tsit5


def ranges(cases: Cases, number: int) -> np.ndarray:
    """(size,) extent of every state in a case."""
    found = simulate(cases.ensemble.part([number]), Integrator("rk4", 0.02))[0]
    return np.ptp(found.state, axis=0)


def solve(cases: Cases, number: int, name: str, tolerance: float) -> Solved:
    """One whole case at one relative tolerance; outputs between steps by the quintic that the fixed-step methods use."""
    from fatigue_runner.integrators.output import hermite_weights

    wind, initial, duration = cases.ensemble.winds[number], cases.ensemble.initial[number], cases.duration
    turbine = cases.ensemble.turbine
    times = np.arange(round(duration / cases.output_step) + 1) * cases.output_step
    f = right_hand_side.of_one_case(turbine, wind, duration, cases.pitch)
    scale = ranges(cases, number)
    q_rows, v_rows, u_rows = (
        turbine.layout.positions,
        turbine.layout.velocities,
        turbine.layout.first_order_rows,
    )
    begin = time.perf_counter()
    stepper = solver(name)(f, 0.0, initial, duration, rtol=tolerance, atol=ABSOLUTE * tolerance * scale)
    states, filled = np.empty((len(times), len(initial))), 1
    states[0] = stepper.y
    old, old_slope = stepper.y.copy(), stepper.f.copy()
    while stepper.status == "running":
        stepper.step()
        h = stepper.t - stepper.t_old
        while filled < len(times) and times[filled] <= stepper.t + 1e-12:
            place = (times[filled] - stepper.t_old) / h
            q, v = hermite_weights(place, (0.0, 1.0))
            u, _ = hermite_weights(place, (0.0, 1.0), 2)
            given = np.stack(
                [
                    old[q_rows],
                    h * old[v_rows],
                    h * h * old_slope[v_rows],
                    stepper.y[q_rows],
                    h * stepper.y[v_rows],
                    h * h * stepper.f[v_rows],
                ]
            )
            ends = np.stack([old[u_rows], h * old_slope[u_rows], stepper.y[u_rows], h * stepper.f[u_rows]])
            states[filled] = np.concatenate([q @ given, v @ given / h, u @ ends])
            filled += 1
        old, old_slope = stepper.y.copy(), stepper.f.copy()
    seconds = time.perf_counter() - begin
    signals = wind.at(times)
    loads = turbine.loads(states, signals, cases.pitch, wind.channels)
    failed = stepper.t if stepper.status == "failed" else None
    pitch = np.full(len(times), cases.pitch)
    return Solved(
        times, states, signals, loads, stepper.nfev, seconds, turbine.layout.states, pitch, diverged_at=failed
    )


def measure(cases: Cases, reference: Reference, name: str, tolerance: float, count: int) -> Point:
    """The point of an adaptive method on `count` of the cases; `step` is the mean step [s]."""
    chosen = list(range(0, len(cases.ensemble), max(1, len(cases.ensemble) // count)))[:count]
    part = Reference([reference.trajectories[i] for i in chosen], [reference.loads[i] for i in chosen])
    block: Sequence[Any] = [solve(cases, i, name, tolerance) for i in chosen]
    rate = sum(s.evaluations for s in block) / len(block) / cases.duration
    stages = 12 if name == "dop853-adaptive" else 6
    seconds = sum(s.seconds for s in block) / len(block) / cases.duration
    label = f"{name}, tolerance {tolerance:g}"
    wall = {"interpreter": seconds}
    return evaluate(
        block, part, cases, Point(cases.name, name, stages / rate, rate, name, label, ADAPTIVE, wall=wall)
    )
