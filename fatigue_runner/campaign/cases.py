"""Cases: one wind realisation times one integrator, with a readable name and a hash of all it depends on."""

from __future__ import annotations

import functools
import hashlib
import itertools
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fatigue_runner.campaign.spec import Campaign, Integrator
from fatigue_runner.errors import InputError
from fatigue_runner.inputs.source import Place, Source
from fatigue_runner.inputs.sweep import expand
from fatigue_runner.naming import integrator_id
from fatigue_runner.wind.section import Realisation, Site

# The code that decides the figures of a case.
NUMERICAL_CODE = (
    "turbine",
    "wind",
    "integrators",
    "corrector/artefact.py",
    "fatigue",
    "accuracy.py",
    "campaign/evaluate.py",
)


@dataclass(frozen=True)
class Integration:
    """One integrator at one step [s]."""

    method: str
    step: float
    is_reference: bool = False
    path: tuple[str | int, ...] = ()
    corrector: str = ""  # its name
    mode: str = ""
    file: str = ""  # of the corrector
    digest: str = ""  # of that file

    @property
    def id(self) -> str:
        """`heun_10ms`, `rk7_0.1ms`, `heun_10ms_hybrid_heun-10ms`."""
        return integrator_id(self.method, self.step, self.corrector, self.mode)


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


def realisations(campaign: Campaign, turbine: Any, source: Source) -> list[Realisation]:
    """Every wind of the campaign, on this turbine."""
    site = Site(turbine.rotor, campaign.duration, Place(source, ("wind",)))
    return list(campaign.wind.realisations(site))


def integrations(campaign: Campaign, source: Source) -> list[Integration]:
    """The reference first, then every integrator at each of its steps.

    Raises InputError, with the line, for a corrector that is not found or cannot be read.
    """
    reference = campaign.reference
    first = [Integration(reference.method, reference.step, True, ("reference",))] if reference else []
    return first + [
        Integration(
            integrator.method, step, False, ("integrators", index), *_corrector(integrator, source, index)
        )
        for index, integrator in enumerate(campaign.integrators)
        for step, _ in expand(integrator.step)
    ]


def _corrector(integrator: Integrator, source: Source, index: int) -> tuple[str, str, str, str]:
    """(name, mode, file, digest), empty where there is none."""
    if integrator.corrector is None:
        return "", "", "", ""
    from fatigue_runner.corrector import library, load

    try:
        path = library.locate(integrator.corrector, [source.folder])
        name = load(path).name
    except InputError as error:
        raise InputError(f"{source.where(('integrators', index, 'corrector'))}: {error}") from None
    return name, integrator.mode, str(path.resolve()), hashlib.sha256(path.read_bytes()).hexdigest()


def make_cases(
    campaign: Campaign, winds: Sequence[Realisation], turbine_hash: str, source: Source
) -> list[Case]:
    """All cases of a campaign, wind by wind, the reference of a wind first."""
    common = campaign.model_dump(include={"duration", "output_rate", "initial", "pitch"})
    evaluation = campaign.model_dump(include={"fatigue", "discard"}) | {"log": campaign.log.model_dump()}
    cases = []
    found = integrations(campaign, source)
    for wind in winds:
        reference_hash = ""
        for integration in found:
            simulation = {
                "code": code_hash(),
                "turbine": turbine_hash,
                "wind": wind.identity,
                "integration": [integration.method, integration.step, integration.mode, integration.digest],
                **common,
            }
            simulation_hash = _digest(simulation)
            reference_hash = simulation_hash if integration.is_reference else reference_hash
            record = [
                simulation_hash,
                reference_hash,
                integration.is_reference,
                evaluation,
                f"{wind.id}_{integration.id}",
            ]
            cases.append(
                Case(f"{wind.id}_{integration.id}", wind, integration, simulation_hash, _digest(record))
            )
    _refuse_same_names(cases)
    return cases


def _refuse_same_names(cases: Iterable[Case]) -> None:
    seen: dict[str, Case] = {}
    for case in cases:
        if case.id in seen:
            raise InputError(f"two cases would have the same name {case.id!r}; rename one of the wind files")
        seen[case.id] = case


@functools.cache
def code_hash() -> str:
    """Hash of the program's numerical code, so that figures of two versions never stand in one table."""
    root, digest = Path(__file__).parents[1], hashlib.sha256()
    for part in NUMERICAL_CODE:
        path = root / part
        for file in sorted(path.rglob("*.py")) if path.is_dir() else [path]:
            digest.update(f"{file.relative_to(root).as_posix()}\n".encode() + file.read_bytes())
    return digest.hexdigest()[:16]


def blocks(items: Sequence[Any], keys: Sequence[float | None], size: int, workers: int) -> list[list[Any]]:
    """Winds grouped for the lane kernel: one cell grid (`keys`) per block, at most `size` winds, even shares.

    No more blocks than needed, but at least `workers` where there are winds enough.
    """
    groups: dict[float | None, list[Any]] = {}
    for item, key in zip(items, keys, strict=True):
        groups.setdefault(key, []).append(item)
    result = []
    for group in groups.values():
        count = max(math.ceil(len(group) / size), min(workers, len(group)))
        bounds = [round(i * len(group) / count) for i in range(count + 1)]
        result += [group[a:b] for a, b in itertools.pairwise(bounds)]
    return result


def _digest(value: Any) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True, separators=(",", ":")).encode()).hexdigest()
