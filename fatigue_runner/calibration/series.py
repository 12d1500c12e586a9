"""Another program's output series: CSV, OpenFAST's text output (.out), or NumPy archives (.npz) of names, units and data.

Channels are known by OpenFAST's names or this program's (`channels`); a unit stands with each name in brackets, or in a row of its own;
this program's own names without one are in SI, as `fatigue-runner logs export` writes them.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.channels import LOAD_NAMES, channel_name
from fatigue_runner.errors import InputError

Array = NDArray[np.float64]

# factor to SI by unit, spelled without brackets, spaces and signs of multiplication
UNITS = {
    "nm": 1.0, "n-m": 1.0, "knm": 1e3, "kn-m": 1e3, "mnm": 1e6, "mn-m": 1e6, "n": 1.0, "kn": 1e3, "mn": 1e6, "m": 1.0, "mm": 1e-3,
    "m/s": 1.0, "m/s2": 1.0, "m/s^2": 1.0, "m/s²": 1.0, "w": 1.0, "kw": 1e3, "mw": 1e6, "rad": 1.0, "rad/s": 1.0, "deg": np.pi / 180,
    "rpm": np.pi / 30, "s": 1.0,
}  # fmt: skip
_NAMED = re.compile(r"^(?P<name>[^(\[]+?)\s*(?:[(\[](?P<unit>[^)\]]*)[)\]])?$")
TIME = "time"


@dataclass(frozen=True)
class Series:
    """time (n,) [s] at equal steps from its start; channels {name: (n,) [SI]}, of those whose unit is known; units {name: as written}."""

    path: Path
    time: Array
    channels: dict[str, Array]
    units: dict[str, str]

    def channel(self, name: str) -> Array:
        """Raises InputError for one that is missing, or whose unit is not told."""
        own = channel_name(name)
        if own in self.channels:
            return self.channels[own]
        if own in self.units:
            unit = self.units[own]
            what = f"has the unit {unit!r}, which is not known" if unit else "has no unit"
            raise InputError(f"{self.path}: {name} {what}; write it as {name} (kN-m), in SI or with k or M")
        there = ", ".join(list(self.units)[:20])
        raise InputError(f"{self.path} has no channel {name}; there are {there}")


def read_series(path: Path) -> Series:
    """Raises InputError, with the file and the way out, for one that is no such table."""
    try:
        names, units, data = _of_archive(path) if path.suffix == ".npz" else _of_text(path)
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror})") from None
    except (ValueError, KeyError) as error:
        raise InputError(
            f"{path} is no table of time series ({error}); give a CSV or OpenFAST's .out with a row of names that begins with Time, or "
            "a .npz of names, units, data and Time or dt"
        ) from None
    lower = [name.lower() for name in names]
    time = data[:, lower.index(TIME)]
    steps = np.diff(time)
    if (
        len(time) < 3
        or not np.isfinite(time).all()
        or np.abs(steps - steps.mean()).max() > 0.01 * steps.mean()
    ):
        raise InputError(f"{path}: its times are not at equal steps; resample it")
    told = {channel_name(n): u for n, u in zip(names, units, strict=True) if n.lower() != TIME}
    channels = {}
    for number, name in enumerate(names):
        factor = UNITS.get(re.sub(r"[\s·*.]", "", units[number].lower()).replace("−", "-"))
        if not units[number] and name in LOAD_NAMES:
            factor = 1.0  # this program's own names are in SI
        if factor is not None and lower[number] != TIME:
            channels[channel_name(name)] = data[:, number] * factor
    return Series(path, time, channels, told)


def _of_archive(path: Path) -> tuple[list[str], list[str], Array]:
    with np.load(path, allow_pickle=False) as found:
        names, units = ([str(x).strip(" ()[]") for x in found[key]] for key in ("names", "units"))
        data = np.asarray(found["data"], float)
        if TIME in (name.lower() for name in names):
            return names, units, data
        time = found["Time"] if "Time" in found else np.arange(len(data)) * float(found["dt"])
        return ["Time", *names], ["s", *units], np.column_stack([time, data])


def _of_text(path: Path) -> tuple[list[str], list[str], Array]:
    lines = path.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    start = next(
        (i for i, line in enumerate(lines) if line.strip().strip('"').lower().startswith(TIME)), None
    )
    if start is None:
        raise ValueError("no row begins with Time")
    separator = next((s for s in (";", "\t", ",") if s in lines[start]), None)

    def cells(line: str) -> list[str]:
        return [c.strip().strip('"') for c in (line.split(separator) if separator else line.split())]

    heads = [_NAMED.match(cell) for cell in cells(lines[start]) if cell]
    if not all(heads):
        raise ValueError(f"a name in row {start + 1} cannot be read")
    names = [m["name"] for m in heads if m]
    units = [m["unit"] or "" for m in heads if m]
    first = start + 1
    row = cells(lines[first]) if first < len(lines) else []
    if row and not _number(row[0]):
        units = [cell.strip("()[] ") for cell in row if cell]
        first += 1
    if len(units) != len(names):
        raise ValueError(f"row {start + 2} has {len(units)} units for {len(names)} names")
    values = []
    for number, line in enumerate(lines[first:], start=first + 1):
        if line.strip():
            row = [c for c in cells(line) if c]
            if len(row) != len(names) or not all(_number(c) for c in row):
                raise ValueError(f"row {number} does not hold {len(names)} numbers with decimal points")
            values.append([float(c) for c in row])
    return names, units, np.array(values, float).reshape(-1, len(names))


def _number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
