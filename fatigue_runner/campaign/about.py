"""What logs and the run folder say of a run: the facts (versions, machine), the whole campaign and the turbine as YAML."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from fatigue_runner._version import __version__
from fatigue_runner.campaign.provenance import LIBRARIES
from fatigue_runner.campaign.resolve import HIGHEST_WIND_SPEED, Named, Resolved
from fatigue_runner.campaign.spec import IntegratorSection
from fatigue_runner.errors import InputError
from fatigue_runner.inputs.files import to_yaml
from fatigue_runner.inputs.source import Place
from fatigue_runner.turbine.rated import rated_rotor_speed


def about(named: Named) -> dict[str, str]:
    """Facts by name, as text: campaign, turbine, turbine_hash, versions, machine."""
    versions = [f"fatigue-runner {__version__}", *(f"{name} {metadata.version(name)}" for name in LIBRARIES)]
    rated = rated_rotor_speed(named.turbine)
    return {
        "campaign": named.campaign.name,
        "turbine": named.turbine.name,
        "turbine_hash": named.turbine.hash,
        "rated_rotor_speed": "" if rated is None else f"{rated:.9g}",
        "versions": ", ".join([*versions, f"Python {platform.python_version()}"]),
        "machine": f"{_processor()}, {os.cpu_count()} cores, {platform.system()}",
    }


def wind_words(resolved: Resolved) -> dict[str, list[str]]:
    """What the winds are, what they leave out and what is to be known of their files: each sentence once."""
    sources = [wind.source for wind in resolved.winds]
    said = {
        "descriptions": [source.description for source in sources],
        "left_out": [source.left_out for source in sources],
        "notes": [note for wind in resolved.winds for note in wind.notes],
    }
    return {what: list(dict.fromkeys(filter(None, words))) for what, words in said.items()}


def operating_curve(resolved: Resolved) -> dict[str, list[float]]:
    """What the turbine does under its controller in steady, uniform wind, at whole m/s over the campaign's winds: {channel: [SI]},
    `wind_speed` among them; empty where nobody pitches.

    Speed, pitch and power of the whole model's operating points, thrust of the rigid rotor there.
    """
    turbine = resolved.turbine
    if not turbine.pitches:
        return {}
    speeds = [wind.source.mean_speed for wind in resolved.winds]
    first, last = turbine.operating_wind or (3.0, HIGHEST_WIND_SPEED)
    winds = np.arange(max(first, np.floor(min(speeds))), min(last, np.ceil(max(speeds))) + 0.5)
    rows = []
    for wind in winds:
        try:
            state = turbine.operating_point(float(wind))
        except InputError:
            continue  # a case in such a wind is refused elsewhere
        commanded = {name: float(value) for name, value in turbine.commanded(state).items()}
        speed = float(state[turbine.layout.rotor_speed])
        torque, pitch = commanded["generator_torque"], commanded["pitch"]
        power = turbine.generator_efficiency * torque * float(state[turbine.layout.generator_speed])
        rows.append((float(wind), speed, pitch, power, float(turbine.rigid.thrust(wind, speed, pitch))))
    names = ("wind_speed", "rotor_speed", "blade_pitch", "generator_power", "rotor_thrust")
    return {name: [row[i] for row in rows] for i, name in enumerate(names)}


def timed_evaluations(resolved: Resolved, earlier: Mapping[str, Any]) -> dict[str, dict[str, float]]:
    """{`f` or the name of a corrector: {kind: processor seconds of one evaluation}}, as `results.evaluation_cost` takes them.

    earlier: run.json of the run that goes on; its times are kept where nothing new is to be timed.
    """
    from fatigue_runner.integrators.evaluation_times import evaluation_times

    integrators = [found.build() for found in resolved.integrations]
    names = {"f", *(i.corrector_name for i in integrators if i.corrector is not None)}
    kept = earlier.get("evaluation_times")
    if isinstance(kept, dict) and names <= kept.keys():
        return {name: kept[name] for name in kept if name in names}
    return evaluation_times(resolved.ensemble(), integrators)


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    named = (line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.machine())


def resolved_yaml(named: Named) -> str:
    """The campaign with every default written out, as YAML that can be run again from anywhere."""
    data = named.campaign.model_dump(exclude={"wind", "integrators", "reference"})
    if named.campaign.operation != "fixed":
        del data["pitch"]  # the turbine makes it itself; given beside that it is refused
    data["turbine"] = named.turbine_source
    data["wind"] = named.campaign.wind.resolved(Place(named.source, ("wind",)))
    files = {found.path: found.file for found in named.integrations}
    data["integrators"] = [
        _resolved_integrator(item, files[("integrators", index)])
        for index, item in enumerate(named.campaign.integrators)
    ]
    data["reference"] = None if named.campaign.reference is None else named.campaign.reference.model_dump()
    return to_yaml("The campaign of this run folder, with every default written out.", data)


def turbine_yaml(named: Named) -> str:
    """The turbine's file with what it is based on; of its aerodynamic tables the name only, their content is in the hash."""
    from fatigue_runner.turbine.file import read_turbine_file

    data = read_turbine_file(named.turbine_source)
    aero = data.get("aerodynamics", {})
    data["aerodynamics"] = aero | {key: Path(aero[key]).name for key in ("tables", "airfoils") if key in aero}
    return to_yaml(f"The turbine of this run, hash {named.turbine.hash}.", data)


def _resolved_integrator(item: IntegratorSection, file: str) -> dict[str, Any]:
    if item.corrector is None:
        return dict(_without_none(item.model_dump(exclude={"mode"})))
    return {**_without_none(item.model_dump()), "corrector": file}


def _without_none(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_none(item) for key, item in value.items() if item is not None}
    return [_without_none(item) for item in value] if isinstance(value, list) else value
