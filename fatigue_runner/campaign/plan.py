"""From a campaign file to the work to be done, without writing or running anything."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fatigue_runner.campaign import checks
from fatigue_runner.campaign.block import Job, Setup
from fatigue_runner.campaign.cases import Case, blocks, code_hash, integrations, make_cases, realisations
from fatigue_runner.campaign.spec import Campaign, parse_campaign
from fatigue_runner.campaign.store import Store
from fatigue_runner.errors import InputError
from fatigue_runner.inputs.source import Place, Source, read_source

# Winds per block: the width of the lane kernel. A block is what progress counts in and what Ctrl-C can lose.
BLOCK_SIZE = 16


@dataclass
class Plan:
    """A checked campaign: its cases, and each wind's grid [s], which says what may share a block."""

    campaign: Campaign
    source: Source
    turbine: Any
    cases: list[Case]
    cell_keys: dict[str, float | None]  # by wind id
    initial: dict[str, np.ndarray]  # by wind id
    notes: list[str] = field(default_factory=list)  # what a person should know before the run

    @property
    def turbine_source(self) -> str:
        """What a worker gives to `load_turbine`."""
        return checks.turbine_source(self.campaign, self.source)

    @property
    def identity(self) -> dict[str, Any]:
        """What a run folder of this campaign must have in common with it."""
        common = self.campaign.model_dump(include={"name", "duration", "output_rate", "initial", "pitch"})
        return {"code": code_hash(), "turbine_hash": self.turbine.hash, **common}

    @property
    def logs_are_whole(self) -> bool:
        """Whether a log holds all that a trajectory needs to be evaluated again."""
        return self.campaign.log.topics is None and self.campaign.log.channels is None

    def jobs(self, store: Store, setup: Setup, workers: int) -> list[Job]:
        """The blocks of all cases that are not finished in the store, with the references that they need."""
        pending: dict[str, list[Case]] = {}
        references: dict[str, Case] = {}
        for case in self.cases:
            if case.integration.is_reference:
                references[case.wind.id] = case
            if store.finished(case, self.campaign.log.enabled) is None:
                pending.setdefault(case.wind.id, []).append(case)
        keys = [self.cell_keys[wind] for wind in pending]
        jobs = []
        for winds in blocks(list(pending), keys, BLOCK_SIZE, workers):
            needed = [references[wind] for wind in winds if wind in references]
            cases = [case for wind in winds for case in pending[wind]]
            logged = {case.id for case in [*needed, *cases] if self.logs_are_whole and store.logged(case)}
            initial = {wind: self.initial[wind] for wind in winds}
            jobs.append(Job(setup, cases, needed, initial, logged))
        return jobs


def make_plan(
    campaign: str | Path | Mapping[str, Any], say: Callable[[str], None] = lambda what: None
) -> Plan:
    """Read, validate and expand a campaign file or mapping. Raises InputError with "file:line".

    say: told what is going on, since the first checks on a machine compile the kernels.
    """
    say("reading the campaign")
    source = read_source(campaign)
    for key in ("cases", "benchmark"):
        if key in source.data:
            raise InputError(
                f"{source.where((key,))}: the key {key!r} makes it a benchmark's file; "
                f"run it with `fatigue-runner benchmark work-precision {source.name}`"
            )
    spec = parse_campaign(source)
    say("loading the kernels (the first run compiles them)")
    turbine = checks.load_turbine(spec, source)
    checks.check_pitch(spec, turbine, source)
    checks.check_integrators(spec, turbine, source)
    winds = realisations(spec, turbine, source)
    built = checks.build_winds(winds, spec, source)
    keys = {case.id: wind.cell_key for case, wind in zip(winds, built, strict=True)}
    initial = checks.initial_states(winds, built, spec, turbine, source)
    cases = make_cases(spec, winds, turbine.hash, source)
    notes = checks.unseen_winds(integrations(spec, source), built, source)
    return Plan(spec, source, turbine, cases, keys, initial, notes)


def resolved_yaml(plan: Plan) -> str:
    """The campaign with every default written out, as YAML that can be run again from anywhere."""
    data = plan.campaign.model_dump(exclude={"wind", "integrators", "reference"})
    data["turbine"] = plan.turbine_source
    data["wind"] = plan.campaign.wind.resolved(Place(plan.source, ("wind",)))
    data["integrators"] = [_resolved_integrator(item, plan) for item in plan.campaign.integrators]
    data["reference"] = None if plan.campaign.reference is None else plan.campaign.reference.model_dump()
    return _yaml("The campaign of this run folder, with every default written out.", data)


def turbine_yaml(plan: Plan) -> str:
    """The turbine's file with what it is based on; of its aerodynamic tables the name only, their content is in the hash."""
    from fatigue_runner.turbine.parameters import read_turbine_file

    data = read_turbine_file(plan.turbine_source)
    aero = data.get("aerodynamics", {})
    data["aerodynamics"] = aero | {key: Path(aero[key]).name for key in ("tables", "airfoils") if key in aero}
    return _yaml(f"The turbine of this run, hash {plan.turbine.hash}.", data)


def _yaml(heading: str, data: dict[str, Any]) -> str:
    from ruamel.yaml import YAML

    text = io.StringIO()
    text.write(f"# {heading}\n")
    yaml: Any = YAML(typ="safe", pure=True)
    yaml.sort_base_mapping_type_on_output = False
    yaml.default_flow_style = None
    yaml.dump(data, text)
    return text.getvalue()


def _resolved_integrator(item: Any, plan: Plan) -> dict[str, Any]:
    if item.corrector is None:
        return dict(_without_none(item.model_dump(exclude={"mode"})))
    files = {case.integration.path[-1]: case.integration.file for case in plan.cases if case.integration.file}
    index = plan.campaign.integrators.index(item)
    return {**_without_none(item.model_dump()), "corrector": files[index]}


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    return [_without_none(item) for item in value] if isinstance(value, list) else value
