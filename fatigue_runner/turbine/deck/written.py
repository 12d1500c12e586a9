"""A turbine's mapping as the YAML that a person reads and edits: a unit beside every number, a table row a line."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

_UNITS = {
    "air_density": "kg/m3",
    "gravity": "m/s2",
    "tip_radius": "m, rotor apex to blade tip along the pitch axis",
    "hub_radius": "m, rotor apex to blade root",
    "precone_deg": "deg, negative: tips upwind",
    "shaft_tilt_deg": "deg, negative: the upwind end of the shaft is the higher one",
    "overhang": "m, yaw axis to rotor apex along the shaft, negative: upwind",
    "tower_top_to_shaft": "m, vertical, tower top to shaft on the yaw axis",
    "tower_height": "m, ground to tower top",
    "tower_base_height": "m, ground to the foot of the flexible tower, which is clamped there",
    "hub.mass": "kg",
    "hub.inertia": "kg.m2, about the shaft",
    "hub.centre_of_mass": "m, downwind of the rotor apex along the shaft",
    "nacelle.mass": "kg",
    "yaw_inertia": "kg.m2, about the yaw axis",
    "nacelle.centre_of_mass": "m, downwind, lateral, up, from the tower top",
    "yaw_bearing_mass": "kg, at the tower top",
    "gearbox_ratio": "-",
    "gearbox_efficiency": "-",
    "torsional_stiffness": "N.m/rad, low-speed side",
    "torsional_damping": "N.m.s/rad, low-speed side",
    "generator_inertia": "kg.m2, high-speed side",
    "law": "regions: 2, 2.5 and 3 as below; optimal: optimal_gain * speed^2 at every speed",
    "optimal_gain": "N.m/(rad/s)^2, high-speed side",
    "region_3_speed_rpm": "rpm, high-speed side: region 3 from here",
    "slip_percent": "region 2.5 points to zero torque at region_3_speed / (1 + slip)",
    "rated_mechanical_power": "W, region 3: power / speed",
    "rated_torque": "N.m, region 3: this torque at every speed",
    "blend_torque": "N.m over which the corners between the regions are rounded",
    "efficiency": "electrical power / mechanical power",
    "rated_speed_rpm": "rpm, high-speed side, that the pitch holds",
    "proportional_gain": "s, at fine pitch",
    "integral_gain": "-, at fine pitch",
    "gain_schedule_pitch_deg": "deg, pitch at which the gains are halved",
    "filter_frequency_hz": "Hz, low-pass of the generator speed",
    "cut_in_speed_rpm": "rpm, high-speed side: region 1.5 begins",
    "region_2_speed_rpm": "rpm, high-speed side: region 2 begins",
    "largest_torque": "N.m",
    "fine_pitch_deg": "deg",
    "region_3_pitch_deg": "deg beyond fine pitch, above which region 3 holds at any speed",
    "unwind_blend": "rad, integral over which an integral below zero is pulled back",
    "torque_blend": "N.m over which the regions blend",
    "pitch_rate_limit_deg": "deg/s, watched only",
    "mass_factor": "on the mass density",
    "flap_damping_ratio": "of critical",
    "edge_damping_ratio": "of critical",
    "fore_aft_damping_ratio": "of critical, of the tower alone, without the mass on its top",
    "side_side_damping_ratio": "of critical, of the tower alone",
    "flap_mode": "coefficients of x^2 .. x^6, x the span fraction",
    "fore_aft_mode": "coefficients of x^2 .. x^6, x the height fraction",
    "tip_mass": "kg",
    "mass_element_lengths": "root to tip, scaled to the blade's length; the density at each middle counts",
    "mass_elements": "of equal length, lumped at their middles",
    "diameters": "[height above ground, outer diameter] in m; for the tower's influence on the wind",
    "skewed_wake": "the wake leans with the wind across the tilted rotor",
    "deflection": "m, of the tip downwind, for which the tables are made",
    "shaft": "flexible, or rigid: the generator turns with the rotor",
    "polar_smoothing_deg": "deg over which polars are averaged",
}
_COLUMN_UNITS = {
    "span_fraction": "-",
    "structural_twist_deg": "deg",
    "mass_density": "kg/m",
    "flap_stiffness": "N.m2",
    "edge_stiffness": "N.m2",
    "height_fraction": "-",
    "fore_aft_stiffness": "N.m2",
    "side_side_stiffness": "N.m2",
    "span": "m from the blade root",
    "chord": "m",
    "twist_deg": "deg",
    "airfoil": "name",
    "prebend": "m, downwind of the pitch axis",
    "sweep": "m, to the trailing edge",
    "cant_deg": "deg beyond the cone",
}


def turbine_text(data: Mapping[str, Any], head: Sequence[str]) -> str:
    """The YAML of a turbine file's mapping; head: lines of comment at its top."""
    lines = [f"# {line}".rstrip() for line in head]
    for key, value in data.items():
        if value is None:
            continue
        if isinstance(value, Mapping):
            lines += ["", *_section(key, value, 0, ())]
        else:
            lines.append(f"{key}: {_plain(value)}")
    return "\n".join(lines) + "\n"


def airfoils_text(airfoils: Mapping[str, Sequence[Sequence[float]]], head: Sequence[str]) -> str:
    """The YAML of polars: rows of angle of attack [deg], lift and drag coefficient, as blocks of text, which read fast."""
    lines = [f"# {line}".rstrip() for line in head]
    lines += ["", "columns: [angle_of_attack_deg, lift, drag]", "airfoils:"]
    for name, rows in airfoils.items():
        lines.append(f"  {_plain(name)}: |")
        lines += [f"    {' '.join(f'{v:.10g}' for v in row)}" for row in rows]
    return "\n".join(lines) + "\n"


def _section(key: str, value: Mapping[str, Any], depth: int, above: tuple[str, ...]) -> Iterator[str]:
    space = "  " * depth
    yield f"{space}{_plain(key)}:"
    for name, entry in value.items():
        path = (*above, key, name)
        if entry is None:
            continue
        if isinstance(entry, Mapping) and {"columns", "rows"} == set(entry):
            yield from _table(name, entry, depth + 1)
        elif isinstance(entry, Mapping):
            yield from _section(name, entry, depth + 1, path[:-1])
        else:
            unit = _UNITS.get(".".join(path[-2:])) or _UNITS.get(name)
            text = f"{space}  {_plain(name)}: {_plain(entry)}"
            yield f"{text}  # {unit}" if unit else text


def _table(name: str, table: Mapping[str, Any], depth: int) -> Iterator[str]:
    space = "  " * depth
    units = ", ".join(_COLUMN_UNITS[column] for column in table["columns"])
    yield f"{space}{name}:"
    yield f"{space}  columns: [{', '.join(table['columns'])}]  # {units}"
    yield f"{space}  rows:"
    for row in table["rows"]:
        yield f"{space}    - [{', '.join(_plain(v) for v in row)}]"


def _plain(value: Any) -> str:
    """A scalar or a list of them in YAML's flow style; text is quoted where YAML could read something else into it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        text = f"{value:.12g}"
        return text if any(c in text for c in ".en") else f"{text}.0"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, Sequence) and not isinstance(value, str):
        if len(value) > 3 and len({repr(v) for v in value}) == 1 and not isinstance(value[0], Sequence):
            return f"[{', '.join([_plain(value[0])] * len(value))}]"
        return f"[{', '.join(_plain(v) for v in value)}]"
    text = " ".join("".join(c if c.isprintable() else " " for c in str(value)).split())
    if text.replace("_", "").replace("-", "").isalnum() and text[0].isalpha() and text.lower() not in _WORDS:
        return text
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


_WORDS = {"true", "false", "yes", "no", "on", "off", "null", "none", "inf", "nan"}
