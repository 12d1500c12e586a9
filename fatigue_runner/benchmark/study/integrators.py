"""Which integrators meet a set of cases, at which steps, what kind they are and what shares a curve."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from fatigue_runner.benchmark.study.cases import Cases, Settings
from fatigue_runner.errors import InputError
from fatigue_runner.integrators import ENHANCED, HYBRID, Integrator
from fatigue_runner.naming import integrator_series

CLASSICAL, ADAPTIVE = "classical", "adaptive"
KINDS = (CLASSICAL, ADAPTIVE, ENHANCED, HYBRID)


def kind(integrator: Integrator) -> str:
    """One of `KINDS`."""
    return integrator.corrected_mode or CLASSICAL


def series(integrator: Integrator) -> str:
    """What shares a curve: the method, the family of its corrector and the mode, at any step."""
    family = "" if integrator.corrector is None else integrator.corrector.family
    return integrator_series(integrator.method, family, integrator.corrected_mode)


def limit(cases: Cases, method: str) -> float:
    """Largest stable step [s] of a method at the cases' winds; 0 for none."""
    from fatigue_runner.integrators import stability_limit

    ensemble = cases.ensemble
    speeds = sorted({round(w.mean_speed, 1) for w in ensemble.winds})
    tried = [*speeds[:: max(1, len(speeds) // 2)], None]
    return min(stability_limit(ensemble.turbine, method, v, cases.pitch) for v in tried)


def rungs(cases: Cases, settings: Settings, method: str, largest: float) -> tuple[list[float], str]:
    """(steps [s] of a method whose stability limit is `largest`, from its second unstable one down; why no smaller ones, or "")."""
    from fatigue_runner.integrators import method as find

    cost = find(method).evaluations_per_step
    ladder = [s for s in settings.ladder if s <= min(cases.duration, cases.longest_step)]
    start = max([i for i, s in enumerate(ladder) if s > largest], default=0)
    fine = [s for s in ladder if cost / s <= settings.most_evaluations]
    reason = ""
    if len(fine) < len(ladder):
        left = ", ".join(f"{s * 1e3:g}" for s in ladder[len(fine) :])
        reason = (
            f"steps of {left} ms: more than {settings.most_evaluations:g} evaluations per simulated second"
        )
    return ladder[max(start - 1, 0) : len(fine)], reason


def fitting(cases: Cases, settings: Settings) -> tuple[list[Integrator], list[str]]:
    """All correctors for the cases' turbine as it is operated, in all modes, those the campaign lists, and the listed methods; and what
    was left out, with the reason."""
    from fatigue_runner.corrector import correctors, find

    turbine, found, left_out = cases.ensemble.turbine, [], []
    shipped = correctors() if settings.correctors is None else [find(name) for name in settings.correctors]
    for c in shipped:
        if c.turbine != turbine.name or c.binding.operation != turbine.operation:
            continue
        try:
            c.bind(turbine, c.method, c.step)
        except InputError as error:
            left_out.append(str(error))
            continue
        found += [Integrator(c.method, c.step, c, mode) for mode in settings.modes]
    known = {i.label for i in found}
    return found + [i for i in cases.integrators if i.corrector is None or i.label not in known], left_out


def timed_duration(cases: Cases, settings: Settings, evaluations_per_second: float) -> float:
    """Simulated seconds of a timed run: enough evaluations to be timed well, a whole number of outputs."""
    wanted = max(settings.timed_evaluations / max(evaluations_per_second, 1e-9), 10.0)
    outputs = math.ceil(min(wanted, cases.duration) / cases.output_step - 1e-9)
    return outputs * cases.output_step


def seconds_per_second(block: Sequence[Any], duration: float) -> float:
    """Time of the compiled loop per simulated second and case of a block of that duration [s]."""
    return sum(t.wall_time for t in block) / len(block) / duration
