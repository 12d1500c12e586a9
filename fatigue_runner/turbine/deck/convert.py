"""What a deck's numbers mean here: a turbine file's mapping, in the order and units of its schema."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from fatigue_runner.errors import InputError
from fatigue_runner.turbine.deck import rosco
from fatigue_runner.turbine.deck.files import Deck
from fatigue_runner.turbine.deck.polars import station_polars
from fatigue_runner.turbine.deck.text import DeckFile, Table, spelled

BENT = 0.01  # of the length; a blade that is bent by less is taken as straight
LONGEST_TIP, TIP_PARTS = (
    0.025,
    4,
)  # the blade's last element over its length, and into how many parts a longer one is cut
PLACEHOLDER_STIFFNESS = 1e12  # N.m/rad, of a shaft that is rigid anyway
STIFFEST_SHAFT_HZ = 6.0  # torsion above that, which nothing excites, is taken as rigid
STEP = 1e-6  # of the length; two stations nearer than that are one place where the section jumps
POLAR_SMOOTHING_DEG = 1.0
SHAPE = range(2, 7)

# Keys of the deck whose numbers stand in a turbine file as they are
ORIGINS = {
    "environment.air_density": "AirDens",
    "environment.gravity": "Gravity",
    "geometry.tip_radius": "TipRad",
    "geometry.hub_radius": "HubRad",
    "geometry.precone_deg": "PreCone(1)",
    "geometry.shaft_tilt_deg": "ShftTilt",
    "geometry.tower_height": "TowerHt",
    "hub.mass": "HubMass",
    "hub.inertia": "HubIner",
    "nacelle.mass": "NacMass",
    "nacelle.yaw_inertia": "NacYIner",
    "nacelle.yaw_bearing_mass": "YawBrMass",
    "drivetrain.gearbox_ratio": "GBRatio",
    "drivetrain.torsional_damping": "DTTorDmp",
    "drivetrain.generator_inertia": "GenIner",
    "generator.optimal_gain": "VS_Rgn2K",
    "generator.regions.region_3_speed_rpm": "VS_RtGnSp",
    "generator.regions.rated_torque": "VS_RtTq",
    "control.filter_frequency_hz": "F_LPFCornerFreq",
    "control.largest_torque": "VS_MaxTq",
    "blade.mass_factor": "AdjBlMs",
    "blade.flap_stiffness_factor": "AdjFlSt",
    "blade.edge_stiffness_factor": "AdjEdSt",
    "blade.tip_mass": "TipMass(1)",
    "tower.mass_factor": "AdjTwMa",
    "tower.fore_aft_stiffness_factor": "AdjFASt",
    "tower.side_side_stiffness_factor": "AdjSSSt",
}


@dataclass(frozen=True)
class Converted:
    """data: a turbine file's mapping but for its torque law where `law` is False; airfoils: {name: [[deg, lift, drag], ...]};
    notes: what was decided on the way."""

    data: dict[str, Any]
    airfoils: dict[str, list[list[float]]]
    law: bool
    notes: list[str] = field(default_factory=list)


def converted(deck: Deck, name: str) -> Converted:
    """Raises InputError, with file and line, for numbers that make no turbine."""
    notes: list[str] = []
    blade = _blade(deck, notes)
    airfoils, stations = _aerodynamics(deck, notes)
    drivetrain = _drivetrain(deck, notes)
    steering = rosco.steering(deck, drivetrain, notes)
    data: dict[str, Any] = {
        "name": name,
        "description": _description(deck),
        "source": f"imported from the OpenFAST deck {deck.main.path.name}",
        "environment": {"air_density": _air_density(deck), "gravity": _gravity(deck.main, deck.elasto)},
        "geometry": _geometry(deck.elasto, notes),
        "hub": {
            "mass": deck.elasto.number("HubMass"),
            "inertia": deck.elasto.number("HubIner"),
            "centre_of_mass": deck.elasto.number("HubCM", default=0.0),
        },
        "nacelle": {
            "mass": deck.elasto.number("NacMass"),
            "yaw_inertia": deck.elasto.number("NacYIner"),
            "centre_of_mass": [deck.elasto.number(f"NacCM{axis}n") for axis in "xyz"],
            "yaw_bearing_mass": deck.elasto.number("YawBrMass", default=0.0),
        },
        "drivetrain": _with_shaft(drivetrain, deck, blade, notes),
        "generator": steering.generator,
        "control": steering.control,
        "blade": blade,
        "tower": _tower(deck, notes),
        "aerodynamics": {
            "skewed_wake": _skewed_wake(deck.aero),
            "polar_smoothing_deg": POLAR_SMOOTHING_DEG,
            "stations": stations,
        },
    }
    _mend_nacelle(data["nacelle"], deck.elasto, notes)
    return Converted(data, airfoils, bool(steering.generator), notes)


def _description(deck: Deck) -> str:
    for file in (deck.main, deck.elasto):
        if file.title and not file.title.lower().startswith("generated with"):
            return file.title[:200]
    return deck.main.path.stem


def _air_density(deck: Deck) -> float:
    """Of AeroDyn's file, which may leave it to the .fst."""
    own = deck.main.number("AirDens", default=0.0)
    density = deck.aero.number("AirDens", default=own or 1.225)
    if not density > 0:
        raise InputError(f"{deck.aero.where('AirDens')}: AirDens must be above 0 kg/m3; got {density:g}")
    return density


def _gravity(main: DeckFile, elasto: DeckFile) -> float:
    return (main if main.has("Gravity") else elasto).number("Gravity", default=9.80665)


def _geometry(elasto: DeckFile, notes: list[str]) -> dict[str, Any]:
    cones = [elasto.number(f"PreCone({i})", default=elasto.number("PreCone(1)")) for i in (1, 2, 3)]
    if max(cones) - min(cones) > 1e-6:
        notes.append(
            f"the blades' cone angles differ ({', '.join(f'{c:g}' for c in cones)} deg): all have their mean, the imbalance is lost"
        )
    return {
        "blades": 3,
        "tip_radius": elasto.number("TipRad"),
        "hub_radius": elasto.number("HubRad"),
        "precone_deg": float(np.mean(cones)) if len(set(cones)) > 1 else cones[0],
        "shaft_tilt_deg": elasto.number("ShftTilt"),
        "overhang": elasto.number("OverHang"),
        "tower_top_to_shaft": elasto.number("Twr2Shft"),
        "tower_height": elasto.number("TowerHt"),
        "tower_base_height": elasto.number("TowerBsHt", "TwrRBHt", default=0.0),
    }


def _mend_nacelle(nacelle: dict[str, Any], elasto: DeckFile, notes: list[str]) -> None:
    """The yaw inertia cannot be below mass times distance squared; some decks give it about the nacelle's own centre."""
    x, y, _ = nacelle["centre_of_mass"]
    least = nacelle["mass"] * (x * x + y * y)
    if nacelle["yaw_inertia"] < least:
        notes.append(
            f"NacYIner {nacelle['yaw_inertia']:g} kg.m2 ({elasto.where('NacYIner')}) is below mass times distance squared, {least:g}: "
            "taken as about the nacelle's own centre; no load of this model depends on it"
        )
        nacelle["yaw_inertia"] += least


def _drivetrain(deck: Deck, notes: list[str]) -> dict[str, Any]:
    elasto = deck.elasto
    efficiency = elasto.number("GBoxEff", default=100.0) / 100
    if not 0 < efficiency <= 1:
        notes.append(
            f"GBoxEff {100 * efficiency:g} % ({elasto.where('GBoxEff')}) is no efficiency: taken as 100 %"
        )
        efficiency = 1.0
    return {
        "shaft": "flexible",
        "gearbox_ratio": elasto.number("GBRatio"),
        "gearbox_efficiency": efficiency,
        "torsional_stiffness": elasto.number("DTTorSpr"),
        "torsional_damping": elasto.number("DTTorDmp"),
        "generator_inertia": elasto.number("GenIner"),
    }


def _with_shaft(drive: dict[str, Any], deck: Deck, blade: dict[str, Any], notes: list[str]) -> dict[str, Any]:
    """The drivetrain with the kind of its shaft: rigid where its torsion is too fast to matter, and for every step that one would want."""
    stiffness, place = drive["torsional_stiffness"], deck.elasto.where("DTTorSpr")
    rotor = deck.elasto.number("HubIner") + 3 * _second_moment(deck, blade)
    generator = drive["generator_inertia"] * drive["gearbox_ratio"] ** 2
    if not generator > 0:
        raise InputError(
            f"{deck.elasto.where('GenIner')}: GenIner must be above 0 kg.m2; got {drive['generator_inertia']:g}"
        )
    if stiffness <= 0:
        notes.append(f"DTTorSpr {stiffness:g} ({place}) is no stiffness: the shaft is rigid")
        return drive | {
            "shaft": "rigid",
            "torsional_stiffness": PLACEHOLDER_STIFFNESS,
            "torsional_damping": 0.0,
        }
    torsion = float(np.sqrt(stiffness * (1 / rotor + 1 / generator)) / (2 * np.pi))
    if torsion <= STIFFEST_SHAFT_HZ:
        return drive
    notes.append(
        f"the shaft's torsion is at {torsion:.3g} Hz (DTTorSpr {stiffness:g}, {place}): it is rigid here, the "
        f"generator turns with the rotor; "
        "`drivetrain: shaft: flexible` has it, at steps of some milliseconds (docs/turbines.md)"
    )
    return drive | {"shaft": "rigid"}


def _second_moment(deck: Deck, blade: dict[str, Any]) -> float:
    """Of one blade about the apex [kg.m2], by trapezoids."""
    rows = np.array(blade["stations"]["rows"])
    hub, length = deck.elasto.number("HubRad"), deck.elasto.number("TipRad") - deck.elasto.number("HubRad")
    if not length > 0:
        raise InputError(f"{deck.elasto.where('TipRad')}: TipRad must be above HubRad")
    return float(
        blade["mass_factor"]
        * np.trapezoid(rows[:, 2] * (hub + rows[:, 0] * length) ** 2, rows[:, 0] * length)
    )


def _blade(deck: Deck, notes: list[str]) -> dict[str, Any]:
    file, elasto = deck.blade, deck.elasto
    table = file.table(("BlFract", "StrcTwst", "BMassDen", "FlpStff", "EdgStff"), "NBlInpSt")
    names = ("BlFract", "StrcTwst", "BMassDen", "FlpStff", "EdgStff")
    rows = _stations(file, [file.column(table, n) for n in names], table.lines, "BlFract", (2, 3, 4))
    tips = [elasto.number(f"TipMass({i})", default=0.0) for i in (1, 2, 3)]
    elements = _blade_elements(deck, notes)
    return {
        "mass_factor": file.number("AdjBlMs", default=1.0),
        "flap_stiffness_factor": file.number("AdjFlSt", default=1.0)
        * file.number("FlStTunr(1)", default=1.0),
        "edge_stiffness_factor": file.number("AdjEdSt", default=1.0),
        "flap_damping_ratio": _percent(file, "BldFlDmp(1)", "BldFlDmp1"),
        "edge_damping_ratio": _percent(file, "BldEdDmp(1)", "BldEdDmp1"),
        "flap_mode": _mode(file, "BldFl1Sh", notes),
        "edge_mode": _mode(file, "BldEdgSh", notes),
        "tip_mass": float(np.mean(tips)),
        "mass_element_lengths": elements,
        "stations": {
            "columns": [
                "span_fraction",
                "structural_twist_deg",
                "mass_density",
                "flap_stiffness",
                "edge_stiffness",
            ],
            "rows": rows,
        },
    }


def _percent(file: DeckFile, *keys: str) -> float:
    value = file.number(*keys)
    if not 0 <= value < 100:
        raise InputError(
            f"{file.where(keys[0])}: {keys[0]} must be a damping in percent of critical; got {value:g}"
        )
    return value / 100


def _mode(file: DeckFile, stem: str, notes: list[str]) -> list[float] | None:
    """Coefficients of x^2 .. x^6 that add up to 1; None where the file has none, then they follow from the stiffness."""
    if not file.has(f"{stem}(2)"):
        notes.append(f"{file.path.name} has no mode {stem}: it follows from mass and stiffness")
        return None
    values = [file.number(f"{stem}({power})") for power in SHAPE]
    total = math.fsum(values)
    if abs(total - 1) <= 1e-3:  # as it stands: ElastoDyn takes it so, too
        return values
    if not 0.9 < total < 1.1:
        raise InputError(
            f"{file.where(f'{stem}(2)')}: the coefficients {stem}(2) to (6) must add up to 1, the mode's displacement at the end; "
            f"they add up to {total:g}"
        )
    notes.append(f"the coefficients {stem} of {file.path.name} add up to {total:.4g}: they are scaled to 1")
    return [value / total for value in values]


def _stations(
    file: DeckFile, columns: list[list[float]], lines: tuple[int, ...], name: str, positive: tuple[int, ...]
) -> list[list[float]]:
    """Rows that run from 0 to 1 and rise, by the table's first column; a jump (two stations at one place) becomes a short ramp, a
    single station a uniform member."""
    if len(columns[0]) == 1:
        columns, lines = [[0.0, 1.0], *(column * 2 for column in columns[1:])], lines * 2
    place = columns[0]
    for line, (low, high) in zip(lines[1:], pairwise(place), strict=True):
        if high < low - STEP:
            raise InputError(
                f"{file.path}:{line}: {name} must rise from row to row; got {high:g} after {low:g}"
            )
    if abs(place[0]) > 1e-4 or abs(place[-1] - 1) > 1e-4:
        raise InputError(
            f"{file.path}:{lines[0]}: {name} must run from 0 to 1; it runs from {place[0]:g} to {place[-1]:g}"
        )
    for index in positive:
        for line, value in zip(lines, columns[index], strict=True):
            if not value > 0:
                raise InputError(
                    f"{file.path}:{line}: mass density and stiffness must be positive; got {value:g}"
                )
    rising = np.array(place)
    rising[0], rising[-1] = 0.0, 1.0
    for i in range(1, len(rising)):
        rising[i] = max(rising[i], rising[i - 1] + STEP)
    for i in range(len(rising) - 2, 0, -1):
        if rising[i] >= rising[i + 1] or rising[-1] > 1.0:
            rising[-1] = 1.0
            rising[i] = min(rising[i], rising[i + 1] - STEP)
    return [[float(x), *(column[i] for column in columns[1:])] for i, x in enumerate(rising)]


def _blade_elements(deck: Deck, notes: list[str]) -> list[float]:
    """Lengths of the elements at whose middles ElastoDyn lumps the mass: equal ones.

    Except where the density is scaled by a factor and AeroDyn's inner nodes are as many as ElastoDyn's: those were the elements of AeroDyn
    14's days that the factor was made for, and they give the mass that the turbine is published with.
    """
    count = deck.elasto.count("BldNodes")
    equal = [1.0] * max(count, 1)
    factor = deck.blade.number("AdjBlMs", default=1.0)
    span = deck.aero_blade.column(_aero_blade_table(deck.aero_blade), "BlSpn")
    if factor == 1.0 or len(span) - 2 != count:
        return equal
    lengths, edge = [], span[0]
    for node in span[1:-1]:
        lengths.append(2 * (node - edge))
        edge += lengths[-1]
    if min(lengths) <= 0 or abs(edge - span[-1]) > 1e-3 * span[-1]:
        return equal
    notes.append(
        f"blade masses are lumped at AeroDyn's {count} inner nodes, for which the factor AdjBlMs {factor:g} was made; "
        f"ElastoDyn lumps them at {count} equal elements"
    )
    return [round(length, 6) for length in lengths]


def _aero_blade_table(file: DeckFile) -> Table:
    return file.table(("BlSpn", "BlTwist", "BlChord", "BlAFID"), "NumBlNds")


def _tower(deck: Deck, notes: list[str]) -> dict[str, Any]:
    file = deck.tower
    names = ("HtFract", "TMassDen", "TwFAStif", "TwSSStif")
    table = file.table(names, "NTwInpSt")
    rows = _stations(file, [file.column(table, n) for n in names], table.lines, "HtFract", (1, 2, 3))
    out = {
        "mass_factor": file.number("AdjTwMa", default=1.0),
        "fore_aft_stiffness_factor": file.number("AdjFASt", default=1.0)
        * file.number("FAStTunr(1)", default=1.0),
        "side_side_stiffness_factor": file.number("AdjSSSt", default=1.0)
        * file.number("SSStTunr(1)", default=1.0),
        "fore_aft_damping_ratio": _percent(file, "TwrFADmp(1)"),
        "side_side_damping_ratio": _percent(file, "TwrSSDmp(1)"),
        "fore_aft_mode": _mode(file, "TwFAM1Sh", notes),
        "side_side_mode": _mode(file, "TwSSM1Sh", notes),
        "mass_elements": max(deck.elasto.count("TwrNodes"), 1),
        "stations": {
            "columns": ["height_fraction", "mass_density", "fore_aft_stiffness", "side_side_stiffness"],
            "rows": rows,
        },
    }
    diameters = _diameters(deck.aero, deck.elasto.number("TowerHt"))
    return out | ({"diameters": diameters} if diameters else {})


def _diameters(aero: DeckFile, top: float) -> list[list[float]]:
    """Heights above ground and outer diameters [m] of AeroDyn's tower, as far as the tower goes; empty where there is none."""
    if not aero.has("NumTwrNds") or aero.count("NumTwrNds") < 2:
        return []
    table = aero.table(("TwrElev", "TwrDiam"), "NumTwrNds")
    pairs = sorted(zip(aero.column(table, "TwrElev"), aero.column(table, "TwrDiam"), strict=True))
    rows: list[list[float]] = []
    for height, diameter in pairs:
        if diameter > 0 and height >= 0 and height <= 1.02 * top and (not rows or height > rows[-1][0]):
            rows.append([height, diameter])
    return rows if len(rows) >= 2 else []


def _skewed_wake(aero: DeckFile) -> bool:
    """Whether AeroDyn's induction follows a skewed wake: Pitt & Peters in old files, Glauert's in new ones."""
    if aero.has("Skew_Mod"):
        return aero.switch("Skew_Mod", default=1) == 1 and aero.switch("SkewRedistr_Mod", default=1) != 0
    return aero.switch("SkewMod", default=2) != 1


def _aerodynamics(deck: Deck, notes: list[str]) -> tuple[dict[str, list[list[float]]], dict[str, Any]]:
    """Polars by name, and the blade's stations."""
    file = deck.aero_blade
    table = _aero_blade_table(file)
    span, twist, chord = (file.column(table, n) for n in ("BlSpn", "BlTwist", "BlChord"))
    numbers = [int(v) for v in file.column(table, "BlAFID")]
    length = deck.elasto.number("TipRad") - deck.elasto.number("HubRad")
    for line, (low, high) in zip(table.lines[1:], pairwise(span), strict=True):
        if not high > low:
            raise InputError(
                f"{file.path}:{line}: BlSpn must rise from row to row; got {high:g} after {low:g}"
            )
    if abs(span[0]) > 1e-3 * length or abs(span[-1] - length) > 5e-3 * length:
        raise InputError(
            f"{file.path}:{table.lines[-1]}: BlSpn must run from 0 to the blade's length, TipRad - HubRad = {length:.6g} m "
            f"({deck.elasto.where('TipRad')}); it runs from {span[0]:g} to {span[-1]:g}"
        )
    if abs(span[-1] - length) > 1e-4 * length:
        notes.append(
            f"AeroDyn's blade is {span[-1]:.6g} m long, ElastoDyn's {length:.6g} m: AeroDyn's last station is moved to the tip"
        )
    span[0], span[-1] = 0.0, length
    for line, index in zip(table.lines, numbers, strict=True):
        if not 1 <= index <= len(deck.airfoils):
            raise InputError(
                f"{file.path}:{line}: BlAFID {index} is no airfoil; {deck.aero.path.name} names {len(deck.airfoils)}"
            )
    polars = station_polars(deck, numbers, span, chord, notes)
    columns = ["span", "chord", "twist_deg", "airfoil"]
    rows: list[list[Any]] = [list(row) for row in zip(span, chord, twist, polars.names, strict=True)]
    _bend(file, table, length, columns, rows, notes)
    rows = _finer_tip(rows, columns.index("airfoil"), length, notes)
    return polars.points, {"columns": columns, "rows": rows}


def _bend(
    file: DeckFile, table: Table, length: float, columns: list[str], rows: list[list[Any]], notes: list[str]
) -> None:
    """Columns of prebend, sweep and cant to the stations, where the blade is bent by more than its aerodynamic centre's offset."""
    given = {
        column: file.column(table, name)
        for column, name in (("prebend", "BlCrvAC"), ("sweep", "BlSwpAC"), ("cant_deg", "BlCrvAng"))
        if spelled(name) in table.columns
    }
    bent = {name for name in ("prebend", "sweep") if max(map(abs, given.get(name, [0.0]))) > BENT * length}
    if "prebend" in bent and any(given.get("cant_deg", ())):
        bent.add("cant_deg")
    for column, values in given.items():
        largest = max(map(abs, values))
        if column in bent:
            columns.append(column)
            for row, value in zip(rows, values, strict=True):
                row.append(value)
        elif largest and column != "cant_deg":
            notes.append(
                f"the {column} of AeroDyn's blade, up to {largest:.3g} m, is left out: below {100 * BENT:g} % of the length it is the "
                "aerodynamic centre's offset from the pitch axis, which turns the blade about its own axis only"
            )


def _finer_tip(rows: list[list[Any]], name: int, length: float, notes: list[str]) -> list[list[Any]]:
    """Rows with more of them in a last element that is too long: the load falls to zero at the tip as a root, not as a line."""
    last, tip = rows[-2:]
    if tip[0] - last[0] <= LONGEST_TIP * length:
        return rows
    notes.append(
        f"the blade's last element is {tip[0] - last[0]:.3g} m long: {TIP_PARTS - 1} stations are put into it, "
        f"since the load falls to zero at the tip"
    )
    between = []
    for part in range(1, TIP_PARTS):
        share = 1 - (1 - part / TIP_PARTS) ** 2
        between.append(
            [
                (a if share < 0.5 else b) if column == name else a + (b - a) * share
                for column, (a, b) in enumerate(zip(last, tip, strict=True))
            ]
        )
    return [*rows[:-1], *between, tip]
