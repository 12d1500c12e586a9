"""What no single entry of a turbine file gives away: entries that do not fit each other, said in one sentence with the line."""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, pi, radians, sin
from typing import Any

from fatigue_runner.errors import InputError
from fatigue_runner.inputs.source import Source
from fatigue_runner.turbine.beam import blade_modes, columns, tower_modes

SMALLEST_TWIST_DEG = 0.7  # the largest angle of a blade's twist; below it the column is in radians
# Shaft above the tower top by its height: 1 to 3 % on machines of 30 m to 280 m.
HIGHEST_SHAFT = 0.2


def check_consistency(data: Mapping[str, Any], source: Source) -> None:
    """Raise InputError for a turbine file whose entries contradict each other."""
    _check_heights(data, source)
    _check_twist(data, source)
    _check_published(data, source)


def hub_height(data: Mapping[str, Any]) -> float:
    """Of the rotor apex above ground [m]."""
    g = data["geometry"]
    return float(
        g["tower_height"] + g["tower_top_to_shaft"] + g["overhang"] * sin(radians(g["shaft_tilt_deg"]))
    )


def _check_heights(data: Mapping[str, Any], source: Source) -> None:
    g = data["geometry"]
    where, height = source.where(("geometry", "tower_height")), hub_height(data)
    if g["tower_top_to_shaft"] > HIGHEST_SHAFT * g["tower_height"]:
        raise InputError(
            f"{source.where(('geometry', 'tower_top_to_shaft'))}: the tower is shorter than the hub is high: it ends at "
            f"{g['tower_height']:g} m, the shaft is {g['tower_top_to_shaft']:g} m above; tower_top_to_shaft is the height of the "
            "shaft above the tower top, tower_height that of the tower top above ground"
        )
    if not height > g["tip_radius"]:
        raise InputError(
            f"{where}: the tower is too short: the hub is {height:.4g} m above ground and the blades reach {g['tip_radius']:g} m "
            "down; tower_height is the height of the tower top above ground"
        )
    diameters = data["tower"].get("diameters")
    if diameters and diameters[-1][0] > 1.02 * g["tower_height"]:
        raise InputError(
            f"{source.where(('tower', 'diameters'))}: the diameters go up to {diameters[-1][0]:g} m, the tower ends at "
            f"{g['tower_height']:g} m above ground (tower_height)"
        )


def _check_twist(data: Mapping[str, Any], source: Source) -> None:
    for key, table, name in (
        (("aerodynamics", "stations"), data["aerodynamics"].get("stations"), "twist_deg"),
        (("blade", "stations"), data["blade"]["stations"], "structural_twist_deg"),
    ):
        if table is None:
            continue
        largest = max(abs(columns(table)[name]))
        if 0 < largest < SMALLEST_TWIST_DEG:
            raise InputError(
                f"{source.where(key)}: {name} is at most {largest:.3g} deg, which looks like radians "
                f"({largest * 180 / pi:.3g} deg would be usual at the root); give degrees"
            )


def _check_published(data: Mapping[str, Any], source: Source) -> None:
    """Masses that are known from elsewhere against those that the tables make."""
    published = data.get("published") or {}
    known = {name: value for name, value in published.items() if name != "tolerance" and value is not None}
    if not known:
        return
    blade, cone = blade_modes(data), radians(data["geometry"]["precone_deg"])
    # a blade's sections turn about the shaft at r cos(cone)
    inertia = data["hub"]["inertia"] + 3 * float(blade.integrals[1, 1]) * cos(cone) ** 2
    own = {"blade_mass": blade.mass, "rotor_inertia": inertia, "tower_mass": tower_modes(data).mass}
    units = {"blade_mass": "kg", "rotor_inertia": "kg.m2", "tower_mass": "kg"}
    for name, value in known.items():
        off = own[name] / value - 1
        if abs(off) > published.get("tolerance", 0.02):
            what = name.replace("_", " ")
            raise InputError(
                f"{source.where(('published', name))}: the {what} of the tables is {own[name]:.6g} {units[name]}, {off:+.1%} "
                f"from the {value:.6g} that is published; correct {_CAUSE[name]}"
            )


_CAUSE = {
    "blade_mass": "the mass density of blade.stations, or blade.mass_factor",
    "rotor_inertia": "the mass density of blade.stations or hub.inertia: the blade is "
    "heavier or lighter, or its mass lies elsewhere, than the inertia says",
    "tower_mass": "the mass density of tower.stations, or tower.mass_factor",
}
