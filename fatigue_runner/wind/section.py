"""What a campaign file says under `wind`: one section for every type of wind, declared beside its source.

`source` says how to write one. A campaign asks for nothing but `SECTIONS`, `wind_section` and the winds that a section means.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import Field, field_validator
from pydantic_core import PydanticCustomError

from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.inputs.section import Section, known_name, problem
from fatigue_runner.inputs.source import Place
from fatigue_runner.inputs.sweep import Sweep, expand
from fatigue_runner.layout import MOST_HARMONICS
from fatigue_runner.naming import joined, value_id
from fatigue_runner.rotor import Rotor
from fatigue_runner.wind.source import WindSource, make_wind

# type -> its section; filled as the modules of this folder are imported
SECTIONS: dict[str, type[WindSection]] = {}
DEFAULT = "constant"
STEEPEST = 45.0  # degrees off the nacelle's axis: beyond, a rotor in operation is another flow
# the key `harmonics` of a section: how many azimuthal ones a wind has
Harmonics = Annotated[int, Field(ge=0, le=MOST_HARMONICS)]


@dataclass(frozen=True)
class Site:
    """What a section needs to know beside its own keys: the turbine's rotor, the time that every case runs [s], and its own
    place in the file, for errors and for paths."""

    rotor: Rotor
    duration: float
    place: Place


@dataclass(frozen=True)
class Realisation:
    """One wind of a campaign: its name in case ids, and plain values that make it on any worker.

    parameters: of `make_wind`; path: the keys that it came from, below the section; mean_speed [m/s] where it is known before the
    wind is made; contents {parameter: hash} of files: what is in them decides the figures, not where they lie; tower: the diameters
    of the tower in the blades' way, none where it does not count; angles: yaw misalignment and upflow [rad].
    """

    id: str
    kind: str
    parameters: tuple[tuple[str, Any], ...]
    path: tuple[str | int, ...] = ()
    mean_speed: float | None = None
    contents: tuple[tuple[str, str], ...] = ()
    tower: tuple[tuple[float, float], ...] = ()
    angles: tuple[float, float] = (0.0, 0.0)

    def build(self, rotor: Rotor | None = None) -> WindSource:
        """The wind source as it blows on this rotor, or on none yet; raises InputError for parameters that it refuses, and for a file
        that is not the one any more which the campaign was made of."""
        wind = make_wind(self.kind, **dict(self.parameters))
        if self.tower:
            wind = make_wind("tower-influence", wind=wind)
        if any(self.angles):
            yaw, upflow = self.angles
            wind = make_wind("misaligned", wind=wind, yaw_misalignment=yaw, upflow=upflow)
        if rotor is None:
            return wind
        wind = wind.on(rotor)
        self._refuse_another_file(wind)
        return wind

    def _refuse_another_file(self, wind: WindSource) -> None:
        if not self.contents:
            return
        from fatigue_runner.wind.fields.on_rotor import content

        _ = (
            wind.channels
        )  # reads it, where that has not been done: what is checked afterwards is what was read
        for name, digest in self.contents:
            path = dict(self.parameters)[name]
            try:
                same = content(Path(path)) == digest
            except OSError:
                same = False
            if not same:
                raise InputError(
                    f"{path}: the wind file was changed or removed while the campaign ran; run it again"
                )

    @property
    def file(self) -> str | None:
        """Name of the file that it is read from; None for a wind from none."""
        parameters = dict(self.parameters)
        return next((Path(parameters[name]).name for name, _ in self.contents), None)

    @property
    def identity(self) -> list[Any]:
        """What decides the wind, as plain values to be hashed."""
        given = [list(pair) for pair in (dict(self.parameters) | dict(self.contents)).items()]
        tower = [list(self.tower)] if self.tower else []
        return [self.kind, given, *tower, *([list(self.angles)] if any(self.angles) else [])]


class WindSection(Section):
    """The base of all wind sections; `kind` is what the file's `type` says.

    tower_influence    whether the tower takes from the wind of the blades that pass it (default false)
    yaw_misalignment   angle [deg] by which the wind blows past the nacelle's axis, clockwise seen from above; a sweep (default 0)
    upflow             angle [deg] by which it blows upwards; a sweep (default 0)
    """

    kind: ClassVar[str]

    type: str = DEFAULT
    tower_influence: bool = False
    yaw_misalignment: Sweep = Field(default=[0.0])
    upflow: Sweep = Field(default=[0.0])

    @field_validator("yaw_misalignment", "upflow")
    @classmethod
    def _within_reach(cls, pieces: Sweep) -> Sweep:
        for angle, _ in expand(pieces):
            if abs(angle) > STEEPEST:
                raise problem(
                    f"holds {angle:g} degrees; the model holds up to {STEEPEST:g} off the nacelle's axis"
                )
        return pieces

    @classmethod
    def __pydantic_init_subclass__(cls, **options: Any) -> None:
        super().__pydantic_init_subclass__(**options)
        if "kind" in cls.__dict__:
            SECTIONS[cls.kind] = cls

    def realisations(self, site: Site) -> Iterable[Realisation]:
        """Every wind that the section means, in a stated order. Raises InputError with the place, `site.place.where(key)`."""
        raise NotImplementedError

    def winds(self, site: Site) -> Iterable[Realisation]:
        """The realisations from every direction, with the turbine's tower in the blades' way where the section says so."""
        if self.tower_influence and not site.rotor.tower:
            raise InputError(
                f"{site.place.where('tower_influence')}: the turbine's file has no tower diameters; add `diameters` to its `tower`"
            )
        for found in self.realisations(site):
            if self.tower_influence:
                found = replace(found, id=f"{found.id}_tower", tower=site.rotor.tower)
            for yaw, _ in expand(self.yaw_misalignment):
                for up, _ in expand(self.upflow):
                    words = (f"{word}{value_id(x)}" for word, x in (("yaw", yaw), ("up", up)) if x)
                    yield replace(
                        found, id=joined(found.id, *words), angles=(math.radians(yaw), math.radians(up))
                    )

    def resolved(self, place: Place) -> dict[str, Any]:
        """The section as it can be read again from anywhere: as it was given, paths made absolute."""
        return {"type": self.kind, **self.model_dump(exclude_unset=True, exclude_none=True)}

    @classmethod
    def unknown(cls, key: str) -> PydanticCustomError:
        if any(key in section.model_fields for section in SECTIONS.values()):
            return problem(
                f"means nothing for wind of type {cls.kind!r}; remove it or change `type`", key=key
            )
        near = did_you_mean(key, cls.model_fields)
        if not near.startswith("; did"):
            near = did_you_mean(
                key, dict.fromkeys(name for s in SECTIONS.values() for name in s.model_fields)
            )
        return problem(near, key=key, unknown=True)

    @classmethod
    def check_complete(cls, data: dict[str, Any]) -> None:
        for name, field in cls.model_fields.items():
            if field.is_required() and name not in data:
                raise problem(f"needs the key {name!r}")


def wind_section(value: Any) -> WindSection:
    """The section of a campaign file's `wind`, by its `type`; for pydantic's validators."""
    if isinstance(value, WindSection):
        return value
    kind = value.get("type", DEFAULT) if isinstance(value, dict) else DEFAULT
    return SECTIONS[known_name(kind, SECTIONS, key="type")].model_validate(value)
