"""All integrators over a range of steps on the same cases: what each costs, and how far each is from the reference.

Two stages. Errors: every method's steps, every corrector, the adaptive methods and the reference's own quality, in worker
processes, since nothing is timed there. Times: whole steps with output, one pinned thread, every integrator once per round, so that
a slow minute of the machine meets all of them; CPU time, which is the wall time of an idle machine. The stages can be run apart
(`errors`, `times`), the second alone on a machine that is quiet for two minutes only.

Beside the time stands delta_t, the cost of arXiv:2504.05493 (`results.evaluation_cost`): of the evaluations alone, from the times of
one of f and one of each corrector, which are measured in the second stage, too.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fatigue_runner.benchmark.speed import machine
from fatigue_runner.benchmark.study import adaptive
from fatigue_runner.benchmark.study.cases import Cases, Settings
from fatigue_runner.benchmark.study.integrators import (
    fitting,
    limit,
    rungs,
    seconds_per_second,
    timed_duration,
)
from fatigue_runner.benchmark.study.points import (
    Point,
    Reference,
    evaluate,
    make_reference,
    point_of,
    reference_quality,
)
from fatigue_runner.errors import InputError
from fatigue_runner.integrators import Integrator
from fatigue_runner.results.evaluation_cost import delta_ts

Say = Callable[[str], None]


@dataclass
class Job:
    """A piece of work of the first stage: a method down the steps, or one `integrator`, or an adaptive method at a tolerance; without
    any of them the reference."""

    number: int  # of the set of cases
    cases: Cases
    settings: Settings
    reference: Reference | None = None
    method: str = ""
    integrator: Integrator | None = None
    tolerance: float = 0.0


def run_job(job: Job) -> tuple[Job, dict[str, Any]]:
    """The job without what it was given, and its part of the result."""
    cases = job.cases
    if job.reference is None:
        reference = make_reference(cases)
        done: dict[str, Any] = {"reference": reference, "agreement": reference_quality(cases, reference)}
    elif job.tolerance:
        count = job.settings.adaptive_cases
        done = {"adaptive": [adaptive.measure(cases, job.reference, job.method, job.tolerance, count)]}
    elif job.method:
        done = descend(cases, job.settings, job.reference, job.method)
    else:
        assert job.integrator is not None
        done = {"points": [measured(cases, job.integrator, job.reference)]}
    return replace(job, reference=None), done


def measured(cases: Cases, integrator: Integrator, reference: Reference) -> Point:
    block = cases.run(integrator)
    return evaluate(block, reference, cases, point_of(integrator, cases, block))


def descend(cases: Cases, settings: Settings, reference: Reference, method: str) -> dict[str, Any]:
    """A method's points from its second unstable step down to where it is close or dear enough; why no further; its limit."""
    from fatigue_runner.integrators import method as find
    from fatigue_runner.integrators.stability import LARGEST

    largest = limit(cases, method)
    steps, reason = rungs(cases, settings, method, largest)
    points = []
    for step in steps:
        points.append(measured(cases, Integrator(method, step), reference))
        error = points[-1].nrmse_max
        if error is not None and error < settings.finest:
            reason = f"steps below {step * 1e3:g} ms: NRMSE is below {settings.finest:.0e} there"
            break
    cost = find(method).evaluations_per_step
    row = {
        "method": method,
        "limit": largest,
        "at_least": largest >= LARGEST,  # no larger step is tried
        "evaluations_per_second": cost / largest if largest else None,
    }
    return {
        "points": points,
        "left_out": [f"{method}: {reason}"] if reason else [],
        "stability_limits": [row],
    }


def jobs(number: int, cases: Cases, settings: Settings, reference: Reference) -> Iterator[Job]:
    """All work on a set of cases, the longest first."""
    from fatigue_runner.integrators import METHODS

    common = (number, cases, settings, reference)
    for method in adaptive.METHODS if settings.adaptive_cases else ():
        for tolerance in sorted(settings.tolerances):
            yield Job(*common, method, tolerance=tolerance)
    for method in METHODS if settings.methods is None else settings.methods:
        yield Job(*common, method)
    for integrator in fitting(cases, settings)[0]:
        yield Job(*common, integrator=integrator)


def warm_up(sets: Sequence[Cases], settings: Settings) -> None:
    """Compile what the workers will load from the cache: every loop once, for a tenth of a second."""
    from fatigue_runner.integrators import METHODS

    for cases in sets:
        for integrator in [Integrator(method, 0.01) for method in METHODS] + fitting(cases, settings)[0]:
            cases.run(integrator, max(0.1, 2 * cases.output_step))


def errors(sets: Sequence[Cases], settings: Settings, workers: int, say: Say) -> list[dict[str, Any]]:
    """First stage: a result per set of cases with all points, as yet without times."""
    from fatigue_runner.campaign.pool import run_jobs

    say("loading the compiled kernels")
    warm_up(sets, settings)
    results: list[dict[str, Any]] = [_empty(cases, settings) for cases in sets]
    references: dict[int, Reference] = {}
    say("references and their quality")
    for job, done in run_jobs(run_job, [Job(i, c, settings) for i, c in enumerate(sets)], workers):
        references[job.number] = done["reference"]
        results[job.number]["reference"]["agreement"] = done["agreement"]
        say(f"{job.cases.name}: reference")
    todo = [job for i, c in enumerate(sets) for job in jobs(i, c, settings, references[i])]
    for count, (job, done) in enumerate(run_jobs(run_job, todo, workers), start=1):
        for key, values in done.items():
            results[job.number][key] += values
        what = job.method or (job.integrator.label if job.integrator else "")
        say(
            f"[{count}/{len(todo)}] {job.cases.name}: {what}{f', tolerance {job.tolerance:g}' if job.tolerance else ''}"
        )
    for result in results:
        _sort(result)
    return results


def _empty(cases: Cases, settings: Settings) -> dict[str, Any]:
    long = [f"{step * 1e3:g}" for step in settings.ladder if step > cases.longest_step]
    unresolved = (
        [f"steps of {', '.join(long)} ms: too long for the wind's azimuthal harmonics"] if long else []
    )
    return {
        "cases": cases.name,
        "turbine": cases.ensemble.turbine.name,
        "operation": cases.ensemble.turbine.operation,
        "turbulent": cases.turbulent,
        "winds": [w.name for w in cases.ensemble.winds],
        "duration": cases.duration,
        "discard": cases.discard,
        "output_rate": 1.0 / cases.output_step,
        "reference": {"method": cases.reference.method, "step": cases.reference.step, "agreement": []},
        "points": [],
        "adaptive": [],
        "stability_limits": [],
        "evaluation_times": {},
        "left_out": fitting(cases, settings)[1] + unresolved,
    }


def _sort(result: dict[str, Any]) -> None:
    """Workers end in any order: methods as registered, then correctors by name; the largest step first."""
    from fatigue_runner.integrators import METHODS

    place = {name: i for i, name in enumerate((*METHODS, *adaptive.METHODS))}
    for key in ("points", "adaptive"):
        result[key].sort(
            key=lambda p: (p.corrected, p.series if p.corrected else place[p.method], -p.step, p.label)
        )
    result["stability_limits"].sort(key=lambda row: place[row["method"]])
    result["left_out"].sort()


def times(
    sets: Sequence[Cases], settings: Settings, results: Sequence[dict[str, Any]], rounds: int, say: Say
) -> None:
    """Second stage: fills in `wall` and `delta_t` of all points that did not diverge."""
    from fatigue_runner.integrators.evaluation_times import evaluation_times

    with machine.pinned():
        for cases, result in zip(sets, results, strict=True):
            corrected = {i.label: i for i in fitting(cases, settings)[0] if i.corrector is not None}
            running = [p for p in result["points"] if not p.diverged]
            say(f"{cases.name}: one evaluation of f, and of every corrector")
            result["evaluation_times"] = evaluation_times(cases.ensemble, list(corrected.values()))
            for p in running:
                p.delta_t = delta_ts(
                    result["evaluation_times"], p.evaluations_per_second, p.step, p.corrector
                )
            work = []
            for p in running:
                integrator = corrected[p.label] if p.corrector else Integrator(p.method, p.step)
                work.append((integrator, timed_duration(cases, settings, p.evaluations_per_second)))
            walls: list[list[float]] = [[] for _ in work]
            for number in range(-1, rounds):  # one to warm up
                say(f"{cases.name}: timing, round {number + 1} of {rounds}")
                for (integrator, duration), wall in zip(work, walls, strict=True):
                    wall.append(seconds_per_second(cases.run(integrator, duration), duration))
            for p, wall in zip(running, walls, strict=True):
                p.wall = machine.spread(wall[1:])


def identity(sets: Sequence[Cases], settings: Settings) -> str:
    """Hash of all that decides the errors, so that they are not timed with another program's methods or winds."""
    from fatigue_runner.campaign.provenance import code_hash

    digest = hashlib.sha256(code_hash().encode())
    digest.update(json.dumps(settings.model_dump(), sort_keys=True).encode())
    for cases in sets:
        ensemble, integrators = cases.ensemble, [cases.reference, *fitting(cases, settings)[0]]
        values = (
            ensemble.turbine.hash,
            [w.label for w in ensemble.winds],
            ensemble.duration,
            ensemble.output_step,
            cases.discard,
            [i.id for i in integrators],
        )
        digest.update(json.dumps([cases.name, *values], sort_keys=True).encode())
        for integrator in integrators:
            if integrator.corrector is not None:
                # not the object as a whole: it keeps what it has made of its map
                corrector: Any = integrator.corrector
                digest.update(repr((corrector.name, corrector.recipe, dict(corrector.training))).encode())
                for name, values in sorted(corrector.map.tensors().items()):
                    digest.update(name.encode() + np.ascontiguousarray(values).tobytes())
    return digest.hexdigest()[:16]


def reused(values: dict[str, Any], expected: str, where: str) -> list[dict[str, Any]]:
    """The first stage's results as they were written. Raises InputError where they are of another program or campaign."""
    if values.get("identity") != expected or "cases" not in values:
        raise InputError(
            f"{where} holds the errors of another version of the program, of its correctors or of the campaign; "
            "run without --reuse"
        )
    for part in values["cases"]:
        part["points"] = [Point.from_dict(p) for p in part["points"]]
        part["adaptive"] = [Point.from_dict(p) for p in part["adaptive"]]
    return values["cases"]
