"""The whole work-precision benchmark: errors, times, the kernel and the network beside them, and the answers."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from fatigue_runner import shipped
from fatigue_runner.benchmark.pages import words
from fatigue_runner.benchmark.speed import kernel, machine, network
from fatigue_runner.benchmark.study import answers, work_precision
from fatigue_runner.benchmark.study.cases import load

Say = Callable[[str], None]


def measure(
    campaign: Path | Mapping[str, Any] | None = None,
    *,
    rounds: int | None = None,
    workers: int = 2,
    timed: bool = True,
    earlier: tuple[dict[str, Any], str] | None = None,
    say: Say = lambda what: None,
) -> dict[str, Any]:
    """Every set of cases of a campaign (default: the shipped one) with all integrators, the kernel and the network.

    rounds: of the timing, default as the campaign says; timed: False leaves the times out; earlier: the result of such a run and
    where it was read, so that only the times are measured. Raises InputError for a wrong campaign and for an earlier run of
    another version.
    """
    began = time.perf_counter()
    sets, settings = load(shipped.campaign("work_precision") if campaign is None else campaign)
    same = work_precision.identity(sets, settings)
    if earlier is None:
        parts = work_precision.errors(sets, settings, workers, say)
        spent = {"errors": time.perf_counter() - began, "workers": workers}
    else:
        parts = work_precision.reused(earlier[0], same, earlier[1])
        spent = dict(earlier[0].get("seconds", {}))
    result: dict[str, Any] = {
        "identity": same,
        "machine": machine.describe(),
        "cases": parts,
        "seconds": spent,
    }
    if timed:
        begin, count = time.perf_counter(), rounds or settings.rounds
        work_precision.times(sets, settings, parts, count, say)
        say("kernel and network")
        result |= {
            "rounds": count,
            "kernel": kernel.measure(count),
            "network": network.measure_with_one_thread(count),
            "load_average": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
        }
        spent["times"] = time.perf_counter() - begin
    for part in parts:
        part["summary"] = _summary(part)
    return result


def _summary(result: dict[str, Any]) -> dict[str, Any]:
    """The answers of one set of cases as plain values."""
    points = result["points"]
    fronts = (
        ("front_wall_nrmse", answers.wall, answers.nrmse),
        ("front_evaluations_nrmse", answers.evaluations, answers.nrmse),
        ("front_wall_del_error", answers.wall, answers.del_error),
    )
    return {
        **{name: [p.label for p in answers.front(points, *axes)] for name, *axes in fronts},
        "answers": [a.to_dict() for cost in answers.COSTS for a in answers.answers(result, cost)],
        "in_words": words.by_measured_time(result),
    }
