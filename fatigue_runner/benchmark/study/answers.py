"""What the points say: the Pareto front, and the cheapest integrator for an accuracy, classical against corrected.

The cost of an accuracy is read from a method's curve: between the two neighbouring steps whose errors enclose it, by a straight
line in log cost over log error; where already the largest useful step is closer, or a step between the two is unstable, the
closer step's cost. Never extrapolated: a curve that
does not reach an accuracy has no cost for it. A corrector's curve runs through the steps it was trained for; one between them takes
seconds to train.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from fatigue_runner.benchmark.study.integrators import ADAPTIVE, CLASSICAL
from fatigue_runner.benchmark.study.points import Point
from fatigue_runner.integrators import ENHANCED, HYBRID

NRMSE_LEVELS = (1e-2, 1e-3, 1e-4, 1e-5)
DEL_LEVELS = (1e-2, 1e-3)
USELESS = 0.1  # a point with a larger error is no answer to anything
PLAIN, CORRECTED = (CLASSICAL, ADAPTIVE), (ENHANCED, HYBRID)

Cost = Callable[[Point], float | None]
Error = Callable[[Point], float | None]


def wall(point: Point) -> float | None:
    return point.wall.get("median")


def evaluations(point: Point) -> float | None:
    return point.evaluations_per_second


def delta_t(point: Point) -> float | None:
    """Per case of many."""
    return point.delta_t.get("lane")


def nrmse(point: Point) -> float | None:
    return point.nrmse_max


def del_error(point: Point) -> float | None:
    return point.del_error_max


COSTS: dict[str, Cost] = {"wall": wall, "evaluations": evaluations, "delta_t": delta_t}
LEVELS: tuple[tuple[str, Error, float], ...] = (
    *((f"NRMSE {level:.0e}", nrmse, level) for level in NRMSE_LEVELS),
    *((f"DEL error {level * 100:g} %", del_error, level) for level in DEL_LEVELS),
)


def front(points: Iterable[Point], cost: Cost, error: Error) -> list[Point]:
    """Points that no other one beats in both cost and error, the cheapest first; none that diverged."""
    usable = []
    for p in points:
        c, e = cost(p), error(p)
        if not p.diverged and c is not None and e is not None and e < USELESS:
            usable.append((c, e, p))
    found: list[Point] = []
    best = float("inf")
    for _, e, p in sorted(usable, key=lambda item: item[:2]):
        if e < best:
            best = e
            found.append(p)
    return found


@dataclass(frozen=True)
class Reached:
    """What an accuracy costs on one curve: time and delta_t [s] (None where they were not measured), evaluations, all per simulated
    second; step [s].

    between: the labels of the points that it was read between, or of the one that has it.
    """

    series: str
    kind: str
    wall: float | None
    evaluations: float
    delta_t: float | None
    step: float
    between: tuple[str, ...]

    def cost(self, name: str) -> float:
        """One of `COSTS` by its name."""
        value = getattr(self, name)
        assert value is not None
        return value


def reach(points: Sequence[Point], cost: Cost, error: Error, level: float) -> Reached | None:
    """The cheapest way to an error of at most `level` on one curve; None where the curve does not get there."""
    curve = front(points, cost, error)
    errors = [error(p) or 0.0 for p in curve]
    i = next((i for i, e in enumerate(errors) if e <= level), None)
    if i is None:
        return None
    here = curve[i]
    if i == 0 or errors[i] <= 0.0 or _broken(points, error, curve[i - 1], here):
        return Reached(
            here.series,
            here.kind,
            wall(here),
            here.evaluations_per_second,
            delta_t(here),
            here.step,
            (here.label,),
        )
    before = curve[i - 1]
    share = math.log(errors[i - 1] / level) / math.log(errors[i - 1] / errors[i])

    def between(value: Callable[[Point], float | None]) -> float | None:
        a, b = value(before), value(here)
        return None if a is None or b is None else a * (b / a) ** share

    rate, step = between(evaluations), between(lambda p: p.step)
    assert rate is not None and step is not None
    return Reached(
        here.series, here.kind, between(wall), rate, between(delta_t), step, (before.label, here.label)
    )


def _broken(points: Sequence[Point], error: Error, before: Point, after: Point) -> bool:
    """Whether a step between two others diverged or was useless: no step between them can be trusted to lie on the line."""
    low, high = sorted((before.step, after.step))
    inside = [p for p in points if low < p.step < high]
    return any(p.diverged or (e := error(p)) is None or e >= USELESS for p in inside)


def ranking(points: Iterable[Point], cost: str, error: Error, level: float) -> list[Reached]:
    """What every curve needs for an accuracy, the cheapest first."""
    curves: dict[str, list[Point]] = {}
    for p in points:
        curves.setdefault(p.series, []).append(p)
    found = [reach(curve, COSTS[cost], error, level) for curve in curves.values()]
    return sorted((r for r in found if r is not None), key=lambda r: r.cost(cost))


@dataclass(frozen=True)
class Answer:
    """The cheapest classical and the cheapest corrected integrator for an accuracy."""

    target: str
    cost: str
    classical: Reached | None
    corrected: Reached | None

    @property
    def ratio(self) -> float | None:
        """How many times cheaper the corrected one is; below 1 it is dearer; None where one of them does not get there."""
        if self.classical is None or self.corrected is None:
            return None
        return self.classical.cost(self.cost) / self.corrected.cost(self.cost)

    def to_dict(self) -> dict[str, Any]:
        both = {
            name: asdict(r) if r else None
            for name, r in (("classical", self.classical), ("corrected", self.corrected))
        }
        return {"target": self.target, "cost": self.cost, **both, "ratio": self.ratio}


def exponential(point: Point) -> bool:
    """Whether a method integrates the turbine's linear part exactly: one that knows its Jacobian beforehand."""
    from fatigue_runner.integrators import METHODS, method

    return point.method in METHODS and method(point.method).growth(np.zeros(1, complex)) is None


def answers(result: dict[str, Any], cost: str, with_exponential: bool = True) -> list[Answer]:
    """One per accuracy. The adaptive methods count by their evaluations; SciPy's time is an interpreter's.

    with_exponential: False leaves the exponential methods out of the classical ones.
    """
    points = [*result["points"], *(result["adaptive"] if cost == "evaluations" else ())]
    if not with_exponential:
        points = [p for p in points if p.corrected or not exponential(p)]
    out = []
    for target, error, level in LEVELS:
        found = ranking(points, cost, error, level)
        best = [next((r for r in found if r.kind in kinds), None) for kinds in (PLAIN, CORRECTED)]
        out.append(Answer(target, cost, *best))
    return out


@dataclass(frozen=True)
class Duel:
    """One corrected point against the cheapest classical curve at the same error; ratios above 1: the corrected one is cheaper."""

    point: Point
    error: float
    rivals: dict[str, Reached | None]  # by cost

    def ratio(self, cost: str) -> float | None:
        rival, own = self.rivals[cost], COSTS[cost](self.point)
        return None if rival is None or own is None else rival.cost(cost) / own


def duels(result: dict[str, Any], error: Error = nrmse) -> list[Duel]:
    """Every corrected point that did not diverge against what the classical methods need for its own error: nothing of the corrected
    ones is interpolated here."""
    plain = [p for p in result["points"] if not p.corrected]
    out = []
    for p in result["points"]:
        own = error(p)
        if not p.corrected or own is None:
            continue
        rivals = {}
        for cost in COSTS:
            found = ranking(
                [*plain, *(result["adaptive"] if cost == "evaluations" else ())], cost, error, own
            )
            rivals[cost] = found[0] if found else None
        out.append(Duel(p, own, rivals))
    return out


@dataclass(frozen=True)
class InWind:
    """A corrected point in one mean wind; alone: the method without its corrector at the same step; rival: the classical method with
    the fewest evaluations for at most the corrected one's DEL error there."""

    wind: str
    point: Point
    alone: Point | None
    rival: Reached | None

    @property
    def ratio(self) -> float | None:
        """How many times fewer evaluations than the rival."""
        return None if self.rival is None else self.rival.evaluations / self.point.evaluations_per_second


def in_winds(result: dict[str, Any]) -> list[InWind]:
    """Every corrected point that did not diverge in each mean wind of a turbine that operates; nothing of others."""
    out = []
    usable = [p for p in result["points"] if p.by_wind and not p.diverged]
    for corrected in (p for p in usable if p.corrected):
        for wind in corrected.by_wind:
            own, plain = corrected.at(wind), [p.at(wind) for p in usable if not p.corrected]
            same = (p for p in plain if p.method == own.method and math.isclose(p.step, own.step))
            found = ranking(plain, "evaluations", del_error, own.del_error_max or 0.0)
            out.append(InWind(wind, own, next(same, None), found[0] if found else None))
    return out
