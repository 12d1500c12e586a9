"""Time whole steps of the working tree against those of a git revision, one after the other in turns.

python tools/compare_speed.py [REV] [--tree DIR] [--pairs 5] [--rounds 3] [--only PATTERN]

Two processes live side by side on one core, one per tree; of every entry first one measures, then the other, the first one changing
from round to round. A process keeps its luck with memory for life: the same code ran 12 to 17 % faster or slower than itself, in two
modes (measured). So pairs begin anew, each on another core. Printed: the median over all rounds of the ratio new over old, and the
ratio of the best times, which both trees reach in some process. An entry is marked where both are above 1.03.

An entry is a block of 16 turbulent cases with output at 50 Hz: CPU time of the integration alone, per step and case. `rhs` is the
kernel on 256 states, its copying in and out included.
"""

from __future__ import annotations

import argparse
import inspect
import json
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np
from revisions import ROOT, add_arguments, base_tree, check_import, start

METHODS = {
    **{"heun": 0.01, "rk3": 0.02, "rk4": 0.02, "tsit5": 0.05, "dop853": 0.1, "ab4": 0.01, "abm4": 0.01},
    **{"etdrk4": 0.05, "etdabm3": 0.05},
}
CORRECTORS = {"rk4-100ms": "rk4", "etdabm3-100ms": "etdabm3"}
ENTRIES = [
    "rhs",
    *METHODS,
    "rk4, varying pitch",
    *(f"{corrector} {mode}" for corrector in CORRECTORS for mode in ("hybrid", "enhanced")),
]
CASES = 16
DURATION = 30.0  # s
SLOWER = 1.03
REPEATS = 5  # of one measurement, of which the best counts


def block_function() -> Callable[..., list[Any]]:
    """simulate(turbine, winds, initial, duration, pitch, method, step, corrector, mode) of the package that is imported."""
    from fatigue_runner import integrators

    if hasattr(integrators, "Ensemble"):
        ensemble, integrator, simulate = (
            getattr(integrators, n) for n in ("Ensemble", "Integrator", "simulate")
        )

        def new(turbine, winds, initial, duration, pitch, method, step, corrector, mode):  # type: ignore[no-untyped-def]
            cases = ensemble(turbine, winds, initial, duration, output_step=0.02, pitch=pitch)
            return simulate(cases, integrator(method, step, corrector=corrector, mode=mode))

        return new

    def old(turbine, winds, initial, duration, pitch, method, step, corrector, mode):  # type: ignore[no-untyped-def]
        options = {"pitch": pitch, "corrector": corrector, "mode": mode}
        return integrators.simulate_block(turbine, method, step, winds, initial, duration, 0.02, **options)

    return old


def count_cpu_time() -> None:
    """Let the integration's clock count the CPU time of its thread, which a busy machine does not stretch."""
    for name, module in list(sys.modules.items()):
        if name.startswith("fatigue_runner.") and getattr(module, "clock", None) is time.perf_counter:
            module.clock = time.thread_time  # type: ignore[attr-defined]


def measurement(entry: str) -> Callable[[], float]:
    """A function that measures an entry once [ns per step and case, or per evaluation and state]."""
    import fatigue_runner as fr

    turbine = fr.load_turbine("nrel5mw")
    start_state = turbine.operating_point(8.0)
    if entry == "rhs":
        rng = np.random.Generator(np.random.PCG64(1))
        x = start_state[:, None] + rng.normal(0, 0.05, (16, 256))
        speeds = rng.uniform(5, 10, 256)

        def evaluations() -> float:
            began = time.thread_time()
            for _ in range(200):
                turbine.rhs(x, speeds)
            return (time.thread_time() - began) / 200 / 256 * 1e9

        return evaluations
    # the wind of older trees: mean and linear shears
    linear: Any = {"harmonics": 1} if "harmonics" in inspect.signature(fr.TurbulentWind).parameters else {}
    simulate, winds = (
        block_function(),
        [fr.TurbulentWind(8.0, intensity=0.14, seed=s, duration=DURATION, **linear) for s in range(CASES)],
    )
    pitch: Any = 0.0
    corrector, mode = None, "enhanced"
    method = entry
    if entry.endswith("varying pitch"):
        method, time_points = "rk4", np.linspace(0, DURATION + 2, 65)
        pitch = fr.PitchSeries(time_points, np.radians(2 + np.sin(0.8 * time_points)))
    elif entry not in METHODS:
        name, mode = entry.split()
        corrector = next(c for c in fr.correctors() if c.name == name)
        method = CORRECTORS[name]
    step = METHODS[method] if corrector is None else corrector.step
    initial = np.repeat(start_state[None], CASES, axis=0)
    settings = (turbine, winds, initial, DURATION, pitch, method, step, corrector, mode)

    def steps() -> float:
        block = simulate(*settings)
        return sum(t.wall_time for t in block) / sum(t.steps for t in block) * 1e9

    return steps


def work(tree: str, core: int) -> None:
    """Answer every name of an entry on the standard input by its time, as JSON."""
    check_import(tree)
    if core >= 0:
        os.sched_setaffinity(0, {core})
    ready: dict[str, Callable[[], float]] = {}
    for line in sys.stdin:
        entry = line.strip()
        if entry not in ready:
            ready[entry] = measurement(entry)
            ready[entry]()  # compiles, or loads from the cache
            count_cpu_time()  # the module with the clock is loaded by now, whatever its name
        print(json.dumps(min(ready[entry]() for _ in range(REPEATS))), flush=True)


def ask(worker: subprocess.Popen[str], entry: str) -> float:
    """The time of an entry in one tree."""
    assert worker.stdin is not None and worker.stdout is not None
    worker.stdin.write(f"{entry}\n")
    worker.stdin.flush()
    answer = worker.stdout.readline()
    if not answer:
        sys.exit(f"{entry}: the process of a tree ended, exit status {worker.wait()}")
    return float(json.loads(answer))


def in_turns(
    old: Any, new: Any, entries: list[str], rounds: int, ask: Callable[[Any, str], float] = ask
) -> dict[str, list[tuple[float, float]]]:
    """{entry: (old, new) times of every round}; who is first changes from round to round."""
    found: dict[str, list[tuple[float, float]]] = {entry: [] for entry in entries}
    for number in range(rounds):
        for entry in entries:
            if number % 2:
                after = ask(new, entry)
                found[entry].append((ask(old, entry), after))
            else:
                before = ask(old, entry)
                found[entry].append((before, ask(new, entry)))
    return found


def measured_pair(
    base: Path, core: int, entries: list[str], rounds: int
) -> dict[str, list[tuple[float, float]]]:
    """The rounds of two new processes on one core."""
    script = Path(__file__).resolve()
    old, new = (
        start(tree, script, ["--worker", str(tree), str(core)], stdin=subprocess.PIPE)
        for tree in (base, ROOT)
    )
    try:
        return in_turns(old, new, entries, rounds)
    finally:
        for worker in (old, new):
            worker.terminate()
            worker.wait()


def table(found: dict[str, list[tuple[float, float]]]) -> str:
    """One line per entry: median times, median and quartiles of the ratio, the best times' ratio, and a mark where it is slower."""
    width = max(map(len, found))
    lines = [f"{'':<{width}}  old [ns]  new [ns]  new/old  quartiles     best"]
    for entry, times in found.items():
        ratios = [new / old for old, new in times]
        ratio = statistics.median(ratios)
        low, high = np.quantile(ratios, [0.25, 0.75])
        old, new = (statistics.median(t[side] for t in times) for side in (0, 1))
        best = min(t[1] for t in times) / min(t[0] for t in times)
        mark = "  SLOWER" if min(ratio, best) > SLOWER else ""
        lines.append(
            f"{entry:<{width}}  {old:8.1f}  {new:8.1f}  {ratio:7.3f}  {low:.3f}-{high:.3f}  {best:.3f}{mark}"
        )
    return "\n".join(lines)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    add_arguments(parser)
    parser.add_argument("--pairs", type=int, default=5, help="of processes, one after the other")
    parser.add_argument("--rounds", type=int, default=3, help="of every pair")
    parser.add_argument(
        "--only", default="", metavar="PATTERN", help="entries whose names match it, * for anything"
    )
    given = parser.parse_args(arguments)
    entries = [entry for entry in ENTRIES if fnmatchcase(entry, f"*{given.only}*")]
    if not entries or min(given.pairs, given.rounds) < 1:
        sys.exit(f"nothing to measure: give at least one pair, one round and one of {'; '.join(ENTRIES)}")
    name, base = base_tree(given)
    # where the system pins no processes, -1: they run free
    cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else [-1]
    found: dict[str, list[tuple[float, float]]] = {entry: [] for entry in entries}
    for pair in range(given.pairs):
        for entry, times in measured_pair(base, cores[pair % len(cores)], entries, given.rounds).items():
            found[entry] += times
    print(
        f"the working tree against {name}, {given.pairs} pairs of processes, {given.rounds} rounds each, CPU time per step and case"
    )
    print(table(found))
    return 0


if __name__ == "__main__":
    if sys.argv[1:2] == ["--worker"]:
        work(sys.argv[2], int(sys.argv[3]))
    else:
        sys.exit(main())
