"""The experiment of arXiv:2504.05493 measured: classical methods, its network and other corrections of Heun, on unseen winds.

Its cost is delta_t (`results.evaluation_cost`), here by four kinds of f and N: `paper`, an f of 1.5 ms, as the paper's axes imply, and N
in NumPy; `interpreter`, this program's own f line by line in Python, and N in NumPy; `single` and `lane`, compiled, for one case alone and
per case of many. The ratio time(N) / time(f) decides whether a correction pays: `break_evens`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fatigue_runner import shipped
from fatigue_runner.benchmark.speed import machine, right_hand_side
from fatigue_runner.benchmark.study.cases import Cases, load
from fatigue_runner.benchmark.study.integrators import series
from fatigue_runner.integrators import ENHANCED, HYBRID, METHODS, MODES, Integrator, stability_limit
from fatigue_runner.results.evaluation_cost import F, break_even, delta_ts

TURBINE = "t2b1i1cg"
CLASSICAL = ("heun", "rk3", "heun-richardson")
STEPS = (
    0.015,
    0.01,
    0.005,
    0.0025,
    0.002,
    0.001,
    0.0005,
    0.0002,
)  # s, as the paper's axis runs; RK3 at 15 ms costs what Heun does at 10
BOXED = (0.01, 0.005)
BESIDE = {0.01: 0.015, 0.005: 0.01}  # s: RK3's step in the paper's box plots in range, beside the others'
# Of the methods that the paper does not compare with, down to where they are closer than any corrected Heun.
LONG_STEPS = (0.2, 0.15, 0.1, 0.07, 0.05, 0.035, 0.025, 0.02, 0.015, 0.01)
PAPER_F = 1.5e-3  # s of one evaluation of f: the paper does not print it, the axes of its figures imply it
KINDS = {
    "paper": "f of 1.5 ms",
    "interpreter": "f in Python",
    "single": "compiled, one case",
    "lane": "compiled, per case of many",
}
# Its trajectories agree with RK7 at 0.1 ms, the paper's reference, to 1e-10 of each state's range, in a fiftieth of the steps.
REFERENCE = ("dop853", 0.0025)
REPEATS = 3
ERRORS = ("nrmse_max", "nrmse_mean", "delta_e", "delta_e_range")

Say = Callable[[str], None]


@dataclass
class Outcome:
    """One integrator on a set of winds. Lists have an entry per wind; None where it diverged; costs per simulated second: evaluations,
    measured time and delta_t by kind [s]."""

    label: str
    method: str
    step: float
    mode: str
    evaluations: float
    wall: float
    corrector: str = ""
    delta_t: dict[str, float] = field(default_factory=dict)
    nrmse_max: list[float | None] = field(default_factory=list)
    nrmse_mean: list[float | None] = field(default_factory=list)
    delta_e: list[float | None] = field(default_factory=list)
    delta_e_range: list[float | None] = field(default_factory=list)
    accepted: list[float] = field(default_factory=list)

    def values(self, name: str, chosen: Sequence[bool] | None = None) -> np.ndarray:
        """Finite values of an error, of the chosen winds only."""
        found = getattr(self, name)
        keep = [True] * len(found) if chosen is None else chosen
        return np.array([v for v, k in zip(found, keep, strict=True) if k and v is not None])


def compared(correctors: Sequence[Any], steps: Sequence[float] = STEPS) -> list[Integrator]:
    """The classical methods at all steps, and every corrector in both modes at its own step."""
    plain = [Integrator(method, step) for method in CLASSICAL for step in steps]
    return plain + [Integrator(c.method, c.step, c, mode) for c in correctors for mode in MODES]


def speeds(cases: Cases) -> list[float]:
    return [float(w.mean_speed) for w in cases.ensemble.winds]


def outcome(
    cases: Cases, integrator: Integrator, reference: Sequence[Any], repeats: int = REPEATS
) -> Outcome:
    """Errors against the reference; of the time, the least of the repeats: other work of the machine only adds to it. Runs of steps
    below a millisecond are long enough to be timed once."""
    from fatigue_runner.results.accuracy import compare

    runs = cases.run(integrator)
    walls = [sum(r.wall_time for r in runs)]
    walls += [
        sum(r.wall_time for r in cases.run(integrator))
        for _ in range(repeats - 1 if integrator.step >= 1e-3 else 0)
    ]
    seconds = len(runs) * cases.duration
    evaluations = sum(r.evaluations for r in runs) / seconds
    out = Outcome(
        series(integrator), integrator.method, integrator.step, integrator.corrected_mode, evaluations, min(walls) / seconds,
        integrator.corrector_name,
    )  # fmt: skip
    for run, exact in zip(runs, reference, strict=True):
        found = compare(run, exact) if run.diverged_at is None else None
        for name in ERRORS:
            getattr(out, name).append(None if found is None else getattr(found, name))
        out.accepted.append(float(run.accepted.mean()))
    return out


def measure(
    campaign: str | Path | Mapping[str, Any],
    correctors: Sequence[Any],
    steps: Sequence[float] = STEPS,
    say: Say = lambda what: None,
    long_steps: bool = False,
) -> dict[str, Any]:
    """All integrators on a campaign's winds: {name, turbine, speeds, reference, evaluation_times, outcomes, others}. Raises InputError
    for a corrector that does not fit the campaign's turbine.

    long_steps: with the methods that the paper does not compare with, in `others`.
    """
    cases = load(campaign)[0][0]
    reference = cases.run(Integrator(*REFERENCE))
    outcomes, others = [], []
    with machine.pinned():
        say(f"{cases.name}: one evaluation of f, and of every corrector")
        times = evaluations(cases, correctors)
        for integrator in compared(correctors, steps):
            say(f"{cases.name}: {integrator.label}")
            outcomes.append(outcome(cases, integrator, reference))
        for integrator in beyond(cases) if long_steps else ():
            others.append(outcome(cases, integrator, reference, repeats=1))
    for o in (*outcomes, *others):
        o.delta_t = delta_ts(times, o.evaluations, o.step, o.corrector)
    return {
        "name": cases.name,
        "turbine": cases.ensemble.turbine.name,
        "speeds": speeds(cases),
        "reference": {"method": REFERENCE[0], "step": REFERENCE[1]},
        "evaluation_times": times,
        "outcomes": outcomes,
        "others": others,
    }


def beyond(cases: Cases) -> list[Integrator]:
    """The methods that the paper does not compare with, at the long steps at which they are stable."""
    turbine, found = cases.ensemble.turbine, []
    for name in METHODS:
        if name in CLASSICAL:
            continue
        limit = stability_limit(turbine, name, 8.0, cases.pitch)
        found += [Integrator(name, step) for step in LONG_STEPS if step < limit and step <= cases.duration]
    return found


def evaluations(cases: Cases, correctors: Sequence[Any]) -> dict[str, dict[str, float]]:
    """{`f` or the name of a corrector: {kind: seconds of one evaluation}}, kinds as `KINDS`."""
    from fatigue_runner.integrators.evaluation_times import evaluation_times

    found = evaluation_times(cases.ensemble, [Integrator(c.method, c.step, c) for c in correctors])
    own = right_hand_side.interpreted(cases.ensemble.turbine)
    x, wind = cases.ensemble.initial[0].tolist(), [float(cases.ensemble.winds[0].mean_speed), 0.0, 0.0]
    found[F] |= {"paper": PAPER_F, "interpreter": _median_time(lambda: own(x, wind))}
    for c in correctors:
        in_numpy = _median_time(_one_prediction(cases, c))
        found[c.name] |= {"paper": in_numpy, "interpreter": in_numpy}
    return found


def _one_prediction(cases: Cases, corrector: Any) -> Callable[[], Any]:
    """The correction of one sampled step in NumPy; its features are there."""
    from fatigue_runner.integrators import Ensemble, simulate

    turbine, found = cases.ensemble.turbine, corrector.map
    wind, initial = cases.ensemble.winds[:1], cases.ensemble.initial[:1]
    grid = found.reference_step(corrector.step)
    duration = 20 * max(corrector.step, grid)
    ensemble = Ensemble(turbine, wind, initial, duration, grid, cases.ensemble.pitch)
    runs = simulate(ensemble, Integrator("rk4", min(grid, corrector.step)))
    sampled = found.sample(corrector.binding, turbine, wind, runs, 1, 0)
    return lambda: corrector.predict(sampled)


def _median_time(work: Callable[[], Any], count: int = 2000) -> float:
    """Median processor time of one call [s]: calls are long against the clock's grain."""
    found = []
    for _ in range(count):
        begin = time.thread_time_ns()
        work()
        found.append(time.thread_time_ns() - begin)
    return float(np.median(found)) * 1e-9


def both(
    names: Sequence[str] | None = None, say: Say = lambda what: None
) -> tuple[dict[str, Any], dict[str, Any]]:
    """In range at all steps, out of range at the boxed ones, with correctors by name or path; None: every shipped one of Heun for
    the paper's turbine at a boxed step."""
    from fatigue_runner.corrector import correctors, find

    if names is None:
        chosen = [c for c in correctors() if (c.turbine, c.method) == (TURBINE, "heun") and c.step in BOXED]
    else:
        chosen = [find(name) for name in names]
    inside, outside = (
        measure(shipped.campaign(f"paper_{which}"), chosen, steps, say, long_steps=which == "in_range")
        for which, steps in (("in_range", STEPS), ("out_of_range", BOXED))
    )
    return inside, outside


def rows(measured: dict[str, Any], chosen: Sequence[bool] | None = None) -> list[dict[str, Any]]:
    """A table's rows: per integrator the median, the largest and the quartiles of the errors over the chosen winds."""
    out = []
    for o in measured["outcomes"]:
        row: dict[str, Any] = {
            "integrator": o.label,
            "step": o.step,
            "evaluations": o.evaluations,
            "wall": o.wall,
            "delta_t": o.delta_t,
        }
        for name in ERRORS:
            values = o.values(name, chosen)
            if values.size:
                low, median, high = np.quantile(values, (0.25, 0.5, 0.75)).tolist()
                row[name] = {"low": low, "median": median, "high": high, "worst": float(values.max())}
        row["diverged"] = sum(v is None for v in o.nrmse_max)
        keep = chosen or [True] * len(o.accepted)
        row["accepted"] = float(np.mean([a for a, k in zip(o.accepted, keep, strict=True) if k]))
        out.append(row)
    return out


def worse_than_rk3(measured: dict[str, Any], outcome: Outcome) -> tuple[int, float] | None:
    """On how many winds an integrator with a corrector is further from the reference than RK3 at its step by more than 1 %,
    and the largest ratio of their RMS errors; None where RK3 did not run there or there is no corrector."""
    rival = next((o for o in measured["outcomes"] if (o.label, o.step) == ("rk3", outcome.step)), None)
    if rival is None or not outcome.mode:
        return None
    ratios = [
        float("inf") if a is None else (a / b) ** 0.5
        for a, b in zip(outcome.delta_e_range, rival.delta_e_range, strict=True)
        if b
    ]
    return sum(r > 1.01 for r in ratios), max(ratios, default=0.0)


def at_equal_cost(measured: dict[str, Any], outcome: Outcome) -> float | None:
    """Median delta_e_range of RK3 at an integrator's evaluations per second, the paper's cost where f is slow, read from RK3's curve
    (straight in log-log); None outside of it."""
    curve = sorted((o for o in measured["outcomes"] if o.label == "rk3"), key=lambda o: o.evaluations)
    costs, errors = (
        [o.evaluations for o in curve],
        [float(np.median(o.values("delta_e_range"))) for o in curve],
    )
    # an evaluation at the start more or less is no cost
    if not curve or not costs[0] * 0.99 <= outcome.evaluations <= costs[-1]:
        return None
    return float(np.exp(np.interp(np.log(outcome.evaluations), np.log(costs), np.log(errors))))


@dataclass(frozen=True)
class BreakEven:
    """A corrected Heun and the classical method that needs the fewest evaluations for its median delta_e_range in range.

    ratio: time(N) / time(f) above which the classical one is cheaper by delta_t; None where it is at any ratio. measured: that ratio by
    kind.
    """

    outcome: Outcome
    rival: str
    evaluations: float
    ratio: float | None
    measured: dict[str, float]

    def pays(self, kind: str) -> bool:
        """Whether the corrected one is cheaper where evaluations cost what they do by this kind of f and N."""
        return self.ratio is not None and self.measured[kind] < self.ratio


def break_evens(measured: dict[str, Any], everyone: bool = False) -> list[BreakEven]:
    """One per corrector and mode, against the paper's classical methods, or everyone's that this program has."""
    times, found = measured["evaluation_times"], []
    for o in measured["outcomes"]:
        if not o.mode:
            continue
        error = float(np.median(o.values("delta_e_range")))
        rivals = needed(measured, error, everyone)
        if not rivals:
            continue
        name = min(rivals, key=lambda name: rivals[name])
        ratios = {kind: times[o.corrector][kind] / times[F][kind] for kind in KINDS}
        ratio = break_even(o.evaluations, o.step, rivals[name])
        found.append(BreakEven(o, name, rivals[name], ratio, ratios))
    return found


def needed(measured: dict[str, Any], error: float, everyone: bool = False) -> dict[str, float]:
    """{classical method: evaluations per second for a median delta_e_range of `error`}, straight in log-log between its steps; where
    its longest step is closer, what that costs; nothing of a method that does not get there."""
    curves: dict[str, list[Outcome]] = {}
    for o in (*measured["outcomes"], *(measured["others"] if everyone else ())):
        if not o.mode and all(v is not None for v in o.delta_e_range):
            curves.setdefault(o.label, []).append(o)
    found = {}
    for name, curve in curves.items():
        # NumPy interpolates over what grows: the largest error is the cheapest
        points = sorted((float(np.median(o.values("delta_e_range"))), o.evaluations) for o in curve)
        errors, costs = (np.log([p[i] for p in points]) for i in (0, 1))
        if np.log(error) >= errors[0]:
            found[name] = float(np.exp(np.interp(np.log(error), errors, costs)))
    return found


@dataclass(frozen=True)
class Claim:
    """What was claimed or asked, what was found, whether that is enough."""

    asked: str
    found: str
    reached: bool

    def __str__(self) -> str:
        return f"{'reached' if self.reached else '**missed**'}: {self.asked}: {self.found}"


def claims(inside: dict[str, Any], outside: dict[str, Any]) -> list[Claim]:
    """The paper's claims, per corrector: closer than RK3 at equal evaluations in range, a hybrid nowhere worse than RK3 at its step."""
    found = []
    for o in inside["outcomes"]:
        rival = at_equal_cost(inside, o)
        if o.mode == ENHANCED and rival is not None:
            own = float(np.median(o.values("delta_e_range")))
            asked = f"{o.label.removesuffix(', enhanced')} at {o.step * 1e3:g} ms closer than RK3 at as many evaluations, in range"
            found.append(Claim(asked, f"{own:.1e} against {rival:.1e}", own < rival))
    for b in break_evens(inside):
        o = b.outcome
        limit = "at any time of N" if b.ratio is None else f"where time(N) > {b.ratio:.2g} time(f)"
        for kind in ("paper", "lane") if o.mode == ENHANCED else ():
            who = f"{o.label.removesuffix(', enhanced')} at {o.step * 1e3:g} ms"
            asked = f"{who} cheaper by delta_t than the paper's classical methods, in range, {KINDS[kind]}"
            said = f"{b.rival} with {b.evaluations:.0f} evaluations a second is cheaper {limit}; measured {b.measured[kind]:.2g}"
            found.append(Claim(asked, said, b.pays(kind)))
    if all_methods := break_evens(inside, everyone=True):
        best = min(all_methods, key=lambda b: b.outcome.evaluations / b.evaluations)
        asked = "a corrected Heun with fewer evaluations than every classical method of this program for its error, in range"
        said = f"at best {best.outcome.evaluations:.0f} a second ({best.outcome.label}) against {best.evaluations:.0f} of {best.rival}"
        found.append(Claim(asked, said, best.ratio is not None))
    for o in outside["outcomes"]:
        worse = worse_than_rk3(outside, o)
        if o.mode == HYBRID and worse is not None:
            asked = f"{o.label} at {o.step * 1e3:g} ms on no wind up to 20 m/s more than 1 % further off than RK3 at the same step"
            said = f"{worse[0]} of {len(o.delta_e_range)} winds, RMS error at most {worse[1]:.4g} times RK3's"
            found.append(Claim(asked, said, worse[0] == 0))
    return found


def to_json(measured: dict[str, Any]) -> dict[str, Any]:
    return {**measured, **{key: [asdict(o) for o in measured[key]] for key in ("outcomes", "others")}}
