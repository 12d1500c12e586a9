"""One integrator on one set of cases: what it costs and how far it is from the reference."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from fatigue_runner.benchmark.study.cases import Cases
from fatigue_runner.benchmark.study.integrators import CLASSICAL, kind, series
from fatigue_runner.channels import Channel
from fatigue_runner.integrators import HYBRID, Integrator
from fatigue_runner.naming import integrator_label


@dataclass
class Point:
    """Costs per simulated second and case; errors pooled over the cases unless named worst.

    series: what shares a curve; kind: classical, adaptive, enhanced or hybrid. nrmse {state: RMS over the cases}; nrmse_max: of the
    worst state; nrmse_worst: worst state of the worst case; del_error {channel: worst |relative error| over exponents and cases};
    delta_e, delta_e_range: one per case; accepted: share of a hybrid's output intervals. diverged: how many cases; diverged_at: the
    first time [s]. Nothing is known of the errors of a point with a diverged case. by_wind {mean speed [m/s] as text: fields of the
    point as they are in this wind alone}, of a turbine that operates. wall: measured time of whole steps; delta_t {kind: what the
    evaluations alone take, see `results.evaluation_cost`}.
    """

    cases: str
    method: str
    step: float
    evaluations_per_second: float
    series: str = ""
    label: str = ""
    kind: str = CLASSICAL
    corrector: str = ""
    wall: dict[str, float] = field(default_factory=dict)
    delta_t: dict[str, float] = field(default_factory=dict)
    diverged: int = 0
    diverged_at: float | None = None
    nrmse: dict[str, float] = field(default_factory=dict)
    nrmse_max: float | None = None
    nrmse_worst: float | None = None
    del_error: dict[str, float] = field(default_factory=dict)
    del_error_max: float | None = None
    delta_e: list[float] = field(default_factory=list)
    delta_e_range: list[float] = field(default_factory=list)
    accepted: float | None = None
    by_wind: dict[str, dict[str, Any]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.series = self.series or self.method
        self.label = self.label or integrator_label(self.method, self.step)

    @property
    def corrected(self) -> bool:
        return bool(self.corrector)

    def at(self, wind: str) -> Point:
        """The point in one of `by_wind`; its time was not measured apart."""
        return replace(self, wall={}, delta_t={}, **self.by_wind[wind])

    def to_dict(self) -> dict[str, Any]:
        return dict(self.__dict__)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Point:
        return cls(**{f.name: values[f.name] for f in fields(cls) if f.name in values})


def point_of(integrator: Integrator, cases: Cases, block: Sequence[Any]) -> Point:
    """A point without its errors; evaluations per second of what was simulated, up to a divergence too."""
    costs = _costs(block, cases, integrator.corrected_mode == HYBRID)
    point = Point(
        cases.name, integrator.method, integrator.step, series=series(integrator), label=integrator.label, kind=kind(integrator),
        corrector=integrator.corrector_name, **costs,
    )  # fmt: skip
    for wind, numbers in cases.by_wind.items():
        point.by_wind[wind] = _costs([block[i] for i in numbers], cases, integrator.corrected_mode == HYBRID)
    return point


def _costs(block: Sequence[Any], cases: Cases, hybrid: bool) -> dict[str, Any]:
    rate = sum(t.evaluations for t in block) / max(sum(t.duration for t in block), cases.output_step)
    accepted = float(np.mean([t.accepted.mean() for t in block])) if hybrid else None
    return {"evaluations_per_second": rate, "accepted": accepted}


@dataclass
class Sample:
    """What is kept of a reference trajectory; time (n,) [s], state (n, size)."""

    time: np.ndarray
    state: np.ndarray
    states: tuple[Channel, ...]


@dataclass
class Reference:
    """Trajectories of the reference and their DELs {(channel, exponent): load} per case."""

    trajectories: list[Any]
    loads: list[dict[tuple[str, float], float | None]]


def kept(trajectory: Any, cases: Cases) -> Any:
    from fatigue_runner.campaign.evaluate import discarded

    return discarded(trajectory, cases.discard)


def equivalent_loads(trajectory: Any, cases: Cases) -> dict[tuple[str, float], float | None]:
    """{(channel, exponent): short-term DEL}"""
    from fatigue_runner.fatigue import channel_fatigue

    out: dict[tuple[str, float], float | None] = {}
    for channel in cases.channels:
        found = channel_fatigue(
            trajectory.loads[channel], cases.exponents, trajectory.duration, cases.residue
        )
        out |= {(channel, m): found.load(m) for m in cases.exponents}
    return out


def make_reference(cases: Cases) -> Reference:
    """Raises InputError where the reference itself diverges."""
    from fatigue_runner.errors import InputError

    method, step = cases.reference.method, cases.reference.step
    block = [kept(t, cases) for t in cases.run(cases.reference)]
    lost = [t.diverged_at for t in block if t.diverged_at is not None]
    if lost:
        raise InputError(
            f"{cases.name}: the reference {method} at {step * 1e3:g} ms diverges at {min(lost):.1f} s; give a smaller step"
        )
    return Reference(
        [Sample(t.time, t.state, t.states) for t in block], [equivalent_loads(t, cases) for t in block]
    )


def evaluate(block: Sequence[Any], reference: Reference, cases: Cases, point: Point) -> Point:
    """Fill in a point's errors; nothing but the divergence where a case diverged."""
    from fatigue_runner.results.accuracy import compare

    times = [t.diverged_at for t in block if t.diverged_at is not None]
    if times:
        point.diverged, point.diverged_at = len(times), min(times)
        return point
    tests = [kept(t, cases) for t in block]
    found = [compare(a, b) for a, b in zip(tests, reference.trajectories, strict=True)]
    loads = [_load_errors(t, theirs, cases) for t, theirs in zip(tests, reference.loads, strict=True)]
    point.delta_e = [f.delta_e for f in found]
    point.delta_e_range = [f.delta_e_range for f in found]
    errors = _errors(found, loads)
    for name, value in errors.items():
        setattr(point, name, value)
    for wind, values in point.by_wind.items():
        numbers = cases.by_wind[wind]
        values |= _errors([found[i] for i in numbers], [loads[i] for i in numbers])
    return point


def _load_errors(
    test: Any, theirs: Mapping[tuple[str, float], float | None], cases: Cases
) -> dict[str, float]:
    """{channel: the largest relative error over the exponents}"""
    from fatigue_runner.fatigue import load_error

    out: dict[str, float] = {}
    for key, load in equivalent_loads(test, cases).items():
        error = load_error(load, theirs[key])
        if error is not None:
            out[key[0]] = max(out.get(key[0], 0.0), abs(error))
    return out


def _errors(found: Sequence[Any], loads: Sequence[Mapping[str, float]]) -> dict[str, Any]:
    """The errors of a point, pooled over cases: what `compare` found of them, and their `_load_errors`."""
    nrmse = {name: float(np.sqrt(np.mean([f.nrmse[name] ** 2 for f in found]))) for name in found[0].nrmse}
    worst = {
        name: max(errors.get(name, 0.0) for errors in loads)
        for name in dict.fromkeys(n for e in loads for n in e)
    }
    return {
        "nrmse": nrmse,
        "nrmse_max": max(nrmse.values()),
        "nrmse_worst": max(f.nrmse_max for f in found),
        "del_error": worst,
        "del_error_max": max(worst.values(), default=None),
    }


def reference_quality(cases: Cases, reference: Reference) -> list[dict[str, Any]]:
    """How far the reference is from itself at half its step, and from another method of high order at both: NRMSE of the worst
    state of the worst case, that state and how far it moves at least in a case, largest DEL error."""

    moves = np.min([np.ptp(t.state, axis=0) for t in reference.trajectories], axis=0)
    names = [c.name for c in reference.trajectories[0].states]
    method, step = cases.reference.method, cases.reference.step
    other = "rk7" if method == "dop853" else "dop853"
    rows = []
    for name, size in ((method, step / 2), (other, step), (other, step / 2)):
        integrator = Integrator(name, size)
        block = cases.run(integrator)
        point = evaluate(block, reference, cases, point_of(integrator, cases, block))
        state = max(point.nrmse, key=lambda name: point.nrmse[name], default="")
        rows.append(
            {
                "method": name,
                "step": size,
                "state": state,
                "moves": float(moves[names.index(state)]) if state else None,
                "nrmse_worst": point.nrmse_worst,
                "del_error_max": point.del_error_max,
                "diverged": point.diverged,
            }
        )
    return rows
