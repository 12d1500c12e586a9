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

from fatigue_runner.campaign.spec import Campaign, Integrator, Wind
from fatigue_runner.errors import InputError
from fatigue_runner.inputs.source import Source
from fatigue_runner.inputs.sweep import expand

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
class WindCase:
    """One wind realisation: its name in case ids, and plain values that make it on any worker."""

    id: str
    kind: str  # a kind of `fatigue_runner.wind`, or 'file'
    parameters: tuple[tuple[str, Any], ...]
    path: tuple[str | int, ...] = ()  # where in the campaign file it stands

    def build(self) -> Any:
        """The wind source; raises InputError for parameters that it refuses."""
        from fatigue_runner.wind import make_wind, read_wind_file

        parameters = dict(self.parameters)
        if self.kind == "file":
            return read_wind_file(parameters["file"])
        return make_wind(self.kind, **parameters)


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
        return _join(f"{self.method}_{self.step * 1e3:.9g}ms", self.mode, self.corrector)


@dataclass(frozen=True)
class Case:
    """One row of the results.

    `simulation_hash` is of everything that decides the trajectory: with it a log can be trusted again. `hash`
    is of that, the reference's and the evaluation's settings: with it the finished record can be trusted
    again.
    """

    id: str
    wind: WindCase
    integration: Integration
    simulation_hash: str
    hash: str


def wind_cases(wind: Wind, duration: float, turbine: Any, source: Source) -> list[WindCase]:
    """Every combination of speed, shear and seed in the order speed, shear, seed; or one per file."""
    if wind.type == "file":
        return [_file_case(source, name, index) for index, name in enumerate(wind.files)]
    combine = {"constant": _constant_cases, "turbulent": _turbulent_cases}[wind.type]
    return [
        case
        for speed, piece in expand(wind.speeds)
        for case in combine(wind, speed, ("wind", "speeds", piece), duration, turbine)
    ]


def _constant_cases(
    wind: Wind, speed: float, path: tuple[str | int, ...], duration: float, turbine: Any
) -> Iterable[WindCase]:
    if wind.shear_exponent is None:
        vertical = [value for value, _ in expand(wind.vertical_shear)]
    else:
        radius, height = rotor(turbine)
        vertical = [wind.shear_exponent * radius / height]
    for kv in vertical:
        for kh, _ in expand(wind.horizontal_shear):
            yield WindCase(
                _join(_speed(speed), kv and f"kv{_value(kv)}", kh and f"kh{_value(kh)}"),
                "constant",
                (("speed", speed), ("vertical_shear", kv), ("horizontal_shear", kh)),
                path,
            )


def _turbulent_cases(
    wind: Wind, speed: float, path: tuple[str | int, ...], duration: float, turbine: Any
) -> Iterable[WindCase]:
    strength = (
        ("intensity", wind.intensity)
        if wind.turbulence_class is None
        else ("turbulence_class", wind.turbulence_class)
    )
    shear = () if wind.shear_exponent is None else (("shear_exponent", wind.shear_exponent),)
    sizes = tuple(zip(("rotor_radius", "hub_height"), rotor(turbine), strict=True))
    for seed in wind.seeds_at(speed):
        label = f"ti{_value(wind.intensity)}" if wind.intensity is not None else f"ntm{wind.turbulence_class}"
        yield WindCase(
            _join(_speed(speed), label, f"s{seed}"),
            "turbulent",
            (("mean", speed), strength, ("seed", seed), ("duration", duration), *shear, *sizes),
            path,
        )


def rotor(turbine: Any) -> tuple[float, float]:
    """Rotor radius and hub height [m] of a turbine, from the parameters of its equations."""
    p = turbine.parameters
    return p["radius"], p["t_h"] + p["tower_to_shaft"] + p["overhang"] * p["sin_tilt"]


def _file_case(source: Source, name: str, index: int) -> WindCase:
    path = resolve(source, name)
    try:
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        where = source.where(("wind", "files", index))
        raise InputError(
            f"{where}: wind file {name!r} cannot be read ({error.strerror}); paths start at the campaign file"
        ) from None
    stem = "".join(c if c.isalnum() or c in ".-" else "-" for c in path.stem)
    return WindCase(stem, "file", (("file", str(path)), ("sha256", digest)), ("wind", "files", index))


def resolve(source: Source, name: str) -> Path:
    """A path written in the campaign file: relative to that file."""
    path = Path(name).expanduser()
    return path if path.is_absolute() else source.folder / path


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
    campaign: Campaign, winds: Sequence[WindCase], turbine_hash: str, source: Source
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
                # A file's content counts, not where it lies.
                "wind": [wind.kind, [pair for pair in wind.parameters if pair[0] != "file"]],
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


def _join(*parts: Any) -> str:
    return "_".join(str(part) for part in parts if part)


def _speed(speed: float) -> str:
    """`v08.00`, `v07.1234`: sorted by name is sorted by speed for the usual two digits."""
    text = f"{speed:05.2f}" if round(speed, 2) == speed else f"{speed:.9g}"
    return "v" + (text if speed >= 10 or text.startswith("0") else f"0{text}")


def _value(value: float) -> str:
    return f"{value:.2f}" if round(value, 2) == value else f"{value:.6g}"
