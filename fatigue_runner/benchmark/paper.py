"""The experiment of arXiv:2504.05493 measured: classical methods and its network, enhanced and hybrid, on unseen winds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fatigue_runner.benchmark.cases import Cases

CLASSICAL = ("heun", "rk3", "heun-richardson")
STEPS = (0.01, 0.005, 0.0025, 0.002, 0.001, 0.0005, 0.0002)  # s, as the paper's axis runs
BOXED = (0.01, 0.005)
MODES = ("enhanced", "hybrid")
# Its trajectories agree with RK7 at 0.1 ms, the paper's reference, to 1e-10 of each state's range, in a fiftieth of the steps.
REFERENCE = ("dop853", 0.0025)
REPEATS = 3


@dataclass(frozen=True)
class Entry:
    """An integrator: method and step [s], and the corrector with its mode where there is one."""

    method: str
    step: float
    corrector: Any = None
    mode: str = ""

    @property
    def label(self) -> str:
        return f"{self.method} + network, {self.mode}" if self.mode else self.method


@dataclass
class Outcome:
    """One integrator on a set of winds. Lists have an entry per wind; None where it diverged; costs per simulated second."""

    label: str
    method: str
    step: float
    mode: str
    evaluations: float
    wall: float
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


def entries(correctors: Sequence[Any], steps: Sequence[float] = STEPS) -> list[Entry]:
    """The classical methods at all steps, and every corrector in both modes at its own step."""
    plain = [Entry(method, step) for method in CLASSICAL for step in steps]
    return plain + [Entry(c.method, c.step, c, mode) for c in correctors for mode in MODES]


def speeds(cases: Cases) -> list[float]:
    return [float(w.mean_speed) for w in cases.winds]


def simulate(cases: Cases, entry: Entry) -> list[Any]:
    from fatigue_runner.integrators import simulate_block

    return simulate_block(
        cases.turbine, entry.method, entry.step, cases.winds, cases.initial, cases.duration, cases.output_step,
        pitch=cases.pitch, corrector=entry.corrector, mode=entry.mode or "enhanced",
    )  # fmt: skip


def outcome(cases: Cases, entry: Entry, reference: Sequence[Any], repeats: int = REPEATS) -> Outcome:
    """Errors against the reference; of the time, the least of the repeats: other work of the machine only adds to it."""
    from fatigue_runner.accuracy import compare

    runs = simulate(cases, entry)
    walls = [sum(r.wall_time for r in runs)]
    walls += [sum(r.wall_time for r in simulate(cases, entry)) for _ in range(repeats - 1)]
    seconds = len(runs) * cases.duration
    out = Outcome(
        entry.label,
        entry.method,
        entry.step,
        entry.mode,
        sum(r.evaluations for r in runs) / seconds,
        min(walls) / seconds,
    )
    for run, exact in zip(runs, reference, strict=True):
        found = compare(run, exact) if run.diverged_at is None else None
        for name in ("nrmse_max", "nrmse_mean", "delta_e", "delta_e_range"):
            getattr(out, name).append(None if found is None else getattr(found, name))
        out.accepted.append(float(run.accepted.mean()))
    return out


def measure(
    campaign: Path,
    correctors: Sequence[Any],
    steps: Sequence[float] = STEPS,
    say: Callable[[str], None] = lambda what: None,
) -> dict[str, Any]:
    """All integrators on a campaign's winds: {speeds, winds trained on, outcomes}. Raises InputError for a corrector that does
    not fit the campaign's turbine."""
    from fatigue_runner.benchmark.cases import load_cases

    cases = load_cases(campaign)
    reference = simulate(cases, Entry(*REFERENCE))
    outcomes = []
    for entry in entries(correctors, steps):
        say(f"{cases.name}: {entry.label}, {entry.step * 1e3:g} ms")
        outcomes.append(outcome(cases, entry, reference))
    return {
        "name": cases.name,
        "turbine": cases.turbine.name,
        "speeds": speeds(cases),
        "reference": {"method": REFERENCE[0], "step": REFERENCE[1]},
        "outcomes": outcomes,
    }


def rows(measured: dict[str, Any], chosen: Sequence[bool] | None = None) -> list[dict[str, Any]]:
    """A table's rows: per integrator the median, the largest and the quartiles of the errors over the chosen winds."""
    out = []
    for o in measured["outcomes"]:
        row: dict[str, Any] = {
            "integrator": o.label,
            "step": o.step,
            "evaluations": o.evaluations,
            "wall": o.wall,
        }
        for name in ("nrmse_max", "nrmse_mean", "delta_e", "delta_e_range"):
            values = o.values(name, chosen)
            row[name] = dict(
                zip(("low", "median", "high"), np.quantile(values, (0.25, 0.5, 0.75)).tolist(), strict=True)
            )
            row[name]["worst"] = float(values.max())
        row["diverged"] = sum(v is None for v in o.nrmse_max)
        row["accepted"] = float(
            np.mean([a for a, k in zip(o.accepted, chosen or [True] * len(o.accepted), strict=True) if k])
        )
        out.append(row)
    return out


def to_json(measured: dict[str, Any]) -> dict[str, Any]:
    return {**measured, "outcomes": [asdict(o) for o in measured["outcomes"]]}
