"""Wind from a comma-separated file: one row per sample, with a header, at a uniform time step."""

from __future__ import annotations

import csv
import hashlib
import io
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator

from fatigue_runner.channels import WIND_NAMES
from fatigue_runner.encoded import decoded
from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.inputs.source import Place
from fatigue_runner.inputs.sweep import as_list, check_not_empty
from fatigue_runner.naming import file_id
from fatigue_runner.values import decimal
from fatigue_runner.wind.fields.files import read_bytes
from fatigue_runner.wind.fields.formats import SUFFIXES
from fatigue_runner.wind.section import Realisation, Site, WindSection
from fatigue_runner.wind.series import SeriesWind
from fatigue_runner.wind.source import SOURCES

COLUMNS = ("time", *WIND_NAMES)
NEEDED = ("time", "wind_speed")
SEPARATORS = {";": "semicolons", "\t": "tabs"}
COARSEST = 0.2  # rounding of times over their step beyond which a series with a gap could be uniform
AS_FIELD = "give it as `type: full-field`"


def read_wind_file(path: str | Path) -> SeriesWind:
    """Cubic series through the samples of a csv file: time [s], wind_speed [m/s] and the two shears [-].

    The header names the columns, in any order: `time,wind_speed,vertical_shear,horizontal_shear`; a shear without a column is 0. Times
    start at 0 and rise by a constant step. Raises InputError with file and line for anything else.
    """
    path = Path(path)
    try:
        reader = csv.reader(io.StringIO(_text(path), newline=""))
        rows = [(reader.line_num, row) for row in reader if any(map(str.strip, row))]
    except csv.Error as error:
        raise InputError(f"{path}: cannot be read as a csv file ({error})") from None
    if not rows:
        raise InputError(f"{path}:1: the file is empty; its first line must be {','.join(COLUMNS)}")
    order = _header(path, *rows[0])
    width = len(rows[0][1])
    samples = np.array([_sample(path, line, row, order, width) for line, row in rows[1:]])
    if len(samples) < 2:
        raise InputError(f"{path}: {len(samples)} samples after the header; a series needs at least two")
    time_step = _time_step(
        path, [line for line, _ in rows[1:]], samples[:, 0], _rounding(rows[1:], order["time"])
    )
    try:
        return SeriesWind(time_step, samples[:, 1:], origin=path.stem)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _text(path: Path) -> str:
    data = read_bytes(path)
    try:
        return decoded(data, path, "a csv file")
    except InputError as error:
        if b"\0" not in data[:4096]:
            raise
        raise InputError(
            f"{path}: this is binary, but a csv file is text; if it is a wind field (.bts, .wnd, .hh, a Mann box), {AS_FIELD}"
        ) from error


def _header(path: Path, line: int, row: list[str]) -> dict[str, int]:
    """Where each of COLUMNS that is there stands in a row."""
    names = [field.strip() for field in row]
    for sign, word in SEPARATORS.items():
        if len(names) == 1 and sign in names[0]:
            raise InputError(
                f"{path}:{line}: the columns are separated by {word}; separate them by commas and write decimal points"
            )
    for name in names:
        if name not in COLUMNS:
            raise InputError(
                f"{path}:{line}: unknown column {name!r}{did_you_mean(name, COLUMNS)} "
                f"(the header must be {','.join(COLUMNS)})"
            )
        if names.count(name) > 1:
            raise InputError(f"{path}:{line}: column {name!r} appears twice; keep one")
    missing = [name for name in NEEDED if name not in names]
    if missing:
        raise InputError(
            f"{path}:{line}: column {missing[0]!r} is missing; the header must be {','.join(COLUMNS)}, of which the shears may be left out"
        )
    return {name: names.index(name) for name in COLUMNS if name in names}


def _sample(path: Path, line: int, row: list[str], order: dict[str, int], width: int) -> list[float]:
    """The numbers of one row in the order of COLUMNS, 0 for a shear without a column."""
    if len(row) != width:
        comma = "; write numbers with a decimal point" if len(row) > width else ""
        raise InputError(
            f"{path}:{line}: {len(row)} fields, the header has {width}; separate them by commas{comma}"
        )
    sample = []
    for name in COLUMNS:
        value = decimal(row[order[name]]) if name in order else 0.0
        if value is None:
            text = row[order[name]].strip()
            way_out = "write it with a decimal point" if "," in text else "give a number"
            raise InputError(f"{path}:{line}: {name} is {text!r}; {way_out}")
        if not math.isfinite(value):
            raise InputError(f"{path}:{line}: {name} is {value}; fill or cut the gap")
        if name == "wind_speed" and value <= 0:
            raise InputError(
                f"{path}:{line}: wind_speed is {value:g} m/s; the aerodynamics need positive wind speeds"
            )
        if name.endswith("shear") and abs(value) > 1:
            raise InputError(
                f"{path}:{line}: {name} is {value:g}; a linear shear beyond 1 blows backwards at the rotor's edge (an angle in degrees?)"
            )
        sample.append(value)
    return sample


def _rounding(rows: Sequence[tuple[int, list[str]]], place: int) -> np.ndarray:
    """How far (n,) [s] each time of a column may be from what was meant: half a unit of the last digit that any of them has, or of the
    last bit, where all of them are single-precision numbers."""
    written = [row[place].strip().lower() for _, row in rows]
    time = np.array([float(text) for text in written])
    digits = max(12 if "e" in text else len(text.partition(".")[2]) for text in written)
    rounding = np.full(len(time), 0.5 * 10.0**-digits)
    if np.array_equal(time, time.astype(np.float32)):
        rounding = np.maximum(rounding, 0.5 * np.spacing(np.abs(time).astype(np.float32)).astype(float))
    return rounding


def _time_step(path: Path, lines: list[int], time: np.ndarray, rounding: np.ndarray) -> float:
    """The uniform step [s] of a column of times that starts at 0, each written to within its `rounding` [s].

    Where every time can be a multiple of one step, it is the shortest such number: 0.00625 of 0.0063, 0.0125, 0.0188, ...
    """
    if time[0] != 0.0:
        raise InputError(
            f"{path}:{lines[0]}: the first time is {time[0]:g} s; it must be 0, where the run starts"
        )
    steps = np.diff(time)
    for i in np.flatnonzero(steps <= 0)[:1]:
        order = f"time {time[i + 1]:g} s is not after {time[i]:g} s"
        raise InputError(f"{path}:{lines[i + 1]}: {order}; times must rise")
    usual = float(np.median(steps))
    count = np.arange(1, len(time))
    slack = rounding[1:] * (1 + 1e-6)  # 0.00625 lies just half a digit from 0.0063
    low, high = ((time[1:] - slack) / count).max(), ((time[1:] + slack) / count).min()
    if low <= high and rounding.max() <= COARSEST * usual:
        # twelve digits hold any step that was meant
        candidates = (float(f"{(low + high) / 2:.{digits}g}") for digits in range(1, 13))
        return next((step for step in candidates if low <= step <= high), (low + high) / 2)
    for i in np.flatnonzero(np.abs(steps - usual) > 1e-3 * usual)[:1]:
        change = f"the time step changes here to {steps[i]:g} s (elsewhere {usual:g} s)"
        raise InputError(f"{path}:{lines[i + 1]}: {change}; resample the series at a uniform step")
    return float(f"{time[-1] / (len(time) - 1):.12g}")


SOURCES["file"] = read_wind_file


class FileSection(WindSection):
    """One wind per file.

    files   one path or a list, relative to the campaign file; the columns: `read_wind_file`
    """

    kind = "file"

    files: Annotated[list[str], BeforeValidator(check_not_empty), BeforeValidator(as_list)]

    def realisations(self, site: Site) -> Iterator[Realisation]:
        for index, name in enumerate(self.files):
            path = site.place.file(name)
            try:
                digest = hashlib.sha256(path.read_bytes()).hexdigest()
            except OSError as error:
                raise InputError(
                    f"{site.place.where('files', index)}: wind file {name!r} cannot be read ({error.strerror}); looked for "
                    f"{path}, since paths start at the campaign file"
                ) from None
            if path.suffix.lower() in SUFFIXES:
                what = f"{name!r} is a wind field (TurbSim, Bladed, HAWC2, mostly binary), no csv file"
                raise InputError(f"{site.place.where('files', index)}: {what}; {AS_FIELD}")
            yield Realisation(
                file_id(path.stem),
                self.kind,
                (("path", str(path)),),
                ("files", index),
                contents=(("path", digest),),
            )

    def resolved(self, place: Place) -> dict[str, Any]:
        return super().resolved(place) | {"files": [str(place.file(name)) for name in self.files]}
