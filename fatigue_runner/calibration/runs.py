"""Our side of a calibration: the cases of a run folder, from its table and its logs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.channels import channel_name
from fatigue_runner.errors import InputError
from fatigue_runner.naming import file_id
from fatigue_runner.results.cells import Row, integrator, number, text, truth
from fatigue_runner.results.run_file import read_run_file
from fatigue_runner.results.table import read_results

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Ran:
    """A finished case: mean wind [m/s], counted time (n,) [s], loads {channel: (n,) [SI]}."""

    case: str
    wind: float
    time: Array
    loads: dict[str, Array]

    @property
    def seconds(self) -> float:
        return float(self.time[-1] - self.time[0])


@dataclass(frozen=True)
class RunFolder:
    """A run folder: its finished rows without those of the reference, what run.json says of turbine, campaign and integrators."""

    folder: Path
    rows: Sequence[Row]
    turbine: str
    turbine_hash: str
    discard: float
    exponents: tuple[float, ...]

    @classmethod
    def read(cls, folder: Path) -> RunFolder:
        """Raises InputError for a folder without results or without run.json."""
        rows = [row for row in read_results(folder) if text(row, "status") == "done"]
        try:
            stored = read_run_file(folder)
            facts, campaign = stored["facts"], stored["campaign"]
            found = str(facts["turbine"]), str(facts["turbine_hash"]), float(campaign["discard"])
            exponents = tuple(float(m) for m in campaign["fatigue"]["wohler_exponents"])
        except (OSError, ValueError, KeyError, TypeError):
            raise InputError(f"{folder} has no run.json of this program; give the folder of a run") from None
        own = [row for row in rows if not truth(row, "is_reference")]
        return cls(folder, own, *found, exponents)

    def labels(self) -> list[str]:
        """The integrators of the run."""
        return list(dict.fromkeys(integrator(row) for row in self.rows))

    def chosen(self, method: str) -> list[Row]:
        """Rows of one integrator; the only one where none is named. Raises InputError where that is not clear."""
        labels = self.labels()
        if method and method not in labels:
            raise InputError(f"{self.folder} has no integrator {method!r}; there are {', '.join(labels)}")
        if not method and len(labels) != 1:
            raise InputError(
                f"{self.folder} has {len(labels)} integrators ({', '.join(labels) or 'none finished'}); name one of them as `method`"
            )
        return [row for row in self.rows if integrator(row) == (method or labels[0])]

    def case(self, rows: Sequence[Row], begins: str) -> Row:
        """The one row whose case id is, or begins with, this. Raises InputError."""
        ids = [text(row, "case_id") for row in rows]
        # a wind file's name is spelled a little differently in a case's id
        begins = begins if any(name.startswith(begins) for name in ids) else file_id(begins)
        found = [row for row, name in zip(rows, ids, strict=True) if name == begins] or [
            row for row, name in zip(rows, ids, strict=True) if name.startswith(begins)
        ]
        if len(found) != 1:
            what = "no finished case" if not found else f"{len(found)} cases"
            raise InputError(
                f"{self.folder} has {what} that begins with {begins!r}; there are {', '.join(ids[:8])}"
            )
        return found[0]

    def load(self, row: Row, channels: Sequence[str], start: float) -> Ran:
        """What was logged of a case from `start` [s] on. Raises InputError where a channel is not in its log."""
        from fatigue_runner.logbook import read_log

        case = text(row, "case_id")
        log = read_log(self.folder / "logs" / f"{case}.mcap")
        kept = log.time >= start - 1e-9
        loads = {}
        for channel in channels:
            name = channel_name(channel)
            if name not in log.loads:
                raise InputError(f"{case}: its log has no {name}; run the campaign with the topic `loads`")
            loads[name] = np.ascontiguousarray(log.loads[name][kept], dtype=float)
        wind = number(row, "wind_speed")
        if wind is None or kept.sum() < 100:
            raise InputError(f"{case}: too little is left of it from {start:g} s on")
        return Ran(case, wind, log.time[kept].astype(float), loads)
