"""Telling wind files apart."""

from __future__ import annotations

from pathlib import Path

from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.wind.fields.bladed import is_bladed, read_bladed
from fatigue_runner.wind.fields.field import WindField, refuse_mean
from fatigue_runner.wind.fields.files import read_bytes
from fatigue_runner.wind.fields.hawc import MannBox, read_hawc
from fatigue_runner.wind.fields.turbsim import read_turbsim
from fatigue_runner.wind.fields.uniform import UniformWind, read_uniform

TURBSIM, UNIFORM, EITHER = (".bts",), (".hh",), (".wnd",)
HAWC = (".hawc", ".htc", ".bin", ".u", ".turb")
SUFFIXES = (*TURBSIM, *EITHER, *UNIFORM, *HAWC)


def read_wind(
    path: str | Path,
    *,
    hub_height: float,
    rotor_diameter: float,
    box: MannBox | None = None,
    mean_speed: float | None = None,
) -> WindField | UniformWind:
    """The wind of a file in any of the formats, by its ending and, for `.wnd`, by its first bytes.

    `hub_height` and `rotor_diameter` [m] are what uniform wind refers to; `box` is what a Mann box does not say
    itself. Raises InputError for an unknown ending, for a file that has another mean than `mean_speed` [m/s],
    and whatever the format's reader raises.
    """
    wind = _read(Path(path), hub_height, rotor_diameter, box)
    if mean_speed is not None:
        refuse_mean(wind.source, wind.mean_speed, mean_speed)
    return wind


def _read(
    path: Path, hub_height: float, rotor_diameter: float, box: MannBox | None
) -> WindField | UniformWind:
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{path}: unknown wind file format {suffix!r}{did_you_mean(suffix, SUFFIXES)}")
    if box is not None and suffix not in HAWC:
        raise InputError(
            f"{path}: a {suffix} file says its own size and mean wind; leave out those of a Mann box"
        )
    if suffix in TURBSIM:
        return read_turbsim(path)
    if suffix in HAWC:
        if box is None:
            raise InputError(f"{path}: a Mann box needs its mean wind speed and its sizes; give a MannBox")
        return read_hawc(path, box)
    if suffix in EITHER and is_bladed(read_bytes(path)):
        return read_bladed(path)
    return read_uniform(path, hub_height, rotor_diameter)
