"""What a worker does: one block of winds, first with the reference, then with every integrator."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fatigue_runner.campaign.cases import Case, log_precision
from fatigue_runner.campaign.evaluate import (
    Evaluated,
    evaluate,
    failed_row,
    make_row,
    scaled_error,
)
from fatigue_runner.campaign.integration import Integration
from fatigue_runner.campaign.pieces import leave
from fatigue_runner.campaign.spec import Campaign
from fatigue_runner.channels import Channel, placed
from fatigue_runner.errors import FatigueRunnerError
from fatigue_runner.fatigue.sections import Wall
from fatigue_runner.results.columns import DESCRIPTION
from fatigue_runner.stopwatch import stage
from fatigue_runner.trajectory import Trajectory

if TYPE_CHECKING:
    from fatigue_runner.turbine.section_loads import SectionLoads


@dataclass(frozen=True)
class Setup:
    """What all blocks of a campaign share; travels to the workers."""

    campaign: Campaign
    turbine: str  # name or path, for `load_turbine`
    turbine_hash: str
    states: tuple[Channel, ...]
    logs: Path
    metadata: dict[str, str] = field(default_factory=dict)  # of every log's `run` record
    attachments: dict[str, bytes] = field(default_factory=dict)
    walls: dict[str, Wall] = field(default_factory=dict)
    sections: SectionLoads | None = None


@dataclass(frozen=True)
class Job:
    """One block: the cases to run, the references of their winds, the winds' states (size,) at t = 0 by id.

    logged: ids of the cases whose trajectory stands in a log already, so that it is read, not simulated; to_log: of those whose log is
    written; leaves: whether each record is left in the run folder as soon as the case is done.
    """

    setup: Setup
    cases: list[Case]
    references: list[Case]
    initial: dict[str, np.ndarray]
    logged: set[str]
    to_log: set[str]
    leaves: bool = True


def run_block(job: Job) -> list[dict[str, Any]]:
    """Simulate, evaluate and log the cases of a block; returns their records for `cases.jsonl`.

    No exception of one integrator or case ends the others: it becomes a row with the status `failed`.
    """
    rotor = _turbine(job.setup.turbine, job.setup.turbine_hash, job.setup.campaign.operation).rotor
    with stage("wind"):
        winds = {case.wind: _wind(case, rotor) for case in [*job.references, *job.cases]}
    references: dict[Any, Evaluated | None] = {}
    wanted = {case.id for case in job.cases}
    records = []
    for integration, cases in _by_integration([*job.references, *job.cases]).items():
        outcomes = _trajectories(job, integration, cases, winds)
        while cases:
            # popped, so that nothing of one integrator is in memory when the next one begins
            case, outcome = cases.pop(0), outcomes.pop(0)
            record = _one(job, case, winds[case.wind], outcome, references, case.id in wanted)
            if record is not None:
                records.append(record)
            if record is not None and job.leaves:
                # a full disk, a folder that is gone: the record comes back with the block's
                with suppress(OSError):
                    leave(job.setup.logs.parent, job.cases[0].id, record)
            del outcome
    return records


def warm_up(job: Job) -> None:
    """Compile what a job needs, here: two steps of each of its methods, under each kind of its winds, and the counting of cycles."""
    from fatigue_runner.fatigue import count_channels

    setup = job.setup
    campaign = setup.campaign
    count_channels({"": [0.0, 1.0, 0.0, 1.0]}, campaign.fatigue.wohler_exponents, 1.0)
    turbine = _turbine(setup.turbine, setup.turbine_hash, campaign.operation)
    done = set()
    for case in (*job.references, *job.cases):
        found = case.integration
        outputs = 1 + math.ceil(2 * found.step * campaign.output_rate)
        short = dataclasses.replace(
            setup, campaign=campaign.model_copy(update={"duration": outputs / campaign.output_rate})
        )
        try:
            wind = case.wind.build(turbine.rotor)
            kind = found.method, found.corrector, found.mode, turbine.layout.beyond(wind.channels)
            if kind not in done:
                done.add(kind)
                simulate(short, found, [wind], job.initial[case.wind.id][None])
        except FatigueRunnerError:
            continue  # what is wrong shows when the cases run


def _one(
    job: Job,
    case: Case,
    wind: Any,
    outcome: Trajectory | Exception,
    references: dict[Any, Evaluated | None],
    wanted: bool,
) -> dict[str, Any] | None:
    """The record of a case, None where it is not wanted; a reference is noted for its wind."""
    campaign, reference = job.setup.campaign, references.get(case.wind)
    try:
        if isinstance(outcome, Exception):
            raise outcome
        with stage("loads"):
            outcome = rounded(with_sections(job.setup, outcome), campaign.log.precision)
        with stage("counting"):
            own = evaluate(outcome, campaign, job.setup.walls)
        if case.integration.is_reference:
            references[case.wind] = own.compared if outcome.diverged_at is None else None
        return _finish(job, case, wind, outcome, own, reference) if wanted else None
    except Exception as error:  # one case's trouble (a full disk, a bad wind) must not end the others
        source = None if isinstance(wind, Exception) else wind
        failed = _record(case, failed_row(case, source, error, campaign, job.setup.states))
        return failed if wanted else None


def rounded(trajectory: Trajectory, precision: str) -> Trajectory:
    """With its loads as a log of this precision holds them: what is counted in memory and what is counted from the log is the same."""
    return dataclasses.replace(
        trajectory,
        loads={name: values.astype(precision, copy=False) for name, values in trajectory.loads.items()},
    )


def with_sections(setup: Setup, trajectory: Trajectory) -> Trajectory:
    """With the loads of those sections that are asked for; a log may hold those of others."""
    own = {name: values for name, values in trajectory.loads.items() if not placed(name)}
    if setup.sections is not None:
        turbine = _turbine(setup.turbine, setup.turbine_hash, setup.campaign.operation)
        own |= setup.sections.of(
            turbine, trajectory.state, trajectory.wind, own, own["blade_pitch"], trajectory.winds
        )
    return dataclasses.replace(trajectory, loads=own)


def _by_integration(cases: Iterable[Case]) -> dict[Integration, list[Case]]:
    """Cases grouped by integrator, the reference first, each case once."""
    groups: dict[Integration, dict[str, Case]] = {}
    for case in cases:
        groups.setdefault(case.integration, {})[case.id] = case
    return {integration: list(group.values()) for integration, group in groups.items()}


def _wind(case: Case, rotor: Any) -> Any:
    try:
        return case.wind.build(rotor)
    except FatigueRunnerError as error:
        return error


def _trajectories(
    job: Job, integration: Integration, cases: Sequence[Case], winds: dict[Any, Any]
) -> list[Trajectory | Exception]:
    """Every case's trajectory: from its log where that is complete, the others in one call of the kernel."""
    outcomes: dict[str, Trajectory | Exception] = {}
    for case in cases:
        if isinstance(winds[case.wind], Exception):
            outcomes[case.id] = winds[case.wind]
        elif case.id in job.logged:
            found = _read(job, case)
            if found is not None:
                outcomes[case.id] = found
    missing = [case for case in cases if case.id not in outcomes]
    if missing:
        try:
            initial = np.stack([job.initial[case.wind.id] for case in missing])
            simulated = simulate(job.setup, integration, [winds[case.wind] for case in missing], initial)
            outcomes |= {case.id: t for case, t in zip(missing, simulated, strict=True)}
        except Exception as error:  # becomes the row of each of these cases
            outcomes |= dict.fromkeys((case.id for case in missing), error)
    return [outcomes[case.id] for case in cases]


def _read(job: Job, case: Case) -> Trajectory | None:
    """The trajectory in a case's log; None where it cannot be read, so that the case is simulated again."""
    from fatigue_runner.logbook import read_log

    try:
        return read_log(job.setup.logs / f"{case.id}.mcap")
    except (FatigueRunnerError, OSError):
        return None


def simulate(
    setup: Setup, integration: Integration, winds: Sequence[Any], initial: np.ndarray
) -> list[Trajectory]:
    """All winds of a block with one integrator, from the states (n, size)."""
    from fatigue_runner import integrators

    campaign = setup.campaign
    turbine = _turbine(setup.turbine, setup.turbine_hash, campaign.operation)
    output_step = 1.0 / campaign.output_rate
    ensemble = integrators.Ensemble(
        turbine, winds, initial, campaign.duration, output_step, campaign.blade_pitch, campaign.log.precision
    )
    return integrators.simulate(ensemble, integration.build())


@functools.lru_cache(maxsize=4)
def _turbine(source: str, expected_hash: str, operation: str) -> Any:
    """The turbine, loaded once per worker; refused where it is not the one that the cases were made for."""
    from fatigue_runner.turbine import load_turbine

    turbine = load_turbine(source).operated(operation)
    if turbine.hash != expected_hash:
        raise FatigueRunnerError(
            f"turbine {source} changed while the campaign ran, or differs on this worker; run it again"
        )
    return turbine


def _finish(
    job: Job, case: Case, wind: Any, trajectory: Trajectory, own: Evaluated, reference: Evaluated | None
) -> dict[str, Any]:
    """Write the log of a case and make its record."""
    from fatigue_runner.logbook import log_of

    campaign = job.setup.campaign
    row = make_row(case, wind, trajectory, own, reference, campaign)
    if case.id not in job.to_log:
        return _record(case, row)
    path = job.setup.logs / f"{case.id}.mcap"
    identity = {
        **job.setup.metadata,
        "case_id": case.id,
        "case_hash": case.hash,
        "wind": wind.name,
        "wind_description": wind.description,
        "wind_strength": wind.strength,
        "wind_left_out": wind.left_out,
        "wind_notes": " ".join(wind.notes),
        "discard": f"{campaign.discard:g}",
        "corrector_hash": case.integration.digest or "",
        **{name: "" if row[name] is None else str(row[name]) for name in DESCRIPTION},
    }
    said = {"case_id", *DESCRIPTION}
    result = {name: str(value) for name, value in row.items() if value is not None and name not in said}
    error = None
    if reference is not None and not case.integration.is_reference and trajectory.diverged_at is None:
        with stage("comparison"):
            error = scaled_error(trajectory, reference.whole)
    with stage("logging"):
        log = log_of(
            path,
            trajectory,
            identity,
            job.setup.attachments,
            result,
            reference_error=error,
            compression=campaign.log.compression,
            precision=log_precision(case, campaign),
            topics=campaign.log.topics,
            channels=campaign.logged,
        )
    return _record(case, row, log.size, log.checksum)


def _record(case: Case, row: dict[str, Any], log_bytes: int = 0, log_checksum: int = 0) -> dict[str, Any]:
    return {
        "hash": case.hash,
        "simulation_hash": case.simulation_hash,
        "log_bytes": log_bytes,
        "log_checksum": log_checksum,
        "row": row,
    }
