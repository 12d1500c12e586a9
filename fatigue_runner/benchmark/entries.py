"""What is compared: a method at a step, alone or with a corrector; and which of them meet a set of cases."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from fatigue_runner.benchmark.cases import Cases, Settings
from fatigue_runner.errors import InputError

CLASSICAL, ADAPTIVE, ENHANCED, HYBRID = "classical", "adaptive", "enhanced", "hybrid"
KINDS = (CLASSICAL, ADAPTIVE, ENHANCED, HYBRID)
# What a corrector's family is called in tables and figures.
FAMILIES = {"mlp": "network", "paper": "network"}


@dataclass(frozen=True)
class Entry:
    """An integrator: method and step [s], and a corrector with its mode where there is one."""

    method: str
    step: float
    corrector: Any = None
    mode: str = ""

    @property
    def kind(self) -> str:
        return self.mode or CLASSICAL

    @property
    def name(self) -> str:
        """The corrector's, or none."""
        return "" if self.corrector is None else self.corrector.name

    @property
    def series(self) -> str:
        """What shares a curve: the method, the family of its corrector and the mode, at any step."""
        if self.corrector is None:
            return self.method
        family = self.corrector.family
        return f"{self.method} + {FAMILIES.get(family, family)}, {self.mode}"

    @property
    def label(self) -> str:
        return f"{self.name}, {self.mode}" if self.corrector else f"{self.method} {self.step * 1e3:g} ms"


def simulate(cases: Cases, entry: Entry, duration: float | None = None) -> list[Any]:
    """Trajectories of all cases, or of their first `duration` seconds; winds that can share a block do."""
    from fatigue_runner.integrators import simulate_block

    groups: dict[Any, list[int]] = {}
    for i, wind in enumerate(cases.winds):
        groups.setdefault(wind.cell_key, []).append(i)
    out: list[Any] = [None] * len(cases.winds)
    for chosen in groups.values():
        block = simulate_block(
            cases.turbine, entry.method, entry.step, [cases.winds[i] for i in chosen], cases.initial[chosen],
            duration or cases.duration, cases.output_step,
            pitch=cases.pitch, corrector=entry.corrector, mode=entry.mode or ENHANCED,
        )  # fmt: skip
        for i, trajectory in zip(chosen, block, strict=True):
            out[i] = trajectory
    return out


def limit(cases: Cases, method: str) -> float:
    """Largest stable step [s] of a method at the cases' winds; 0 for none."""
    from fatigue_runner.integrators import stability_limit

    speeds = sorted({round(w.mean_speed, 1) for w in cases.winds})
    tried = [*speeds[:: max(1, len(speeds) // 2)], None]
    return min(stability_limit(cases.turbine, method, v, cases.pitch) for v in tried)


def rungs(cases: Cases, settings: Settings, method: str, largest: float) -> tuple[list[float], str]:
    """(steps [s] of a method whose stability limit is `largest`, from its second unstable one down; why no smaller ones, or "")."""
    from fatigue_runner.integrators import method as find

    cost = find(method).evaluations_per_step
    ladder = [s for s in settings.ladder if s <= cases.duration]
    start = max([i for i, s in enumerate(ladder) if s > largest], default=0)
    fine = [s for s in ladder if cost / s <= settings.most_evaluations]
    reason = ""
    if len(fine) < len(ladder):
        left = ", ".join(f"{s * 1e3:g}" for s in ladder[len(fine) :])
        reason = (
            f"steps of {left} ms: more than {settings.most_evaluations:g} evaluations per simulated second"
        )
    return ladder[max(start - 1, 0) : len(fine)], reason


def fitting(cases: Cases, settings: Settings) -> tuple[list[Entry], list[str]]:
    """All correctors for the cases' turbine in all modes, those the campaign lists, and the listed methods; and what was left
    out, with the reason."""
    from fatigue_runner.corrector import correctors, find, load

    entries, left_out = [], []
    shipped = correctors() if settings.correctors is None else [find(name) for name in settings.correctors]
    for c in shipped:
        if c.turbine != cases.turbine.name:
            continue
        try:
            c.bind(cases.turbine, c.method, c.step)
        except InputError as error:
            left_out.append(str(error))
            continue
        entries += [Entry(c.method, c.step, c, mode) for mode in settings.modes]
    known = {(e.name, e.mode) for e in entries}
    for method, step, file, mode in cases.integrators:
        if not file:
            entries.append(Entry(method, step))
        elif ((c := load(file)).name, mode) not in known:
            entries.append(Entry(method, step, c, mode))
    return entries, left_out


def timed_duration(cases: Cases, settings: Settings, evaluations_per_second: float) -> float:
    """Simulated seconds of a timed run: enough evaluations to be timed well, a whole number of outputs."""
    wanted = max(settings.timed_evaluations / max(evaluations_per_second, 1e-9), 10.0)
    outputs = math.ceil(min(wanted, cases.duration) / cases.output_step - 1e-9)
    return outputs * cases.output_step


def seconds_per_second(block: Sequence[Any], duration: float) -> float:
    """Time of the compiled loop per simulated second and case of a block of that duration [s]."""
    return sum(t.wall_time for t in block) / len(block) / duration
