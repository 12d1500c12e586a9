"""Cases: one wind realisation times one integrator, with a readable name and a hash of all it depends on."""

from __future__ import annotations

import hashlib
import itertools
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from fatigue_runner.campaign.integration import Integration
from fatigue_runner.campaign.provenance import code_hash
from fatigue_runner.campaign.resolve import Named
from fatigue_runner.errors import InputError
from fatigue_runner.naming import LONGEST_NAME, joined
from fatigue_runner.wind.section import Realisation

if TYPE_CHECKING:
    from fatigue_runner.campaign.spec import Campaign


@dataclass(frozen=True)
class Case:
    """One row of the results.

    `simulation_hash` is of everything that decides the trajectory: with it a log can be trusted again. `hash`
    is of that, the reference's and the evaluation's settings: with it the finished record can be trusted
    again.
    """

    id: str
    wind: Realisation
    integration: Integration
    simulation_hash: str
    hash: str


def log_precision(case: Case, campaign: Campaign) -> str:
    """Of its log: a reference's reads back to the bit, since others are measured against it when a run goes on."""
    return "float64" if case.integration.is_reference else campaign.log.precision


def make_cases(named: Named) -> list[Case]:
    """All cases of a campaign, wind by wind, the reference of a wind first."""
    campaign = named.campaign
    common = campaign.model_dump(include={"duration", "output_rate", "initial", "pitch"})
    evaluation = campaign.model_dump(include={"fatigue", "discard", "loads"}) | {
        "log": campaign.log.model_dump(exclude={"enabled", "cases"})
    }
    evaluation["walls"] = {
        place: [wall.circle.diameter, wall.circle.wall] for place, wall in named.walls.items()
    }
    shared = {
        "code": code_hash(),
        "turbine": named.turbine.hash,
        "watched": named.turbine.watched,
        **common,
        # what its log holds of it
        "log": campaign.log.model_dump(include={"precision", "topics", "channels"}),
    }
    of_all, of_evaluation = hashlib.sha256(_text(shared)), hashlib.sha256(_text(evaluation))
    integrations = [(found, _text(found.identity)) for found in named.integrations]
    cases = []
    for wind in named.realisations:
        reference_hash, of_wind = "", _more(of_all, _text(wind.identity))
        for integration, identity in integrations:
            case_id = joined(wind.id, integration.id)
            simulation_hash = _more(of_wind, identity).hexdigest()
            reference_hash = simulation_hash if integration.is_reference else reference_hash
            record = [simulation_hash, reference_hash, integration.is_reference, case_id]
            whole = _more(of_evaluation, _text(record)).hexdigest()
            cases.append(Case(case_id, wind, integration, simulation_hash, whole))
    _refuse_same_names(cases)
    _refuse_long_names(cases)
    return cases


def _refuse_same_names(cases: Iterable[Case]) -> None:
    seen: dict[str, Case] = {}
    for case in cases:
        if case.id in seen:
            raise InputError(
                f"two cases would have the same name {case.id!r}; {_way_out(seen[case.id], case)}"
            )
        seen[case.id] = case


def _refuse_long_names(cases: Iterable[Case]) -> None:
    for case in cases:
        if len(f"{case.id}.mcap.part".encode()) > LONGEST_NAME:
            raise InputError(
                f"the log of case {case.id[:60]}... would have a name of more than {LONGEST_NAME} bytes; give the corrector or the file a "
                "shorter name"
            )


def _way_out(one: Case, other: Case) -> str:
    if one.integration != other.integration:
        a, b = one.integration, other.integration
        return f"their steps {a.step!r} and {b.step!r} s differ too little, or their correctors are called alike; remove one"
    if one.wind.file is not None:
        return "rename one of the wind files"
    return "their winds differ in digits that no name shows; remove one"


def blocks(items: Sequence[Any], keys: Sequence[Any], size: int, workers: int) -> list[list[Any]]:
    """Winds grouped for the lane kernel: one grid and number of signals (`keys`) per block, at most `size` winds, even shares.

    No more blocks than needed, but at least `workers` where there are winds enough.
    """
    groups: dict[Any, list[Any]] = {}
    for item, key in zip(items, keys, strict=True):
        groups.setdefault(key, []).append(item)
    result = []
    for group in groups.values():
        count = max(math.ceil(len(group) / size), min(workers, len(group)))
        bounds = [round(i * len(group) / count) for i in range(count + 1)]
        result += [group[a:b] for a, b in itertools.pairwise(bounds)]
    return result


def _text(value: Any) -> bytes:
    return json.dumps(value, sort_keys=True, separators=(",", ":")).encode() + b"\n"


def _more(begun: Any, text: bytes) -> Any:
    """A hash that was begun, gone on with; what many cases share is hashed once."""
    found = begun.copy()
    found.update(text)
    return found
