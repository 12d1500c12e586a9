"""What the correctors are asked to reach, and whether they did: judged from the points of one run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from fatigue_runner.benchmark.answers import answers
from fatigue_runner.benchmark.points import Point

CHEAPER, MOONSHOT = 3.0, 5.0  # times, under turbulence
CHEAPER_AT = ("NRMSE 1e-03", "NRMSE 1e-04")
DEL_ERROR, DEL_EVALUATIONS = 1e-3, 30.0  # on every channel, per simulated second
DELTA_E_RANGE, PAPER_STEP, PAPER_TURBINE = 1e-10, 0.01, "t2b1i1cg"  # constant wind, Heun at 10 ms


@dataclass(frozen=True)
class Target:
    """What was asked, what was found, whether that is enough."""

    asked: str
    found: str
    reached: bool

    def __str__(self) -> str:
        return f"{'reached' if self.reached else '**missed**'}: {self.asked}: {self.found}"


def targets(result: dict[str, Any]) -> list[Target]:
    """The targets that a set of cases can judge; none where no corrector fits its turbine."""
    if not any(p.corrected for p in result["points"]):
        return []
    return list(_turbulent(result) if result["turbulent"] else _constant(result))


def _turbulent(result: dict[str, Any]) -> Iterator[Target]:
    for cost, words in (("wall", "time"), ("evaluations", "evaluations")):
        for answer in answers(result, cost):
            if answer.target not in CHEAPER_AT:
                continue
            asked = (
                f"{CHEAPER:g} times less {words} than every classical method at {answer.target} in turbulence"
            )
            if answer.ratio is None:
                yield Target(asked, "one of the two does not get there", False)
                continue
            found = f"{answer.ratio:.2f} times ({answer.corrected.series} against {answer.classical.series})"  # type: ignore[union-attr]
            yield Target(
                asked,
                found + (", the moonshot of 5" if answer.ratio >= MOONSHOT else ""),
                answer.ratio >= CHEAPER,
            )
    yield _loads(result)


def _loads(result: dict[str, Any]) -> Target:
    """DEL error on every channel within a budget of evaluations, the run's first one aside."""
    within = [
        p
        for p in result["points"]
        if p.corrected and p.del_error_max is not None and p.evaluations_per_second < DEL_EVALUATIONS + 0.5
    ]
    asked = f"DEL error at most {DEL_ERROR * 100:g} % on every channel with {DEL_EVALUATIONS:g} evaluations per simulated second"
    if not within:
        return Target(asked, "no corrector is that cheap", False)
    best = min(within, key=_del_error)
    found = f"{best.label}: {_del_error(best) * 100:.2g} % with {best.evaluations_per_second:.3g}"
    return Target(asked, found, _del_error(best) <= DEL_ERROR)


def _del_error(point: Point) -> float:
    return float("inf") if point.del_error_max is None else point.del_error_max


def _constant(result: dict[str, Any]) -> Iterator[Target]:
    """delta_e_range of the corrected Heun at the paper's step; the median over the winds."""
    chosen = [
        p
        for p in result["points"]
        if p.corrected
        and p.method == "heun"
        and result["turbine"] == PAPER_TURBINE
        and abs(p.step - PAPER_STEP) < 1e-9
        and p.delta_e_range
    ]
    if chosen:
        best = min(chosen, key=lambda p: float(np.median(p.delta_e_range)))
        value, worst = float(np.median(best.delta_e_range)), max(best.delta_e_range)
        yield Target(
            f"delta_e_range at most {DELTA_E_RANGE:.0e} with Heun at {PAPER_STEP * 1e3:g} ms in constant wind ({result['turbine']})",
            f"{best.label}: median {value:.1e}, worst wind {worst:.1e}",
            value <= DELTA_E_RANGE,
        )
