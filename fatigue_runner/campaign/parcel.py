"""The files that jobs name, by content: for workers on machines that do not see the folders of this one.

A parcel is unpacked once on every machine, into its folder for temporary files; there a job's paths lead below that folder. Correctors
and wind files keep their hashes, the turbine has one of its own: a worker runs what was sent, or nothing.
"""

from __future__ import annotations

import hashlib
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from fatigue_runner.campaign.block import Job
from fatigue_runner.campaign.cases import Case
from fatigue_runner.campaign.resolve import Named
from fatigue_runner.inputs.files import to_yaml
from fatigue_runner.wind.fields.on_rotor import files_of


@dataclass(frozen=True)
class Parcel:
    """files: contents by their paths below the folder of the parcel; places: such paths by those that jobs name."""

    files: dict[str, bytes]
    places: dict[str, str]

    @cached_property
    def name(self) -> str:
        """Of its folder."""
        digest = hashlib.sha256()
        for path, content in sorted(self.files.items()):
            digest.update(f"{path} {len(content)}\n".encode() + content)
        return f"fatigue-runner-{digest.hexdigest()[:16]}"


def pack(named: Named) -> Parcel:
    """Everything that workers read: turbine file with what it is based on, its tables and airfoils, correctors, wind files."""
    files: dict[str, bytes] = {}
    places: dict[str, str] = {}
    if Path(named.turbine_source).suffix:
        places[named.turbine_source] = _pack_turbine(named.turbine_source, files)
    for integration in named.integrations:
        if integration.file:
            place = f"correctors/{integration.digest[:16]}/{Path(integration.file).name}"
            files[place] = Path(integration.file).read_bytes()
            places[integration.file] = place
    for wind in named.realisations:
        for path in _files_of(wind.parameters, wind.contents):
            # below the folder they lie as they do here: a description names what is beside it
            beside = files_of(path)
            for file in beside:
                files[f"winds{file.absolute().as_posix()}"] = file.read_bytes()
            places[str(path)] = f"winds{path.absolute().as_posix()}"
    return Parcel(files, places)


def _pack_turbine(source: str, files: dict[str, bytes]) -> str:
    from fatigue_runner.turbine.file import read_turbine_file

    data = read_turbine_file(source)
    aero = dict(data.get("aerodynamics", {}))
    for key in ("tables", "airfoils"):
        if isinstance(aero.get(key), str):
            file = Path(aero[key])
            aero[key] = f"{key}{file.suffix}"
            files[f"turbine/{key}{file.suffix}"] = file.read_bytes()
    place = f"turbine/{Path(source).name}"
    files[place] = to_yaml(f"{source}, with what it is based on.", {**data, "aerodynamics": aero}).encode()
    return place


def _files_of(parameters: tuple[tuple[str, Any], ...], contents: tuple[tuple[str, str], ...]) -> list[Path]:
    given = dict(parameters)
    return [Path(given[name]) for name, _ in contents]


def unpack(name: str, files: dict[str, bytes]) -> None:
    """Write the files of a parcel into its folder on this machine, unless another worker has; the folder is there when it is whole."""
    if folder_of(name).is_dir():
        return
    own = Path(tempfile.mkdtemp(prefix=f"{name}."))
    for place, content in files.items():
        (own / place).parent.mkdir(parents=True, exist_ok=True)
        (own / place).write_bytes(content)
    try:
        own.rename(folder_of(name))
    except OSError:  # another worker was first
        shutil.rmtree(own, ignore_errors=True)
        if not folder_of(name).is_dir():
            raise


def folder_of(name: str) -> Path:
    """Where a parcel lies on this machine."""
    return Path(tempfile.gettempdir()) / name


def throw_away(name: str) -> None:
    """The parcel is not needed on this machine any more."""
    shutil.rmtree(folder_of(name), ignore_errors=True)


def here(job: Job, name: str, places: dict[str, str]) -> Job:
    """The job with the paths that its files have on this machine."""
    root = folder_of(name)

    def own(path: str) -> str:
        return str(root / places[path]) if path in places else path

    return replace(
        job,
        setup=replace(job.setup, turbine=own(job.setup.turbine)),
        cases=[_of_case(case, own) for case in job.cases],
        references=[_of_case(case, own) for case in job.references],
    )


def _of_case(case: Case, own: Callable[[str], str]) -> Case:
    named = {name for name, _ in case.wind.contents}
    parameters = tuple((name, own(value) if name in named else value) for name, value in case.wind.parameters)
    integration = replace(case.integration, file=own(case.integration.file))
    return replace(case, wind=replace(case.wind, parameters=parameters), integration=integration)
