"""What the points say: the Pareto front, and the cheapest method for an accuracy, in words."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

from fatigue_runner.benchmark.work_precision import Point

NRMSE_LEVELS = (1e-2, 1e-3, 1e-4, 1e-5)
DEL_LEVELS = (1e-2, 1e-3)
USELESS = 0.1  # a point with a larger error is no answer to anything

Cost = Callable[[Point], float | None]
Error = Callable[[Point], float | None]


def wall(point: Point) -> float | None:
    return point.wall.get("median")


def evaluations(point: Point) -> float | None:
    return point.evaluations_per_second


def nrmse(point: Point) -> float | None:
    return point.nrmse_max


def del_error(point: Point) -> float | None:
    return point.del_error_max


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


def cheapest(points: Iterable[Point], cost: Cost, error: Error, level: float) -> list[Point]:
    """Of every method its cheapest point with at most that error, the cheapest method first."""
    by_method: dict[str, tuple[float, Point]] = {}
    for p in points:
        c, e = cost(p), error(p)
        if p.diverged or c is None or e is None or e > level:
            continue
        if p.method not in by_method or c < by_method[p.method][0]:
            by_method[p.method] = c, p
    return [p for _, p in sorted(by_method.values(), key=lambda item: item[0])]


def sentences(points: Sequence[Point], cost: Cost = wall) -> list[str]:
    """One sentence per accuracy."""
    out = []
    for label, error, levels in (("NRMSE", nrmse, NRMSE_LEVELS), ("DEL error", del_error, DEL_LEVELS)):
        for level in levels:
            target = f"{label} {level:.0e}" if label == "NRMSE" else f"{label} {level * 100:g} %"
            found = cheapest(points, cost, error, level)
            if not found:
                out.append(f"{target}: no method on the ladder reaches it.")
                continue
            first = found[0]
            text = f"{target}: {first.label} is cheapest with {_cost(first)}"
            if len(found) > 1:
                second = found[1]
                text += f"; next {second.label} with {_cost(second)} ({cost(second) / cost(first):.2f} times the cost)"  # type: ignore[operator]
            out.append(text + ".")
    return out


def _cost(point: Point) -> str:
    time = point.wall.get("median")
    shown = f"{time * 1e6:.3g} us and " if time is not None else ""
    return f"{shown}{point.evaluations_per_second:.4g} evaluations per simulated second"


def summary(result: dict[str, Any]) -> dict[str, Any]:
    """The answers of one set of cases as plain values."""
    points = result["points"]
    return {
        "front_wall_nrmse": [p.label for p in front(points, wall, nrmse)],
        "front_evaluations_nrmse": [p.label for p in front(points, evaluations, nrmse)],
        "front_wall_del_error": [p.label for p in front(points, wall, del_error)],
        "sentences": sentences(points),
    }
