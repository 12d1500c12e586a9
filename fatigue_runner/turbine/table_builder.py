"""The coefficient tables that the simulation reads: six loads of a blade and their derivatives.

Every load is linear in the perturbations that rotor_loads describes: X + kappa X_kappa + y X_y + f X_flap +
e X_edge. The derivatives are central differences whose steps turn the flow at the tip by about half a
degree, as gusts, tilt and vibration do, so that a kink of stall becomes the slope across it. Above tip-speed
ratio 7 the derivatives with a tenth of these steps differ by less than 4 % of the largest.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.errors import InputError
from fatigue_runner.inputs.section import validated
from fatigue_runner.inputs.source import read_mapping
from fatigue_runner.turbine.aerodynamics import (
    LOAD_NAMES,
    STEPS,
    BladeAerodynamics,
    blade_aerodynamics,
    loads_beyond,
)
from fatigue_runner.turbine.beam import blade_modes
from fatigue_runner.turbine.file import AirfoilFile
from fatigue_runner.turbine.span_weight import span_weight

Array = NDArray[np.float64]

IN_PLANE = ("y", "edge")


def perturbations(skewed_wake: bool) -> tuple[str, ...]:
    """The derivatives that a turbine's tables hold; `aerodynamics: skewed_wake` of the turbine file."""
    return tuple(name for name in STEPS if skewed_wake or name != "skew")


def table_names(skewed_wake: bool) -> tuple[str, ...]:
    """Each load, then its derivatives."""
    suffixes = ("", *(f"_{step}" for step in perturbations(skewed_wake)))
    return tuple(name + suffix for name in LOAD_NAMES for suffix in suffixes)


TIP_SPEED_RATIO = np.linspace(0.5, 15.0, 117)
PITCH_DEG = np.concatenate([np.arange(-5.0, 10.0, 0.5), np.arange(10.0, 30.5, 1.0)])

_FORMAT = 1  # raise when the method changes, so that tables made before are known to be old


def load_coefficients(
    blade: BladeAerodynamics, tip_speed_ratio: Array, pitch: Array, skewed_wake: bool = True
) -> Array:
    """Loads and derivatives (k, ...) in the order of `table_names`; the arguments broadcast, pitch in rad."""
    return coefficients_beyond(blade, (blade.weights,), tip_speed_ratio, pitch, skewed_wake)[0]


def coefficients_beyond(
    blade: BladeAerodynamics,
    weights: Sequence[Array],
    tip_speed_ratio: Array,
    pitch: Array,
    skewed_wake: bool = True,
) -> Array:
    """The same of parts of the blade by their `weights`, (parts, k, ...)."""
    rows = [loads_beyond(blade, weights, tip_speed_ratio, pitch)]
    for name in perturbations(skewed_wake):
        size = STEPS[name]
        step = size * (tip_speed_ratio if name in IN_PLANE else np.ones_like(tip_speed_ratio))
        above, below = (
            loads_beyond(blade, weights, tip_speed_ratio, pitch, **{name: s}) for s in (step, -step)
        )
        rows.append((above - below) / (2 * step))
    return np.stack(rows, axis=2).reshape(len(weights), len(rows) * len(LOAD_NAMES), *rows[0].shape[2:])


def build_tables(
    blade: BladeAerodynamics,
    skewed_wake: bool = True,
    tip_speed_ratio: Array = TIP_SPEED_RATIO,
    pitch_deg: Array = PITCH_DEG,
    *,
    told: Callable[[float], None] = lambda share: None,
) -> Array:
    """Coefficients (m, n, k) of `table_names` over tip-speed ratios (n,) and pitch angles (k,) [deg]; told: gets the share that is done."""
    columns = []
    for number, pitch in enumerate(pitch_deg):
        told(number / len(pitch_deg))
        columns.append(load_coefficients(blade, tip_speed_ratio, np.radians(pitch), skewed_wake))
    return np.stack(columns, axis=-1)


def has_skewed_wake(parameters: Mapping[str, Any]) -> bool:
    """Whether the turbine file asks for the skewed wake; without the key it has one."""
    return bool(parameters["aerodynamics"].get("skewed_wake", True))


def turbine_blade(parameters: Mapping[str, Any]) -> tuple[BladeAerodynamics, str]:
    """The blade of a mapping from parameters.read_turbine_file, and the hash of what its tables depend on."""
    airfoils = _airfoils(parameters)
    blade = blade_aerodynamics(parameters, airfoils, blade_modes(parameters))
    return blade, inputs_hash(parameters, airfoils)


def turbine_inputs(parameters: Mapping[str, Any]) -> str:
    """The hash of what the tables of a turbine file's mapping depend on."""
    return inputs_hash(parameters, _airfoils(parameters))


@lru_cache(maxsize=8)
def _read_airfoils(path: str) -> Mapping[str, Any]:
    source = read_mapping(Path(path), "polar file", "columns, airfoils")
    rows = validated(AirfoilFile, source).airfoils
    # lists as they stand in the file: the tables' hash knows a whole number from another
    given = source.data["airfoils"]
    return dict(source.data) | {
        "airfoils": {k: rows[k] if isinstance(v, str) else v for k, v in given.items()}
    }


def _airfoils(parameters: Mapping[str, Any]) -> Mapping[str, Any]:
    path = str(parameters["aerodynamics"]["airfoils"])
    if not Path(path).is_file():
        raise InputError(f"airfoil file {path} does not exist; aerodynamics: airfoils names it")
    return _read_airfoils(path)


def inputs_hash(parameters: Mapping[str, Any], airfoils: Mapping[str, Any]) -> str:
    """SHA-256 of everything that the tables of a turbine depend on, method and grid included."""
    geometry, blade, aerodynamics = (parameters[k] for k in ("geometry", "blade", "aerodynamics"))
    inputs = {
        "format": _FORMAT,
        "steps": STEPS,
        "grid": [TIP_SPEED_RATIO.tolist(), PITCH_DEG.tolist()],
        "geometry": {k: geometry[k] for k in ("blades", "hub_radius", "tip_radius", "precone_deg")},
        "shapes": [blade["flap_mode"], blade["edge_mode"], blade["stations"]],
        "aerodynamics": {
            k: v for k, v in aerodynamics.items() if k not in ("tables", "airfoils", "interpolation")
        },
        "airfoils": airfoils["airfoils"],
    }
    return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()


def best_weight(blade: BladeAerodynamics, coefficients: Array) -> Array:
    """(2, n) `span_weight` where the rotor takes most power; over the operating range that moves its loads by 1.6 % at most."""
    names = next(n for n in (table_names(True), table_names(False)) if len(n) == len(coefficients))
    power = coefficients[names.index("torque")] * TIP_SPEED_RATIO[:, None]
    i, j = np.unravel_index(np.argmax(power), power.shape)
    return np.stack(span_weight(blade, float(TIP_SPEED_RATIO[i]), float(np.radians(PITCH_DEG[j]))))


def write_tables(path: Path, coefficients: Array, inputs: str, weight: Array) -> None:
    """Write an npz: names (m,), tip_speed_ratio (n,), pitch (k,) [rad], coefficients (m, n, k), inputs, span_weight (2, n)."""
    names = next(n for n in (table_names(True), table_names(False)) if len(n) == len(coefficients))
    np.savez_compressed(
        path,
        names=np.array(names),
        tip_speed_ratio=TIP_SPEED_RATIO,
        pitch=np.radians(PITCH_DEG),
        coefficients=coefficients,
        inputs=np.array(inputs),
        span_weight=weight,
    )


def make_tables(name: str) -> Path:
    """Make the tables of a turbine file where it says that they are; returns the path.

    Raises InputError for a shipped turbine, whose tables belong to the program.
    """
    from fatigue_runner.turbine.file import read_turbine_file
    from fatigue_runner.turbine.parameters import DATA

    parameters = read_turbine_file(name)
    if "airfoils" not in parameters["aerodynamics"]:
        raise InputError(
            f"turbine {name}: tables are made from `aerodynamics: airfoils:`, which is not given"
        )
    path = Path(str(parameters["aerodynamics"]["tables"]))
    if path.parent == DATA:
        raise InputError(
            f"turbine {name}: its tables are the shipped {path.name}; give your own file as `aerodynamics: tables:`"
        )
    blade, inputs = turbine_blade(parameters)
    coefficients = build_tables(blade, has_skewed_wake(parameters))
    write_tables(path, coefficients, inputs, best_weight(blade, coefficients))
    return path
