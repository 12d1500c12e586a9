"""What this project set out to reach, judged from the figures of its own benchmarks.

    fatigue-runner benchmark work-precision --json work.json      (also: wind, logs, live)
    python tools/targets.py work.json wind.json logs.json live.json

Prints a line per target, `reached` or `missed` with what was found; exit code 1 where one is missed. Targets are the developers'
measure of their work, no property of an integrator: the commands themselves only say what they measured.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from fatigue_runner.benchmark.study.answers import answers
from fatigue_runner.benchmark.study.paper import Claim
from fatigue_runner.benchmark.study.points import Point
from fatigue_runner.turbine.turbine import FIXED

# Times cheaper than every classical method under turbulence, and what would be more than asked: evaluations; time where the turbine
# operates, whose f is the dearer one.
CHEAPER = {"evaluations": (2.0, 3.0), "wall": (1.5, 3.0)}
CHEAPER_AT = ("NRMSE 1e-03", "NRMSE 1e-04", "DEL error 1 %", "DEL error 0.1 %")
DEL_ERROR, DEL_EVALUATIONS = 1e-3, 30.0  # on every channel, per simulated second
DELTA_E_RANGE, PAPER_STEP, PAPER_TURBINE = 1e-10, 0.01, "t2b1i1cg"  # constant wind, Heun at 10 ms
LOG_ROWS = 500_000  # per second and core, written or read, of three topics with zstd
WATCHED = 0.2  # of a core, which is what a watched campaign gives by default where it leaves none idle
SERIES_SECONDS, FIELD_SECONDS = (
    3.0,
    1.0,
)  # 66 ten-minute series, a field of 15 x 15 points and 660 s: M = 6, one core
HARMONICS_COST = {3: 1.25, 6: 1.4}  # an evaluation with M harmonics over one with mean and linear shears


def judged(figures: dict[str, Any]) -> list[Claim]:
    """The targets that the figures of a benchmark (`--json`) can judge."""
    if "cases" in figures and "identity" in figures:
        return [claim for part in figures["cases"] for claim in of_integrators(part)]
    if "harmonics" in figures:
        return list(_of_wind(figures))
    if "writers" in figures:
        ours = "fatigue-runner, zstd"
        return [
            _at_least(f"{LOG_ROWS:,} rows per second {done}", figures[key][ours]["per_second"])
            for key, done in (("writers", "written"), ("readers", "read"))
        ]
    if "situations" in figures:
        found = f"{figures['slower']:.2g} (more than unwatched)"
        return [
            Claim(
                f"a watched campaign waits for at most {WATCHED:g} of a core",
                found,
                figures["slower"] <= WATCHED,
            )
        ]
    return []


def _of_wind(figures: dict[str, Any]) -> Iterator[Claim]:
    """What making wind and blowing with harmonics cost."""
    for row in figures["harmonics"]:
        m = row["harmonics"]
        if m == max(HARMONICS_COST):
            for key, what, most in (
                ("series_seconds", f"{figures['series']} ten-minute series", SERIES_SECONDS),
                ("field_seconds", "a field of 15 x 15 points and 660 s on the rotor", FIELD_SECONDS),
            ):
                asked = f"{what} with {m} harmonics in at most {most:g} s of one core"
                yield Claim(asked, f"{row[key]:.2f} s", row[key] <= most)
        if m in HARMONICS_COST:
            asked = (
                f"an evaluation with {m} harmonics at most {HARMONICS_COST[m]:g} times one with linear shears"
            )
            yield Claim(asked, f"{row['ratio']:.2f} times", row["ratio"] <= HARMONICS_COST[m])


def _at_least(asked: str, found: float) -> Claim:
    return Claim(asked, f"{found:,.0f}", found >= LOG_ROWS)


def of_integrators(result: dict[str, Any]) -> list[Claim]:
    """Those that a set of cases can judge; none where no corrector fits its turbine."""
    result = {**result, **{key: [_point(p) for p in result[key]] for key in ("points", "adaptive")}}
    if not any(p.corrected for p in result["points"]):
        return []
    return list(_turbulent(result) if result["turbulent"] else _constant(result))


def _point(given: Any) -> Point:
    return given if isinstance(given, Point) else Point.from_dict(given)


def _turbulent(result: dict[str, Any]) -> Iterator[Claim]:
    operates = result.get("operation", FIXED) != FIXED
    where = "operation" if operates else "turbulence"
    for cost, words in (
        (("wall", "time"), ("evaluations", "evaluations")) if operates else (("evaluations", "evaluations"),)
    ):
        asked_for, moonshot = CHEAPER[cost]
        for answer in answers(result, cost):
            if answer.target not in CHEAPER_AT:
                continue
            asked = (
                f"{asked_for:g} times less {words} than every classical method at {answer.target} in {where}"
            )
            if answer.ratio is None:
                yield Claim(asked, "one of the two does not get there", False)
                continue
            found = f"{answer.ratio:.2f} times ({answer.corrected.series} against {answer.classical.series})"  # type: ignore[union-attr]
            more = f", the moonshot of {moonshot:g}" if answer.ratio >= moonshot else ""
            yield Claim(asked, found + more, answer.ratio >= asked_for)
    yield _loads(result)


def _loads(result: dict[str, Any]) -> Claim:
    """DEL error on every channel within a budget of evaluations, the run's first one aside."""
    within = [
        p
        for p in result["points"]
        if p.corrected and p.del_error_max is not None and p.evaluations_per_second < DEL_EVALUATIONS + 0.5
    ]
    asked = f"DEL error at most {DEL_ERROR * 100:g} % on every channel with {DEL_EVALUATIONS:g} evaluations per simulated second"
    if not within:
        return Claim(asked, "no corrector is that cheap", False)
    best = min(within, key=_del_error)
    found = f"{best.label}: {_del_error(best) * 100:.2g} % with {best.evaluations_per_second:.3g}"
    return Claim(asked, found, _del_error(best) <= DEL_ERROR)


def _del_error(point: Point) -> float:
    return float("inf") if point.del_error_max is None else point.del_error_max


def _constant(result: dict[str, Any]) -> Iterator[Claim]:
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
        yield Claim(
            f"delta_e_range at most {DELTA_E_RANGE:.0e} with Heun at {PAPER_STEP * 1e3:g} ms in constant wind ({result['turbine']})",
            f"{best.label}: median {value:.1e}, worst wind {worst:.1e}",
            value <= DELTA_E_RANGE,
        )


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("figures", nargs="+", type=Path, help="JSON of `fatigue-runner benchmark ... --json`")
    missed = 0
    for path in parser.parse_args().figures:
        found = judged(json.loads(path.read_text(encoding="utf-8")))
        print("\n".join(f"- {claim}" for claim in found) or f"{path}: nothing here was a target")
        missed += sum(not claim.reached for claim in found)
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
