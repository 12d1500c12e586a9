"""Shipped correctors against the classical methods on unseen winds: error, evaluations and whole-step time, in one run.

    python tools/prove_correctors.py [--stability]

Times are CPU times of one thread, methods interleaved, the median of rounds: ratios mean something on a busy machine.
--stability: every corrector over 100 unseen seeds of 600 s instead; what diverges, enhanced and hybrid.
"""

from __future__ import annotations

import sys
import time
from typing import Any

import numpy as np

from fatigue_runner.campaign.evaluate import discarded
from fatigue_runner.campaign.initial import initial_state
from fatigue_runner.corrector import correctors
from fatigue_runner.integrators import block as block_module
from fatigue_runner.integrators import simulate_block
from fatigue_runner.turbine import load_turbine
from fatigue_runner.wind import TurbulentWind

CLASSICAL = (
    [("dop853", h) for h in (0.25, 0.2, 0.175, 0.15, 0.125, 0.1, 0.075)]
    + [("rk4", h) for h in (0.12, 0.1, 0.075, 0.05, 0.03)]
    + [("tsit5", h) for h in (0.1, 0.075, 0.05)]
    + [("bs32", h) for h in (0.08, 0.05, 0.02)]
    + [("heun", h) for h in (0.02, 0.01, 0.005)]
    + [("etdrk4", h) for h in (0.2, 0.175, 0.15, 0.125, 0.1, 0.075, 0.05)]
)
DURATION, DISCARD, OUTPUT, ROUNDS = 130.0, 10.0, 0.6, 5


def winds(count: int, duration: float, seed: int) -> list[TurbulentWind]:
    speeds = np.linspace(5.0, 10.0, count)
    return [
        TurbulentWind(float(v), intensity=0.14, seed=seed + i, duration=duration)
        for i, v in enumerate(speeds)
    ]


def errors(runs: list[Any], reference: list[Any]) -> np.ndarray:
    out = np.full(len(runs), np.inf)
    for i, (run, true) in enumerate(zip(runs, reference, strict=True)):
        if run.diverged_at is None:
            a, b = discarded(run, DISCARD).state, discarded(true, DISCARD).state
            out[i] = (np.sqrt(((a - b) ** 2).mean(axis=0)) / np.ptp(b, axis=0)).max()
    return out


def work_precision() -> None:
    turbine = load_turbine("nrel5mw")
    unseen = winds(16, DURATION, 7_000_000)
    start = np.array([initial_state(turbine, "operating-point", w) for w in unseen])
    reference = simulate_block(turbine, "rk7", 0.01, unseen, start, DURATION, OUTPUT)
    block_module.clock = time.thread_time
    found = [c for c in correctors() if c.turbine == "nrel5mw"]
    work: list[tuple[str, str, float, Any, str]] = [
        (f"{m} {h * 1e3:g} ms", m, h, None, "enhanced") for m, h in CLASSICAL
    ]
    work += [
        (f"{c.name} {mode}", c.method, c.step, c, mode) for c in found for mode in ("enhanced", "hybrid")
    ]
    times: dict[str, list[float]] = {name: [] for name, *_ in work}
    rows = {}
    for _ in range(ROUNDS + 1):
        for name, method, step, corrector, mode in work:
            runs = simulate_block(
                turbine, method, step, unseen, start, DURATION, OUTPUT, corrector=corrector, mode=mode
            )
            times[name].append(sum(r.wall_time for r in runs) / len(runs) / DURATION * 1e6)
            if name not in rows:
                e = errors(runs, reference)
                rows[name] = float(np.median(e)), float(e.max()), runs[0].evaluations / DURATION
    print("| integrator | NRMSE median | worst | evaluations/s | CPU µs/s |\n|---|---|---|---|---|")
    for name, (median, worst, evaluations) in sorted(rows.items(), key=lambda row: row[1][0]):
        print(
            f"| {name} | {median:.1e} | {worst:.1e} | {evaluations:.1f} | {np.median(times[name][1:]):.2f} |"
        )


def stability() -> None:
    turbine = load_turbine("nrel5mw")
    unseen = winds(100, 600.0, 9_000_000)
    start = np.array([initial_state(turbine, "operating-point", w) for w in unseen])
    print("| corrector | enhanced diverged | hybrid diverged | hybrid accepted |\n|---|---|---|---|")
    for c in correctors():
        if c.turbine == "nrel5mw":
            runs = {
                mode: simulate_block(
                    turbine, c.method, c.step, unseen, start, 600.0, 2.0, corrector=c, mode=mode
                )
                for mode in ("enhanced", "hybrid")
            }
            lost = {mode: sum(r.diverged_at is not None for r in found) for mode, found in runs.items()}
            accepted = np.mean([r.accepted.mean() for r in runs["hybrid"]])
            print(f"| {c.name} | {lost['enhanced']} | {lost['hybrid']} | {accepted:.4f} |", flush=True)


if __name__ == "__main__":
    stability() if "--stability" in sys.argv else work_precision()
