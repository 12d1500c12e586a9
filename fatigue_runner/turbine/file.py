"""The turbine file: its keys, their types and bounds, and what is refused. `data/nrel5mw.yaml` has every key with its unit.

A file may say `base:`, a shipped turbine's name or a file beside it, and state only what differs: mappings are merged key by key,
lists are replaced. What is checked is the whole; what is wrong is told with the file and line that say it.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, PlainValidator, SerializeAsAny, field_validator, model_validator

from fatigue_runner import shipped
from fatigue_runner.control.section import ControlSection, control_section
from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.inputs.section import Section, known_name, problem, validated
from fatigue_runner.inputs.source import Source, read_mapping
from fatigue_runner.layout import FAMILIES
from fatigue_runner.turbine import beam
from fatigue_runner.turbine.consistency import check_consistency
from fatigue_runner.turbine.finite_elements import with_modes
from fatigue_runner.turbine.tables import INTERPOLATIONS

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Angle = Annotated[float, Field(gt=-45, lt=45)]
Ratio = Annotated[float, Field(ge=0, lt=1)]
Efficiency = Annotated[float, Field(gt=0, le=1)]


class Environment(Section):
    """Air and gravity."""

    air_density: Positive
    gravity: NotNegative


class Geometry(Section):
    """Where rotor, shaft and tower are; angles in OpenFAST's signs."""

    blades: int
    tip_radius: Positive
    hub_radius: NotNegative
    precone_deg: Angle
    shaft_tilt_deg: Angle
    overhang: float
    tower_top_to_shaft: float
    tower_height: Positive
    tower_base_height: float

    @field_validator("blades")
    @classmethod
    def _three(cls, blades: int) -> int:
        if blades != 3:
            raise problem(f"must be 3, the model's equations are those of a three-bladed rotor; got {blades}")
        return blades

    @model_validator(mode="after")
    def _room(self) -> Geometry:
        if not self.hub_radius < self.tip_radius:
            raise problem(f"hub_radius {self.hub_radius:g} m must be below tip_radius {self.tip_radius:g} m")
        if not self.tower_base_height < self.tower_height:
            raise problem(
                f"tower_height {self.tower_height:g} m must be above tower_base_height {self.tower_base_height:g} m"
            )
        return self


class Hub(Section):
    """A point mass on the shaft that turns; centre_of_mass: downwind of the rotor apex."""

    mass: Positive
    inertia: NotNegative
    centre_of_mass: float = 0.0


class Nacelle(Section):
    """A rigid body on the tower; its centre of mass: downwind, lateral, up, from the tower top, where the yaw bearing's mass is."""

    mass: Positive
    yaw_inertia: NotNegative
    centre_of_mass: list[float] = Field(min_length=3, max_length=3)
    yaw_bearing_mass: NotNegative = 0.0

    @model_validator(mode="after")
    def _a_body(self) -> Nacelle:
        x, y, _ = self.centre_of_mass
        least = self.mass * (x * x + y * y)
        if self.yaw_inertia < least:
            raise problem(
                f"yaw_inertia {self.yaw_inertia:g} kg.m2 is about the yaw axis, so that it cannot be below "
                f"mass (x^2 + y^2) = {least:g} kg.m2"
            )
        return self


class Drivetrain(Section):
    """Shaft, gearbox and generator rotor. shaft: rigid has the generator turn with the rotor (docs/turbines.md)."""

    shaft: Literal["flexible", "rigid"] = "flexible"
    gearbox_ratio: Positive
    gearbox_efficiency: Efficiency = 1.0
    torsional_stiffness: Positive
    torsional_damping: NotNegative
    generator_inertia: Positive


class Regions(Section):
    """The torque law of `law: regions`; region 3 has constant power or constant torque."""

    region_3_speed_rpm: Positive
    slip_percent: Annotated[float, Field(ge=0.01, le=100)]
    rated_mechanical_power: Positive | None = None
    rated_torque: Positive | None = None
    blend_torque: NotNegative

    @model_validator(mode="after")
    def _power_or_torque(self) -> Regions:
        if (self.rated_mechanical_power is None) == (self.rated_torque is None):
            raise problem(
                "needs rated_mechanical_power (constant power above rated) or rated_torque (constant torque), one of the two"
            )
        return self


class Generator(Section):
    """The torque over the generator's speed."""

    law: Literal["regions", "optimal"]
    optimal_gain: Positive
    regions: Regions | None = None
    efficiency: Efficiency = 1.0

    @model_validator(mode="after")
    def _regions_of_their_law(self) -> Generator:
        if self.law == "regions" and self.regions is None:
            raise problem("is missing; law: regions needs it", key="regions")
        return self


class Stations(Section):
    """A table: the names of its columns, and a row for every station."""

    columns: list[str]
    rows: list[list[Any]] = Field(min_length=2)


class Member(Section):
    """Blade or tower: a beam with stations and modes, which follow from mass and stiffness where none are given."""

    fraction: ClassVar[str]  # the column that says where a station is
    numbers: ClassVar[tuple[str, ...]]  # the other columns
    modes: ClassVar[tuple[str, ...]]

    stations: Stations

    @model_validator(mode="after")
    def _a_beam(self) -> Member:
        _check_table(self.stations, (self.fraction, *self.numbers), ())
        with _about("stations"):
            beam.stations_of({"stations": self.stations.model_dump()}, self.fraction, "")
        for name in self.modes:
            coefficients = getattr(self, f"{name}_mode")
            if coefficients is not None:
                with _about(f"{name}_mode"):
                    beam.mode_shape(coefficients, "")
        return self


@contextmanager
def _about(key: str) -> Iterator[None]:
    """What the beam refuses becomes a problem of this key."""
    try:
        yield
    except InputError as error:
        raise problem(str(error).removeprefix(": "), key=key) from None


class Blade(Member):
    """One blade, root to tip."""

    fraction = "span_fraction"
    numbers = ("structural_twist_deg", "mass_density", "flap_stiffness", "edge_stiffness")
    modes = ("flap", "edge")

    mass_factor: Positive
    flap_stiffness_factor: Positive
    edge_stiffness_factor: Positive
    flap_damping_ratio: Ratio
    edge_damping_ratio: Ratio
    flap_mode: list[float] | None = Field(default=None, min_length=1)
    edge_mode: list[float] | None = Field(default=None, min_length=1)
    mass_element_lengths: list[Positive] = Field(min_length=1)
    tip_mass: NotNegative = 0.0


class Tower(Member):
    """The tower, base to top."""

    fraction = "height_fraction"
    numbers = ("mass_density", "fore_aft_stiffness", "side_side_stiffness")
    modes = ("fore_aft", "side_side")

    mass_factor: Positive
    fore_aft_stiffness_factor: Positive
    side_side_stiffness_factor: Positive
    fore_aft_damping_ratio: Ratio
    side_side_damping_ratio: Ratio
    fore_aft_mode: list[float] | None = Field(default=None, min_length=1)
    side_side_mode: list[float] | None = Field(default=None, min_length=1)
    mass_elements: int = Field(ge=1)
    diameters: list[list[float]] | None = Field(default=None, min_length=2)

    @field_validator("diameters")
    @classmethod
    def _rise(cls, rows: list[list[float]] | None) -> list[list[float]] | None:
        for number, row in enumerate(rows or (), start=1):
            if len(row) != 2 or not row[1] > 0:
                raise problem(f"row {number} must be a height and a positive diameter in m; got {row!r:.60}")
        heights = [row[0] for row in rows or ()]
        if any(high <= low for low, high in itertools.pairwise(heights)):
            raise problem(f"heights must rise from row to row; got {heights!r:.60}")
        return rows


class Aerodynamics(Section):
    """The coefficient tables, and what they are made from."""

    tables: str
    interpolation: str = "cubic"
    airfoils: str | None = None
    skewed_wake: bool = True
    polar_smoothing_deg: NotNegative | None = None
    deflection: float = 0.0
    stations: Stations | None = None

    @field_validator("interpolation")
    @classmethod
    def _known(cls, kind: str) -> str:
        return known_name(kind, INTERPOLATIONS)

    @field_validator("stations")
    @classmethod
    def _columns(cls, stations: Stations | None) -> Stations | None:
        if stations is not None:
            _check_table(
                stations, ("span", "chord", "twist_deg"), ("airfoil",), ("prebend", "sweep", "cant_deg")
            )
        return stations

    @model_validator(mode="after")
    def _what_tables_are_made_from(self) -> Aerodynamics:
        for key in ("polar_smoothing_deg", "stations"):
            if self.airfoils is not None and getattr(self, key) is None:
                raise problem("is missing; tables are made from it and the airfoils", key=key)
        return self


class CircleSection(Section):
    """A circular section by its outer diameter and wall [m]."""

    diameter: Positive
    wall: Positive

    @model_validator(mode="after")
    def _fits(self) -> CircleSection:
        if not 2 * self.wall < self.diameter:
            raise problem(f"{self.wall:g} m does not fit into a diameter of {self.diameter:g} m", key="wall")
        return self


class Sections(Section):
    """Where wear is counted; no motion depends on it."""

    tower_base: CircleSection | None = None
    blade_root: CircleSection | None = None


class Published(Section):
    """What is known of the turbine from elsewhere, to check the file against; refused where it is off by more than `tolerance`."""

    tolerance: Annotated[float, Field(gt=0, lt=1)] = 0.02
    blade_mass: Positive | None = None
    rotor_inertia: Positive | None = None
    tower_mass: Positive | None = None


class DeckOrigin(Section):
    """The OpenFAST deck that a file was imported from: its `.fst` and the SHA-256 of every file that was read."""

    file: str
    sha256: dict[str, str]


class TurbineFile(Section):
    """A whole turbine file, its base merged in."""

    name: str = Field(min_length=1)
    model: str = "t2b1i1cg"
    description: str = ""
    source: str = ""
    deck: DeckOrigin | None = None
    published: Published | None = None
    environment: Environment
    geometry: Geometry
    hub: Hub
    nacelle: Nacelle
    drivetrain: Drivetrain
    generator: Generator
    control: Annotated[SerializeAsAny[ControlSection], PlainValidator(control_section)] | None = None
    blade: Blade
    tower: Tower
    sections: Sections | None = None
    operating_wind: list[float] | None = Field(default=None, min_length=2, max_length=2)
    aerodynamics: Aerodynamics

    @field_validator("name")
    @classmethod
    def _part_of_file_names(cls, name: str) -> str:
        if any(letter in "/\\" or not letter.isprintable() for letter in name):
            raise problem(f"becomes part of files' names, so it has no `/` and no `\\`; got {name!r:.60}")
        return name

    @field_validator("model")
    @classmethod
    def _known_model(cls, model: str) -> str:
        return known_name(model, FAMILIES)

    @field_validator("operating_wind")
    @classmethod
    def _from_cut_in_to_cut_out(cls, wind: list[float] | None) -> list[float] | None:
        if wind is not None and not 0 <= wind[0] < wind[1]:
            raise problem(f"must be [cut-in, cut-out] in m/s, rising; got {wind}")
        return wind


class AirfoilFile(Section):
    """The polars: rows of angle of attack [deg], lift and drag coefficient, by the airfoil's name; or the same as a block of text."""

    columns: list[str] = Field(default=["angle_of_attack_deg", "lift", "drag"])
    airfoils: dict[str, list[list[float]]]

    @field_validator("airfoils", mode="before")
    @classmethod
    def _rows(cls, airfoils: Any) -> Any:
        if not isinstance(airfoils, dict):
            return airfoils
        return {
            name: _block(name, rows) if isinstance(rows, str) else rows for name, rows in airfoils.items()
        }


def _block(name: str, text: str) -> list[list[float]]:
    rows = []
    for count, line in enumerate(text.splitlines(), start=1):
        try:
            row = [float(word) for word in line.replace(",", " ").split()]
        except ValueError:
            raise problem(f"row {count} must be three numbers; got {line.strip()!r:.60}", key=name) from None
        if row:
            rows.append(row)
    return rows


def _check_table(
    table: Stations, numbers: tuple[str, ...], words: tuple[str, ...], optional: tuple[str, ...] = ()
) -> None:
    """Raise where a table has other columns, or a row that does not fit them."""
    needed = (*numbers, *words)
    known = (*needed, *optional)
    for name in table.columns:
        if name not in known:
            raise problem(f"unknown column {name!r}{did_you_mean(name, known)}", key="stations")
    for name in known:
        if table.columns.count(name) != 1 and (name in needed or name in table.columns):
            what = "is missing" if name not in table.columns else "is given twice"
            raise problem(f"column {name!r} {what}; it has {', '.join(table.columns)}", key="stations")
    for number, row in enumerate(table.rows, start=1):
        if len(row) != len(table.columns):
            raise problem(
                f"row {number} has {len(row)} values for the {len(table.columns)} columns", key="stations"
            )
        for name, value in zip(table.columns, row, strict=True):
            if not isinstance(value, str if name in words else int | float) or isinstance(value, bool):
                kind = "a name" if name in words else "a number"
                raise problem(f"{name} of row {number} must be {kind}; got {value!r:.60}", key="stations")


def read_turbine_file(name: str) -> dict[str, Any]:
    """The mapping of a turbine file, its `base` merged in. `name`: a shipped turbine or a path to a YAML.

    Raises InputError, one sentence with file and line per problem, for what is missing, unknown or impossible.
    """
    return check_turbine(_source(_located(name, Path()), ()))


def check_turbine(source: Source) -> dict[str, Any]:
    """The data of a source that holds a whole turbine, or a full set of parameters, which has checks of its own.

    Modes that are not given are those of mass and stiffness. Raises InputError as `read_turbine_file`.
    """
    if "parameters" in source.data:
        return dict(source.data)
    validated(TurbineFile, source)
    data = with_modes(source.data)
    if (
        data["aerodynamics"].get("airfoils", "") is None
    ):  # taken away from the base's: tables without what they were made of
        data["aerodynamics"] = {k: v for k, v in data["aerodynamics"].items() if k != "airfoils"}
    check_consistency(data, source)
    return data


def mapping_source(mapping: Mapping[str, Any]) -> Source:
    """A turbine that is given as a mapping."""
    return Source("turbine", mapping, what="turbine")


def _located(name: str, folder: Path) -> Path:
    """The file of a shipped turbine, or the path as seen from a folder."""
    if Path(name).suffix:
        path = folder / Path(name).expanduser()
        if not path.is_file():
            raise InputError(
                f"turbine file {path} does not exist; give a shipped name such as nrel5mw or a path"
            )
        return path
    path = shipped.turbines() / f"{name}.yaml"
    if not path.exists():
        known = sorted(p.stem for p in shipped.turbines().glob("*.yaml") if not p.stem.endswith("airfoils"))
        raise InputError(
            f"there is no turbine {name!r}{did_you_mean(name, known)} (or give the path of a YAML file)"
        )
    return path


def _source(path: Path, below: tuple[Path, ...]) -> Source:
    """A file laid over its base, and that over its own."""
    source = read_mapping(path, "turbine", "name, blade, tower, ...")
    # where a file names other files, they lie beside it, also when another turbine in another folder builds on it
    aero = source.data.get("aerodynamics")
    for key in ("tables", "airfoils"):
        if isinstance(aero, dict) and isinstance(aero.get(key), str):
            aero[key] = str(path.parent / aero[key])
    base = source.data.pop("base", None)
    if base is None:
        return source
    where = source.where(("base",))
    if not isinstance(base, str):
        raise InputError(f"{where}: base must be a shipped turbine's name or a file's path; got {base!r:.60}")
    try:
        under = _located(base, path.parent)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    if under.resolve() in (*below, path.resolve()):
        raise InputError(f"{where}: base {base!r} leads back to this file; name another turbine")
    return source.over(_source(under, (*below, path.resolve())))
