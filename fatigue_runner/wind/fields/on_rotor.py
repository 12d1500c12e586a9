"""Any wind file on a rotor: read, checked, projected, and kept for whoever asks again."""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.rotor import Rotor
from fatigue_runner.wind.fields.bladed import summary_of
from fatigue_runner.wind.fields.formats import HAWC, read_wind
from fatigue_runner.wind.fields.hawc import DESCRIPTIONS, MannBox, described_file
from fatigue_runner.wind.fields.projection import FieldHarmonics, harmonics_of
from fatigue_runner.wind.fields.uniform import UniformWind, harmonics_of_uniform
from fatigue_runner.wind.mean_shear import radial_rule
from fatigue_runner.wind.profiles import Profile

BOX_KEYS = ("points", "spacing", "reference_height", "scale", "sigma", "upstream")


@dataclass(frozen=True, eq=False)
class FileWind:
    """A file's wind on a rotor. uniform: it is a uniform wind file's, whose last line holds on for ever."""

    harmonics: FieldHarmonics
    uniform: bool

    @property
    def length(self) -> float:
        """Time [s] for which the file says something."""
        return math.inf if self.uniform else self.harmonics.end


def on_rotor(
    path: str,
    rotor: Rotor,
    harmonics: int,
    mean_speed: float | None,
    profile: Profile | None,
    box: tuple[tuple[str, Any], ...],
) -> FileWind:
    """The wind of a file, projected on the rotor: read once, as long as no file of it changes.

    mean_speed, profile and box (`BOX_KEYS`) as in `FullFieldWind`. Raises InputError for what the readers and the projection refuse.
    """
    try:
        stamps = _stamps(Path(path))
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read ({error.strerror}); check the path of the wind file"
        ) from None
    return _on_rotor(path, stamps, rotor, harmonics, mean_speed, profile, box)


def content(path: Path) -> str:
    """Digest of all files that a wind file's wind depends on. Raises OSError where one cannot be read."""
    return _content(_stamps(path))


def _stamps(path: Path) -> tuple[tuple[str, int, int], ...]:
    """The files that a wind depends on, with time and size: as long as these are the same, nothing is read again."""
    return tuple((str(p), p.stat().st_mtime_ns, p.stat().st_size) for p in files_of(path))


@lru_cache(maxsize=64)
def _content(stamps: tuple[tuple[str, int, int], ...]) -> str:
    sha = hashlib.sha256()
    for file, *_ in stamps:
        sha.update(Path(file).read_bytes())
    return sha.hexdigest()


def files_of(path: Path) -> list[Path]:
    """The file and what it needs beside it: the summary of a Bladed field, the binary that a description names."""
    if path.suffix.lower() in DESCRIPTIONS and path.is_file():
        return [path, described_file(path)]
    beside = summary_of(path) if path.suffix.lower() == ".wnd" else None
    return [path] if beside is None else [path, beside]


@lru_cache(maxsize=32)
def _on_rotor(
    path: str,
    _stamps: tuple[Any, ...],
    rotor: Rotor,
    harmonics: int,
    mean_speed: float | None,
    profile: Profile | None,
    box: tuple[tuple[str, Any], ...],
) -> FileWind:
    mann = _mann_box(Path(path), rotor, mean_speed, profile, dict(box))
    found = read_wind(
        Path(path), hub_height=rotor.hub_height, rotor_diameter=2 * rotor.radius, box=mann, mean_speed=mean_speed
    )  # fmt: skip
    radii, shares, _ = radial_rule(rotor)
    at = rotor.hub_height, rotor.radius, radii, shares, harmonics
    if isinstance(found, UniformWind):
        until = float(found.time[-1]) + 2 * found.time_step
        return FileWind(harmonics_of_uniform(found, *at, duration=until, x=rotor.apex), True)
    return FileWind(
        harmonics_of(found, *at, x=rotor.apex, tilt=rotor.tilt, yaw=rotor.yaw, upflow=rotor.upflow), False
    )


def _mann_box(
    path: Path, rotor: Rotor, mean_speed: float | None, profile: Profile | None, box: dict[str, Any]
) -> MannBox | None:
    """What is said about a Mann box; None for files that say it themselves."""
    if path.suffix.lower() not in HAWC:
        if box or profile is not None:
            what = "the sizes of a box" if box else "a shear"
            raise InputError(
                f"{path}: {what} can be given for a Mann box only; this file has its own, leave it out"
            )
        return None
    for key in box:
        if key not in BOX_KEYS:
            raise InputError(f"{path}: unknown key {key!r} of a Mann box{did_you_mean(key, BOX_KEYS)}")
    if mean_speed is None:
        raise InputError(f"{path}: a Mann box does not say its mean wind speed; give `mean_speed` in m/s")
    said = {key: value for key, value in box.items() if value is not None}
    height = said.pop("reference_height", rotor.hub_height)
    return MannBox(mean_speed, height, profile=profile, **said)
