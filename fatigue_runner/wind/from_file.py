"""Wind from a comma-separated file: one row per sample, with a header, at a uniform time step."""

from __future__ import annotations

import csv
import hashlib
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator

from fatigue_runner.channels import WIND_NAMES
from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.inputs.source import Place
from fatigue_runner.inputs.sweep import as_list, check_not_empty
from fatigue_runner.naming import file_id
from fatigue_runner.wind.checks import decimal
from fatigue_runner.wind.fields.formats import SUFFIXES
from fatigue_runner.wind.section import Realisation, Site, WindSection
from fatigue_runner.wind.series import SeriesWind
from fatigue_runner.wind.source import SOURCES

COLUMNS = ("time", *WIND_NAMES)
SEPARATORS = {";": "semicolons", "\t": "tabs"}
COARSEST = 0.05  # rounding of times over their step beyond which any series could be uniform
AS_FIELD = "give it as `type: full-field`"


def read_wind_file(path: str | Path) -> SeriesWind:
    """Cubic series through the samples of a csv file: time [s], wind_speed [m/s] and the two shears [-].

    The header names the columns, in any order: `time,wind_speed,vertical_shear,horizontal_shear`. Times start
    at 0 and rise by a constant step. Raises InputError with file and line for anything else.
    """
    path = Path(path)
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:  # spreadsheets write a byte-order mark
            reader = csv.reader(file)
            rows = [(reader.line_num, row) for row in reader if any(map(str.strip, row))]
    except FileNotFoundError:
        raise InputError(f"{path}: no such wind file; check the path") from None
    except UnicodeDecodeError:
        raise InputError(
            f"{path}: this is binary or no UTF-8, but a csv file is text; if it is a wind field (.bts, .wnd, .hh, a Mann box), {AS_FIELD}"
        ) from None
    except (OSError, csv.Error) as error:
        raise InputError(f"{path}: cannot be read as a csv file in UTF-8 ({error})") from None
    if not rows:
        raise InputError(f"{path}:1: the file is empty; its first line must be {','.join(COLUMNS)}")
    order = _header(path, *rows[0])
    samples = np.array([_sample(path, line, row, order) for line, row in rows[1:]])
    if len(samples) < 2:
        raise InputError(f"{path}: {len(samples)} samples after the header; a series needs at least two")
    digits = max(_decimals(row[order[0]]) for _, row in rows[1:])
    time_step = _time_step(path, [line for line, _ in rows[1:]], samples[:, 0], 0.5 * 10.0**-digits)
    try:
        return SeriesWind(time_step, samples[:, 1:], origin=path.stem)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _header(path: Path, line: int, row: list[str]) -> list[int]:
    """Where each of COLUMNS stands in a row."""
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
    missing = [name for name in COLUMNS if name not in names]
    if missing:
        raise InputError(
            f"{path}:{line}: column {missing[0]!r} is missing; the header must be {','.join(COLUMNS)}"
        )
    return [names.index(name) for name in COLUMNS]


def _sample(path: Path, line: int, row: list[str], order: list[int]) -> list[float]:
    """The numbers of one row in the order of COLUMNS."""
    if len(row) != len(COLUMNS):
        raise InputError(
            f"{path}:{line}: {len(row)} fields, the header has {len(COLUMNS)}; separate them by commas"
        )
    sample = []
    for name, position in zip(COLUMNS, order, strict=True):
        value = decimal(row[position])
        if value is None:
            raise InputError(f"{path}:{line}: {name} is {row[position].strip()!r}; give a number")
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


def _decimals(text: str) -> int:
    """Digits behind the point of a number as it is written; 12, as good as exact, where it has an exponent."""
    return 12 if "e" in text.lower() else len(text.strip().partition(".")[2])


def _time_step(path: Path, lines: list[int], time: np.ndarray, rounding: float) -> float:
    """The uniform step [s] of a column of times that starts at 0 and is written to within `rounding` [s].

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
    slack = rounding * (1 + 1e-6)  # 0.00625 lies just half a digit from 0.0063
    low, high = ((time[1:] - slack) / count).max(), ((time[1:] + slack) / count).min()
    if low <= high and rounding <= COARSEST * usual:
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
                    f"{site.place.where('files', index)}: wind file {name!r} cannot be read ({error.strerror}); "
                    "paths start at the campaign file"
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
