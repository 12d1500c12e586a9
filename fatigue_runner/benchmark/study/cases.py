"""The cases that every integrator of a work-precision benchmark meets, from a campaign file.

A benchmark's file is a campaign file with two keys more: `cases`, a list of sections whose keys go before those of the top level
(winds, duration, turbine, ...), each a campaign of its own; and `benchmark`, how the integrators are run (`Settings`). A plain
campaign file is fine, too: one set of cases. What a file lists as `integrators` runs beside the methods.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator

from fatigue_runner.campaign.resolve import named_by, resolve
from fatigue_runner.campaign.spec import campaign_source, parse_campaign
from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.inputs.section import Section, problem, validated
from fatigue_runner.inputs.source import Source
from fatigue_runner.inputs.sweep import Sweep, expand
from fatigue_runner.integrators import Ensemble, Integrator
from fatigue_runner.integrators.pitch import PitchSeries
from fatigue_runner.integrators.wind_steps import longest_step
from fatigue_runner.trajectory import Trajectory
from fatigue_runner.turbine.turbine import FIXED

# Seeds 9000 to 9999 are the benchmarks': correctors are trained on seeds from 100,000 on.
SEEDS = range(9000, 10_000)
# What a campaign must have and the benchmark does not need: all methods run at the benchmark's steps.
_ANY = [{"method": "rk4", "step": 0.01}]

Positive = Annotated[float, Field(gt=0)]


class Settings(Section):
    """The key `benchmark`.

    methods: null for every registered one; steps [s]: each method runs at those from its second unstable one down to the first
    that costs more than `most_evaluations` per simulated second or brings its NRMSE below `finest`; correctors: names or paths,
    null for every shipped one that fits the turbine; tolerances, adaptive_cases: of the adaptive methods, and how many of the cases
    they solve; rounds: interleaved repeats of the timing; timed_evaluations: how long a timed run is, unless the cases are shorter.
    """

    methods: list[str] | None = None
    steps: Sweep = Field(
        default=[0.4, 0.3, 0.2, 0.15, 0.1, 0.07, 0.05, 0.035, 0.025, 0.02, 0.015, 0.01, 0.007, 0.005, 0.0035, 0.002, 0.001]
    )  # fmt: skip
    most_evaluations: Positive = 1000.0
    finest: Positive = 1e-6
    correctors: list[str] | None = None
    modes: list[Literal["enhanced", "hybrid"]] = Field(default=["enhanced", "hybrid"])
    tolerances: list[Positive] = Field(default=[1e-3, 1e-4, 1e-5, 1e-6, 1e-7])
    adaptive_cases: int = Field(default=4, ge=0)
    rounds: int = Field(default=7, ge=1)
    timed_evaluations: Positive = 20_000.0

    @field_validator("methods")
    @classmethod
    def _methods_exist(cls, names: list[str] | None) -> list[str] | None:
        from fatigue_runner.integrators import METHODS

        for name in names or ():
            if name not in METHODS:
                raise problem(f"unknown integrator {name!r}{did_you_mean(name, METHODS)}")
        return names

    @property
    def ladder(self) -> list[float]:
        """Steps [s], the largest first."""
        return sorted({step for step, _ in expand(self.steps)}, reverse=True)


class _File(BaseModel):
    """The one key of the file that no campaign has; so named, a mistake is told with its place."""

    model_config = ConfigDict(extra="ignore")
    benchmark: Settings = Settings()


@dataclass
class Cases:
    """An ensemble that every integrator meets, with what its fatigue is judged by and the reference.

    discard [s]: left out at the start; channels, exponents, residue: of the loads that are counted. integrators: those that the
    campaign lists.
    """

    name: str
    ensemble: Ensemble
    discard: float
    channels: list[str]
    exponents: list[float]
    residue: str
    reference: Integrator
    integrators: list[Integrator]

    @property
    def duration(self) -> float:
        """[s]"""
        return self.ensemble.duration

    @property
    def output_step(self) -> float:
        """[s]"""
        assert self.ensemble.output_step is not None
        return self.ensemble.output_step

    @property
    def pitch(self) -> float:
        """[rad]; a benchmark has one."""
        assert not isinstance(self.ensemble.pitch, PitchSeries)
        return self.ensemble.pitch

    @property
    def longest_step(self) -> float:
        """[s]: beyond, the winds' harmonics are taken for slower ones, and a run is refused."""
        e = self.ensemble
        return min(longest_step(e.turbine, wind, x) for wind, x in zip(e.winds, e.initial, strict=True))

    @property
    def by_wind(self) -> dict[str, list[int]]:
        """{mean speed [m/s] as text: numbers of its cases}, the slowest first, where the turbine operates and each wind is another
        turbine; else nothing."""
        if self.ensemble.turbine.operation == FIXED:
            return {}
        speeds = [wind.mean_speed for wind in self.ensemble.winds]
        return {f"{v:g}": [i for i, own in enumerate(speeds) if own == v] for v in sorted(set(speeds))}

    @property
    def turbulent(self) -> bool:
        return any(wind.cell_key is not None for wind in self.ensemble.winds)

    def run(self, integrator: Integrator, duration: float | None = None) -> list[Trajectory]:
        """Trajectories of all cases, or of their first `duration` seconds."""
        from fatigue_runner.integrators import simulate

        return simulate(replace(self.ensemble, duration=duration or self.duration), integrator)


# Of files that name none; its quality is measured in every run.
REFERENCE = {"method": "dop853", "step": 0.005}


def load(campaign: str | Path | Mapping[str, Any]) -> tuple[list[Cases], Settings]:
    """All sets of cases of a file or mapping, and how to run them. Raises InputError with "file:line" and what would be right."""
    source = campaign_source(campaign)
    sections = source.data.get("cases", [{}])
    if not isinstance(sections, list) or not sections or not all(isinstance(s, Mapping) for s in sections):
        raise InputError(
            f"{source.where(('cases',))}: cases must be a list of sections, each with its own winds"
        )
    settings = validated(_File, source).benchmark
    found = []
    for number in range(len(sections)):
        path: tuple[str | int, ...] = ("cases", number) if "cases" in source.data else ()
        found.append(_cases(source.section(path, ("cases", "benchmark"))))
    names = [cases.name for cases in found]
    if len(set(names)) < len(names):
        raise InputError(
            f"{source.where(('cases',))}: two sets of cases have one name; give each its own `name`"
        )
    return found, settings


def _cases(source: Source) -> Cases:
    listed = "integrators" in source.data
    source.data.setdefault("integrators", _ANY)
    source.data.setdefault("reference", REFERENCE)
    spec = parse_campaign(source)
    if spec.reference is None:
        raise InputError(
            f"{source.where(('reference',))}: a benchmark needs a reference; name one or leave the key out"
        )
    if not isinstance(spec.pitch, int | float):
        raise InputError(
            f"{source.where(('pitch',))}: a benchmark needs one pitch: its exponential methods and its correctors are made for one"
        )
    resolved = resolve(named_by(spec, source))
    reference, *others = [integration.build() for integration in resolved.integrations]
    return Cases(
        spec.name, resolved.ensemble(), spec.discard, list(spec.fatigue.channels), list(spec.fatigue.wohler_exponents),
        spec.fatigue.residue, reference, others if listed else [],
    )  # fmt: skip
