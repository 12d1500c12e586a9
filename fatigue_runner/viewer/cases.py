"""What is to be seen: the logs that were asked for, the reference beside them, and how each is named and coloured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import radians
from pathlib import Path
from typing import Any

import numpy as np

from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.inputs.source import parse_mapping
from fatigue_runner.layout import FAMILIES, family_of
from fatigue_runner.logbook import Log, LogError, read_log, read_metadata
from fatigue_runner.naming import integrator_label
from fatigue_runner.on_demand import present
from fatigue_runner.results.columns import WIND
from fatigue_runner.results.records import whole_records
from fatigue_runner.turbine.file import read_turbine_file
from fatigue_runner.viewer import colours
from fatigue_runner.viewer.scene import Geometry, geometry
from fatigue_runner.viewer.shapes import BladeSkin, blade_skin

MAX_CASES = 4  # side by side; more turbines are too small to see
_WIND_KEYS = ("wind", *WIND)  # of a log: the name of the wind, and what the results table says of it


@dataclass
class Viewed:
    """One log on the stage. key: its name in entity paths; label: as a person reads it; offset [m] sideways."""

    log: Log
    key: str
    label: str
    colour: tuple[int, int, int]
    geometry: Geometry
    skin: BladeSkin
    is_reference: bool = False
    offset: float = 0.0

    @property
    def is_guarded(self) -> bool:
        """Whether steps were tested against a threshold (the hybrid integrators)."""
        return bool(np.isfinite(self.log.threshold).any())


def find_logs(paths: Sequence[Path], case: str | None = None) -> list[Path]:
    """The logs to show: files as they are; of a run folder the logs of one wind, every integrator of it.

    case: id of a case in the folder, shown with the other integrators of its wind; default: the first wind that
    has a hybrid, else the first. Raises InputError where there is nothing to show.
    """
    found: list[Path] = []
    for path in paths:
        if path.is_dir():
            found += _of_folder(path, case)
        elif present(path).exists():
            found.append(path)
        else:
            raise InputError(f"{path} does not exist; give a log (.mcap) or the folder that `run` wrote")
    return list(dict.fromkeys(found))[:MAX_CASES]


def _of_folder(folder: Path, case: str | None) -> list[Path]:
    place = folder / "logs" if (folder / "logs").is_dir() else folder
    logs = {path.name.removesuffix(".mcap"): path for path in sorted(place.glob("*.mcap"))}
    # thousands of records are not read where the logs themselves tell what there is
    rows = _recorded(folder) if not logs or (case is not None and case not in logs) else {}
    if case is None and not logs and rows:
        case = next(iter(rows))
    if case is not None and case not in logs and case in rows:
        # the run kept no log of it: it is made again, and that of its reference
        beside = [
            name
            for name, row in rows.items()
            if row["is_reference"] and _wind_of(row) == _wind_of(rows[case])
        ]
        logs |= {name: present(place / f"{name}.mcap") for name in dict.fromkeys([case, *beside])}
    if not logs:
        raise InputError(
            f"there is no log (.mcap) in {place}; `run` writes them unless `log: enabled: false`"
        )
    if case is not None and case not in logs:
        raise InputError(f"there is no log of case {case!r} in {place}{did_you_mean(case, logs)}")
    runs = {name: _run_of(path) for name, path in logs.items()}
    chosen = case or next(iter(logs))
    same = [name for name in logs if _wind_of(runs[name]) == _wind_of(runs[chosen]) and name != chosen]
    # the reference first, so that it is among the few that are shown
    same.sort(key=lambda name: runs[name].get("is_reference") != "True")
    return [logs[name] for name in [chosen, *same]]


def _recorded(folder: Path) -> dict[str, Mapping[str, Any]]:
    """Rows of the cases of a run folder by their ids; empty for another folder."""
    try:
        found = whole_records((folder / "cases.jsonl").read_bytes())[0]
    except OSError:
        return {}
    return {
        record["row"]["case_id"]: record["row"] for record in found if record["row"]["status"] != "failed"
    }


def _run_of(path: Path) -> dict[str, str]:
    try:
        return read_metadata(path).get("run", {})
    except LogError:
        return {}  # shown to the user when it is this log that is to be read


def _wind_of(run: Mapping[str, Any]) -> tuple[Any, ...]:
    return tuple(run.get(key) for key in _WIND_KEYS)


def read_cases(paths: Sequence[Path], turbine: str | None = None) -> list[Viewed]:
    """Read logs for the stage, the reference first. turbine: name or file, default as the logs say.

    A damaged log is shown up to where it is good. Raises InputError where a file is no log of a turbine, has no states,
    or was made with another turbine than the one that would be drawn.
    """
    return as_viewed([(path, _readable(path)) for path in paths], turbine)


def as_viewed(logs: Sequence[tuple[Path, Log]], turbine: str | None = None) -> list[Viewed]:
    """Places, names and colours for logs that were read from these files, the reference first."""
    logs = list(logs)
    logs.sort(key=lambda item: not _is_reference(item[1]))
    viewed: list[Viewed] = []
    others = 0
    for place, (path, log) in enumerate(logs):
        label = label_of(path, log)
        mapping = read_turbine_file(turbine) if turbine else turbine_of(log)
        shape = geometry(mapping, radians(_number(log.run.get("pitch_deg"))))
        check_turbine(path, log, shape)
        reference = _is_reference(log)
        colour = colours.REFERENCE if reference else colours.INTEGRATORS[others % len(colours.INTEGRATORS)]
        others += not reference
        viewed.append(
            Viewed(
                log=log,
                key=f"{place + 1}_{_entity_name(label)}",
                label=label,
                colour=colour,
                geometry=shape,
                skin=blade_skin(mapping, shape),
                is_reference=reference,
                offset=-place * 2.4 * shape.radius,  # to the right of who looks downwind
            )
        )
    return viewed


def _readable(path: Path) -> Log:
    log = read_log(path, partial=True)
    if not len(log.state):
        raise InputError(
            f"{path} holds no states to show; keep topic `state` in the campaign's `log: topics`"
        )
    layout = FAMILIES[family_of([c.name for c in log.states]) or "t2b1i1cg"]
    if not np.isfinite(log.state[:, : layout.rotor + 1]).any():
        raise InputError(
            f"{path} holds no positions to show, only {', '.join(log.loads) or 'other channels'}"
        )
    return log


def turbine_of(log: Log) -> dict[str, Any]:
    """The turbine that a log was made with: the one attached to it, else the one that its campaign or its `run` names."""
    attached = _mapping(log, "turbine.yaml")
    if "blade" in attached and "tower" in attached:
        return attached
    source = _mapping(log, "campaign.yaml").get("turbine")
    return read_turbine_file(str(source or log.run.get("turbine") or "nrel5mw"))


def _mapping(log: Log, name: str) -> dict[str, Any]:
    """An attached YAML file; empty where there is none."""
    try:
        return dict(
            parse_mapping(log.attachments.get(name, b"").decode(), Path(name), "log's attachment", "").data
        )
    except (InputError, UnicodeDecodeError):
        return {}


def check_turbine(path: Path, log: Log, shape: Geometry) -> None:
    """Refuse a turbine whose blades would not bend as the log says: its tip deflections are the log's to rounding."""
    names = [f"blade{i}_tip_{way}" for i in (1, 2, 3) for way in ("out_of_plane", "in_plane")]
    if not all(name in log.loads for name in names):
        return
    logged = np.stack([log.loads[name] for name in names], axis=1)
    drawn = shape.tip_channels(log.state, log.pitch if len(log.pitch) else None).reshape(len(logged), 6)
    known = np.isfinite(logged) & np.isfinite(drawn)
    if known.any() and np.abs(np.where(known, logged - drawn, 0.0)).max() > 1e-3:
        raise InputError(
            f"{path} was made with another turbine than {shape.name}: its blade tips are not where the log says; "
            "give the right one with --turbine"
        )


def label_of(path: Path, log: Log) -> str:
    """As a person calls the integrator of a log; the file's name where the log does not say."""
    method, step = log.run.get("method"), _number(log.run.get("step"))
    if not method:
        return path.name.removesuffix(".part").removesuffix(".mcap")
    label = integrator_label(method, step or None, log.run.get("corrector", ""), log.run.get("mode", ""))
    return f"{label} (reference)" if _is_reference(log) else label


def _is_reference(log: Log) -> bool:
    return log.run.get("is_reference") == "True"


def _number(text: str | None) -> float:
    try:
        return float(text or 0.0)
    except ValueError:
        return 0.0


def _entity_name(label: str) -> str:
    return "".join(c if c.isalnum() else "_" for c in label).strip("_")
