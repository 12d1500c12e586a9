"""Where a campaign's time goes, from the wind to the record of a case, in one process and in two: one campaign, run again and again.

The turbine at a fixed pitch, wind of three signals, 50 Hz: what the targets of the pipeline are stated for. Times are the processor's, of
the thread that works, by stage (`stopwatch`); divided by the cases and their simulated seconds they are what a second of one case costs
one core.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

from fatigue_runner import stopwatch
from fatigue_runner.benchmark.speed import kernel, machine
from fatigue_runner.campaign.block import Job, run_block
from fatigue_runner.campaign.run import run_campaign

# of a worker; the rest of its time is bookkeeping
STAGES = ("wind", "integration", "loads", "counting", "statistics", "comparison", "logging")
REST = "bookkeeping"
FIXED = ("planning", "preparation", "kernels", "table", "report")
OPENFAST = (
    8.0  # times real time that a core makes of the same turbine with the same degrees of freedom (measured)
)


def spec(duration: float, seeds: int, logged: bool, workers: int) -> dict[str, Any]:
    """The campaign, as a file would say it: ten speeds, two integrators."""
    return {
        "name": "benchmark",
        "turbine": "nrel5mw",
        "duration": duration,
        "discard": min(20.0, duration / 10),
        "output_rate": 50,
        "wind": {
            "type": "turbulent", "speeds": {"start": 5, "stop": 9.5, "step": 0.5}, "intensity": 0.1, "shear_exponent": 0.2,
            "harmonics": 1, "seeds": seeds,
        },
        "integrators": [{"method": "rk4", "step": 0.1}],
        "reference": {"method": "rk4", "step": 0.05},
        "fatigue": {"wohler_exponents": [3, 4, 5, 10, 12]},
        "log": {"enabled": logged},
        "workers": workers,
    }  # fmt: skip


def timed_block(folder: Path, job: Job) -> list[dict[str, Any]]:
    """`run_block`, and in `folder` how long each stage of it took."""
    stopwatch.taken((*STAGES, REST))
    # what other programs take of the machine is no time of this one
    with stopwatch.counting(time.thread_time), stopwatch.stage(REST):
        records = run_block(job)
    (folder / f"{job.cases[0].id}.json").write_text(json.dumps(stopwatch.taken((*STAGES, REST))))
    return records


def _run(campaign: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """One run: seconds by stage of all workers together and of the run's own process, and from its start to its end."""
    spent = folder / "spent"
    spent.mkdir(parents=True)
    stopwatch.taken(FIXED)
    begin = time.perf_counter()
    results = run_campaign(campaign, folder / "run", block=partial(timed_block, spent))
    whole = time.perf_counter() - begin
    fixed = stopwatch.taken(FIXED)
    stages = dict.fromkeys((*STAGES, REST), 0.0)
    for path in spent.glob("*.json"):
        for name, took in json.loads(path.read_text()).items():
            stages[name] += took
    return {
        "cases": len(results),
        "stages": stages,
        "fixed": fixed,
        "whole": whole,
        "running": whole - sum(fixed.values()),
        "log_bytes": sum(path.stat().st_size for path in (folder / "run" / "logs").glob("*.mcap")),
    }


def _start() -> float:
    """Seconds from the command to a process that knows what to do."""
    begin = time.perf_counter()
    subprocess.run(
        [sys.executable, "-c", "import fatigue_runner.cli, fatigue_runner.campaign.run"], check=True
    )
    return time.perf_counter() - begin


def _figures(runs: list[dict[str, Any]], duration: float, workers: int) -> dict[str, Any]:
    """Medians over the runs: us per simulated second and case, on one core."""
    per = 1e6 / (runs[0]["cases"] * duration)
    stages = {name: median(run["stages"][name] for run in runs) * per for name in runs[0]["stages"]}
    seconds = {name: median(run["fixed"][name] for run in runs) for name in FIXED}
    return {
        "cases": runs[0]["cases"],
        "workers": workers,
        "stages": stages,
        "sum": median(sum(run["stages"].values()) for run in runs) * per,
        # all that passes while cases run, times the cores that it takes
        "core": median(run["running"] for run in runs) * workers * per,
        "fixed": seconds,
        "whole": median(run["whole"] for run in runs),
        "log_bytes_per_case": runs[0]["log_bytes"] / runs[0]["cases"],
    }


def measure(
    duration: float = 600.0,
    seeds: int = 16,
    repeats: int = 3,
    workers: tuple[int, ...] = (1, 2),
    say: Callable[[str], None] = lambda what: None,
) -> dict[str, Any]:
    """All figures of `fatigue-runner benchmark campaign` as plain values; us per simulated second and case, s, ns."""
    from fatigue_runner.turbine import load_turbine

    one = kernel.one_evaluation(load_turbine("nrel5mw"))
    one()
    situations = [(logged, n) for logged in (False, True) for n in workers]
    runs: dict[tuple[bool, int], list[dict[str, Any]]] = {key: [] for key in situations}
    evaluations: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        for place, campaign in _short(Path(folder), workers):  # kernels, processes, page tables
            _run(campaign, place)
        for repeat in range(repeats):
            for logged, n in situations:
                say(
                    f"run {repeat + 1} of {repeats}: {'with' if logged else 'without'} logs, {n} process{'es' * (n > 1)}"
                )
                evaluations.append(one())
                with tempfile.TemporaryDirectory(dir=folder) as here:
                    runs[logged, n].append(_run(spec(duration, seeds, logged, n), Path(here)))
                evaluations.append(one())
    return {
        "machine": machine.describe(),
        "duration": duration,
        "evaluation": median(evaluations),
        "start": median(_start() for _ in range(repeats)),
        "situations": [
            {"logged": logged, **_figures(found, duration, n)} for (logged, n), found in runs.items()
        ],
    }


def _short(folder: Path, workers: tuple[int, ...]) -> Iterator[tuple[Path, dict[str, Any]]]:
    for n in workers:
        yield folder / f"short-{n}", spec(20.0, 2, True, n)
