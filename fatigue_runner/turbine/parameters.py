"""From a turbine file to the scalars that the equations of motion take (`parameter_names.PARAMETERS`)."""

from __future__ import annotations

from collections.abc import Mapping
from math import cos, isfinite, radians, sin
from typing import Any

import numpy as np

from fatigue_runner import shipped
from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.turbine.beam import INTEGRAND_NAMES, BladeModes, TowerModes, blade_modes, tower_modes
from fatigue_runner.turbine.parameter_names import PARAMETERS

DATA = shipped.turbines()

# integrals of the equations by their factors in beam.INTEGRAND_NAMES
_INTEGRALS = {
    "b_m": ("1", "1"), "b_m1": ("1", "r"), "b_m2": ("r", "r"),
    "b_fx": ("1", "phi_x"), "b_fy": ("1", "phi_y"), "b_ex": ("1", "psi_x"), "b_ey": ("1", "psi_y"),
    "b_rfx": ("r", "phi_x"), "b_rfy": ("r", "phi_y"), "b_rex": ("r", "psi_x"), "b_rey": ("r", "psi_y"),
    "b_fxfx": ("phi_x", "phi_x"), "b_fyfy": ("phi_y", "phi_y"), "b_fxfy": ("phi_x", "phi_y"),
    "b_exex": ("psi_x", "psi_x"), "b_eyey": ("psi_y", "psi_y"), "b_exey": ("psi_x", "psi_y"),
    "b_fxex": ("phi_x", "psi_x"), "b_fyey": ("phi_y", "psi_y"),
    "b_fxey": ("phi_x", "psi_y"), "b_fyex": ("phi_y", "psi_x"),
    "b_sff": ("1", "S_ff"), "b_sfe": ("1", "S_fe"), "b_see": ("1", "S_ee"),
    "b_rsff": ("r", "S_ff"), "b_rsfe": ("r", "S_fe"), "b_rsee": ("r", "S_ee"),
}  # fmt: skip

# what a parameter is in a set that was written before it was there; as such it is not in the hash
DEFAULTS = {"g_efficiency": 1.0, "g_rigid": 0.0}

TETHER = 2.0  # rad/s: over-damped, much slower than any step, much faster than rounding errors grow
_FAR = 1e9  # a torque that is never reached [N m]


def equation_parameters(data: Mapping[str, Any]) -> dict[str, float]:
    """`parameter_names.PARAMETERS` at zero pitch from a turbine file's mapping.

    Raises InputError naming the missing or impossible entry.
    """
    try:
        blade, tower = blade_modes(data), tower_modes(data)
        cone, tilt = radians(data["geometry"]["precone_deg"]), radians(data["geometry"]["shaft_tilt_deg"])
        hub, drive, env = data["hub"], data["drivetrain"], data["environment"]
        body = _nacelle(data)
        radius = data["geometry"]["tip_radius"] * cos(cone)
        values = {
            **_blade(blade),
            **_tower(tower),
            **generator_law(data["generator"]),
            "cos_pitch": 1.0, "sin_pitch": 0.0,
            "cos_cone": cos(cone), "sin_cone": sin(cone), "cos_tilt": cos(tilt), "sin_tilt": sin(tilt),
            "h_m": hub["mass"], "h_ixx": hub["inertia"], "h_itt": 0.0,
            "overhang": data["geometry"]["overhang"], "tower_to_shaft": data["geometry"]["tower_top_to_shaft"],
            **body,
            **_drivetrain(drive),
            "gravity": env["gravity"], "radius": radius,
            "q_area": env["air_density"] * np.pi * radius**2 / 2,
        }  # fmt: skip
    except KeyError as missing:
        raise InputError(
            f"turbine {data.get('name', '?')}: the entry {missing} is missing; compare nrel5mw.yaml"
        ) from None
    except (OverflowError, ZeroDivisionError):
        values = {}
    if not values or not all(map(isfinite, values.values())):
        raise InputError(
            f"turbine {data.get('name', '?')}: a value of blade, tower or drivetrain is far too large or too small for numbers to come "
            "out; compare nrel5mw.yaml"
        )
    return checked({k: float(v) for k, v in values.items()})


def checked(values: Mapping[str, float]) -> dict[str, float]:
    """The parameters, complete and finite; raises InputError for a missing, unknown or non-finite one."""
    values = {**DEFAULTS, **values}
    for name in values:
        if name not in PARAMETERS:
            raise InputError(f"turbine parameters: unknown name {name!r}{did_you_mean(name, PARAMETERS)}")
    missing = [name for name in PARAMETERS if name not in values]
    if missing:
        raise InputError(f"turbine parameters: missing {', '.join(missing)}")
    for name, value in values.items():
        if not isfinite(value):
            raise InputError(f"turbine parameters: {name} is {value}, it must be a finite number")
    return {name: float(values[name]) for name in PARAMETERS}


def blade_integrals(integrals: Any) -> dict[str, float]:
    """`parameter_names.BLADE_INTEGRALS` of a blade, or of the part of it that `BladeModes.beyond` gives."""
    place = {name: i for i, name in enumerate(INTEGRAND_NAMES)}
    return {name: float(integrals[place[a], place[b]]) for name, (a, b) in _INTEGRALS.items()}


def _blade(blade: BladeModes) -> dict[str, float]:
    return blade_integrals(blade.integrals) | {
        "b_kf": blade.flap_stiffness, "b_ke": blade.edge_stiffness, "b_kfe": 0.0,
        "b_df": blade.flap_damping, "b_de": blade.edge_damping, "b_root": blade.hub_radius,
        "b_tip_fx": blade.flap_tip[0], "b_tip_fy": blade.flap_tip[1],
        "b_tip_ex": blade.edge_tip[0], "b_tip_ey": blade.edge_tip[1],
    }  # fmt: skip


def _drivetrain(drive: Mapping[str, Any]) -> dict[str, float]:
    """Of a rigid shaft, stiffness and damping only keep the generator's angle from drifting off the rotor's by rounding."""
    inertia, ratio = drive["generator_inertia"], drive["gearbox_ratio"]
    rigid = drive.get("shaft", "flexible") == "rigid"
    low_speed = inertia * ratio**2
    return {
        "g_i": inertia, "g_ratio": ratio, "g_efficiency": drive.get("gearbox_efficiency", 1.0), "g_rigid": float(rigid),
        "d_k": low_speed * TETHER**2 if rigid else drive["torsional_stiffness"],
        "d_d": 4 * low_speed * TETHER if rigid else drive["torsional_damping"],
    }  # fmt: skip


def _nacelle(data: Mapping[str, Any]) -> dict[str, float]:
    """The nacelle as the rigid body of the equations: with the yaw bearing's mass at the tower top, and the hub's where it is off the apex.

    A point on the shaft does not feel the rotor turn. A hub mass at a distance from the apex is therefore one at the apex and, on
    the nacelle, what that leaves of first and second moments.
    """
    nacelle, hub, geometry = data["nacelle"], data["hub"], data["geometry"]
    mass, bearing, off = (
        float(nacelle["mass"]),
        float(nacelle.get("yaw_bearing_mass", 0.0)),
        float(hub.get("centre_of_mass", 0.0)),
    )
    x, y, z = (float(v) for v in nacelle["centre_of_mass"])
    # the report gives the inertia about the yaw axis
    inertia = np.diag([0.0, 0.0, nacelle["yaw_inertia"] - mass * (x * x + y * y)])
    if bearing or off:
        tilt = radians(geometry["shaft_tilt_deg"])
        shaft = np.array([cos(tilt), 0.0, sin(tilt)])
        apex = np.array([0.0, 0.0, geometry["tower_top_to_shaft"]]) + geometry["overhang"] * shaft
        points = [(mass, np.array([x, y, z])), (bearing, np.zeros(3))]
        points += [(hub["mass"], apex + off * shaft), (-hub["mass"], apex)]
        total = mass + bearing
        centre = np.sum([m * at for m, at in points], axis=0) / total
        inertia = inertia + np.diag(np.diag(_second_moment(points) - _second_moment([(total, centre)])))
        mass, (x, y, z) = total, centre
    return {
        "n_m": mass, "n_x": x, "n_y": y, "n_z": z,
        "n_ixx": inertia[0, 0], "n_iyy": inertia[1, 1], "n_izz": inertia[2, 2],
    }  # fmt: skip


def _second_moment(points: list[tuple[float, Any]]) -> Any:
    """Inertia tensor (3, 3) of point masses about the origin."""
    return np.sum([m * (at @ at * np.eye(3) - np.outer(at, at)) for m, at in points], axis=0)


def _tower(tower: TowerModes) -> dict[str, float]:
    out = {"t_h": tower.length}
    for mode, mass, key, short in (
        (tower.fore_aft, "t_maa", "fa", "a"), (tower.side_side, "t_mss", "ss", "s"),
    ):  # fmt: skip
        out |= {
            mass: mode.modal_mass, f"t_{key}": mode.mass_shape, f"t_z{key}": mode.mass_height_shape,
            f"t_slope_{key}": mode.top_slope, f"t_short_{key}": mode.shortening_top,
            f"t_g{key}": mode.mass_shortening, f"t_k{short}": mode.stiffness, f"t_d{short}": mode.damping,
        }  # fmt: skip
    return out


def generator_law(generator: Mapping[str, Any]) -> dict[str, float]:
    """Parameters of the torque law [rad/s, N m, W]; `law: optimal` is k omega^2 at every speed."""
    gain = generator["optimal_gain"]
    law = generator["law"]
    if law == "optimal":
        # the line and the power limit are out of reach, but not so far that rounding swallows the torque
        return {
            "tg_k": gain,
            "tg_a2": 0.0,
            "tg_ws": 0.0,
            "tg_t2": -_FAR,
            "tg_p": 0.0,
            "tg_t": _FAR,
            "tg_e": 0.0,
        }
    if law != "regions":
        raise InputError(f"generator: unknown law {law!r}{did_you_mean(str(law), ('optimal', 'regions'))}")
    r = generator["regions"]
    start = r["region_3_speed_rpm"] * np.pi / 30
    synchronous = start / (1 + r["slip_percent"] / 100)
    power, torque = r.get("rated_mechanical_power") or 0.0, r.get("rated_torque") or 0.0
    # region 2.5 is a line from zero torque at the synchronous speed through the rated power at region 3's first speed
    slope = (power / start + torque) / (start - synchronous)
    return {
        "tg_k": gain, "tg_a2": slope, "tg_ws": synchronous, "tg_t2": 0.0, "tg_p": power, "tg_t": torque,
        "tg_e": r["blend_torque"],
    }  # fmt: skip


def at_pitch(parameters: Mapping[str, float], pitch: float) -> dict[str, float]:
    """The parameters with the blades turned by `pitch` [rad], positive to feather: the modes turn with them.

    Twist and pitch add up, so a displacement (x, y) in coned axes becomes (c x + s y, -s x + c y).
    """
    c, s = cos(pitch), sin(pitch)
    turn = np.array([[c, s], [-s, c]])
    p = dict(parameters)
    for stem in ("b_f", "b_e", "b_rf", "b_re", "b_tip_f", "b_tip_e"):
        p[f"{stem}x"], p[f"{stem}y"] = turn @ [p[f"{stem}x"], p[f"{stem}y"]]
    for a, b in (("f", "f"), ("e", "e"), ("f", "e")):
        names = [[f"b_{a}x{b}x", f"b_{a}x{b}y"], [f"b_{a}y{b}x", f"b_{a}y{b}y"]]
        if a == b:  # symmetric: the equations know only the xy entry
            names[1][0] = names[0][1]
        turned = turn @ np.array([[p[n] for n in row] for row in names]) @ turn.T
        for row, values in zip(names, turned, strict=True):
            p |= dict(zip(row, map(float, values), strict=True))
    return p | {"cos_pitch": c, "sin_pitch": s}
