"""All integrators over a range of steps on the same cases: what each costs, and how far each is from the reference.

Costs: evaluations of f, and measured time of whole steps with output, per simulated second and case, from repeats in which every
integrator runs once per round on one pinned core; CPU time, which is the wall time of an idle machine. `delta_t`: the paper
(arXiv:2504.05493) plots its errors over a time; its formula was not at hand, so it is taken as the mean of that time [s/s].
Errors: see `accuracy` and `fatigue`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fatigue_runner.benchmark import machine
from fatigue_runner.benchmark.cases import Cases

# Steps [s]; a method runs at those that cost it less than MOST evaluations per second, and up to the second unstable one.
LADDER = (
    0.4,
    0.3,
    0.2,
    0.15,
    0.1,
    0.07,
    0.05,
    0.035,
    0.025,
    0.02,
    0.015,
    0.01,
    0.007,
    0.005,
    0.0035,
    0.002,
    0.001,
)
MOST = 1200.0
REFERENCE = ("dop853", 0.005)
CHECKS = (("dop853", 0.0025), ("rk7", 0.005), ("rk7", 0.0025))


@dataclass
class Point:
    """One integrator on one set of cases. Costs per simulated second and case; errors pooled over the cases unless named worst.

    nrmse {state: RMS over the cases}; nrmse_max: of the worst state; nrmse_worst: worst state of the worst case; del_error
    {channel: worst |relative error| over exponents and cases}; delta_e, delta_e_range: one per case. diverged: how many cases;
    diverged_at: the first time [s]. Nothing is known of the errors of a point with a diverged case.
    """

    cases: str
    method: str
    step: float
    evaluations_per_second: float
    wall: dict[str, float] = field(default_factory=dict)
    diverged: int = 0
    diverged_at: float | None = None
    nrmse: dict[str, float] = field(default_factory=dict)
    nrmse_max: float | None = None
    nrmse_worst: float | None = None
    del_error: dict[str, float] = field(default_factory=dict)
    del_error_max: float | None = None
    delta_e: list[float] = field(default_factory=list)
    delta_e_range: list[float] = field(default_factory=list)

    @property
    def label(self) -> str:
        return f"{self.method} {self.step * 1e3:g} ms"

    def to_dict(self) -> dict[str, Any]:
        return {"delta_t": self.wall.get("median"), **self.__dict__}


def integrators(cases: Cases) -> list[tuple[str, float]]:
    """Every registered method at every step of the ladder that it can afford, and what the campaign lists."""
    from fatigue_runner.integrators import METHODS, method, stability_limit

    speed = min(w.mean_speed for w in cases.winds)
    found = []
    for name in METHODS:
        limit = stability_limit(cases.turbine, name, speed, cases.pitch)
        unstable = [step for step in LADDER if step > limit][-2:]
        stable = [s for s in LADDER if s <= limit and method(name).evaluations_per_step / s <= MOST]
        found += [(name, step) for step in unstable + stable if step <= cases.duration]
    return found + [extra for extra in cases.integrators if extra not in found]


def simulate(cases: Cases, method: str, step: float) -> list[Any]:
    from fatigue_runner.integrators import simulate_block

    groups: dict[Any, list[int]] = {}
    for i, wind in enumerate(cases.winds):
        groups.setdefault(wind.cell_key, []).append(i)
    out: list[Any] = [None] * len(cases.winds)
    for chosen in groups.values():
        winds = [cases.winds[i] for i in chosen]
        block = simulate_block(
            cases.turbine,
            method,
            step,
            winds,
            cases.initial[chosen],
            cases.duration,
            cases.output_step,
            pitch=cases.pitch,
        )
        for i, trajectory in zip(chosen, block, strict=True):
            out[i] = trajectory
    return out


def wall_time(block: Sequence[Any], cases: Cases) -> float:
    """Seconds of the compiled time loop per simulated second and case."""
    return sum(t.wall_time for t in block) / len(block) / cases.duration


@dataclass
class Reference:
    """Trajectories of the reference and their DELs {(channel, exponent): load} per case."""

    trajectories: list[Any]
    loads: list[dict[tuple[str, float], float | None]]


def kept(trajectory: Any, cases: Cases) -> Any:
    from fatigue_runner.campaign.evaluate import discarded

    return discarded(trajectory, cases.discard)


def equivalent_loads(trajectory: Any, cases: Cases) -> dict[tuple[str, float], float | None]:
    """{(channel, exponent): short-term DEL}"""
    from fatigue_runner.fatigue import channel_fatigue

    out: dict[tuple[str, float], float | None] = {}
    for channel in cases.channels:
        found = channel_fatigue(
            trajectory.loads[channel], cases.exponents, trajectory.duration, cases.residue
        )
        out |= {(channel, m): found.load(m) for m in cases.exponents}
    return out


def make_reference(cases: Cases, method: str, step: float) -> Reference:
    block = [kept(t, cases) for t in simulate(cases, method, step)]
    return Reference(block, [equivalent_loads(t, cases) for t in block])


def evaluate(block: Sequence[Any], reference: Reference, cases: Cases, point: Point) -> Point:
    """Fill in a point's errors; nothing but the divergence where a case diverged."""
    from fatigue_runner.accuracy import compare
    from fatigue_runner.fatigue import load_error

    times = [t.diverged_at for t in block if t.diverged_at is not None]
    if times:
        point.diverged, point.diverged_at = len(times), min(times)
        return point
    tests = [kept(t, cases) for t in block]
    found = [compare(a, b) for a, b in zip(tests, reference.trajectories, strict=True)]
    point.nrmse = {
        name: float(np.sqrt(np.mean([f.nrmse[name] ** 2 for f in found]))) for name in found[0].nrmse
    }
    point.nrmse_max = max(point.nrmse.values())
    point.nrmse_worst = max(f.nrmse_max for f in found)
    point.delta_e = [f.delta_e for f in found]
    point.delta_e_range = [f.delta_e_range for f in found]
    errors: dict[str, float] = {}
    for test, theirs in zip(tests, reference.loads, strict=True):
        for key, load in equivalent_loads(test, cases).items():
            error = load_error(load, theirs[key])
            if error is not None:
                errors[key[0]] = max(errors.get(key[0], 0.0), abs(error))
    point.del_error = errors
    point.del_error_max = max(errors.values(), default=None)
    return point


def reference_quality(cases: Cases, reference: Reference) -> list[dict[str, Any]]:
    """Largest NRMSE and DEL error between the reference and other methods and steps of high order."""
    rows = []
    for method, step in CHECKS:
        point = evaluate(
            simulate(cases, method, step), reference, cases, Point(cases.name, method, step, 0.0)
        )
        rows.append(
            {
                "method": method,
                "step": step,
                "nrmse_worst": point.nrmse_worst,
                "del_error_max": point.del_error_max,
            }
        )
    return rows


def measure(
    cases: Cases,
    repeats: int = 5,
    chosen: Sequence[tuple[str, float]] | None = None,
    say: Callable[[str], None] = lambda what: None,
) -> dict[str, Any]:
    """Points of all integrators on one set of cases, and the quality of the reference they are measured against."""
    say(f"{cases.name}: reference {REFERENCE[0]} at {REFERENCE[1] * 1e3:g} ms")
    reference = make_reference(cases, *REFERENCE)
    quality = reference_quality(cases, reference)
    walls: dict[tuple[str, float], list[float]] = {key: [] for key in chosen or integrators(cases)}
    points = []
    with machine.pinned():
        for method, step in walls:
            say(f"{cases.name}: {method} at {step * 1e3:g} ms")
            block = simulate(cases, method, step)
            rate = sum(t.evaluations for t in block) / sum(t.duration or np.inf for t in block)
            points.append(evaluate(block, reference, cases, Point(cases.name, method, step, rate)))
        running = [p for p in points if not p.diverged]
        for round_ in range(repeats):
            say(f"{cases.name}: timing, round {round_ + 1} of {repeats}")
            for p in running:
                walls[p.method, p.step].append(wall_time(simulate(cases, p.method, p.step), cases))
    for p in running:
        p.wall = machine.spread(walls[p.method, p.step])
    return {
        "cases": cases.name,
        "turbine": cases.turbine.name,
        "winds": [w.name for w in cases.winds],
        "duration": cases.duration,
        "reference": {"method": REFERENCE[0], "step": REFERENCE[1], "agreement": quality},
        "points": points,
        "stability_limits": limits(cases),
    }


def limits(cases: Cases) -> list[dict[str, Any]]:
    """Per method: the largest stable step [s] at the cases' winds from the linearised turbine, per evaluation too."""
    from fatigue_runner.integrators import METHODS, method, stability_limit

    speeds = sorted({round(w.mean_speed, 1) for w in cases.winds})
    speeds = speeds[:: max(1, len(speeds) // 4)]
    rows = []
    for name in METHODS:
        limit = min(stability_limit(cases.turbine, name, v, cases.pitch) for v in speeds)
        cost = method(name).evaluations_per_step
        rows.append(
            {"method": name, "limit": limit, "evaluations_per_second": cost / limit if limit else None}
        )
    return rows
