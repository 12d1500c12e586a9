"""Blade and tower as beams with prescribed mode shapes, as in OpenFAST's ElastoDyn, and their integrals.

A mode shape is a polynomial over the span fraction whose second derivative bends the beam about its local
principal axes. The blade's structural twist turns these axes, so a flap mode also moves the blade in the
rotor plane:

    phi_x'' = phi'' cos(twist)     phi_y'' = -phi'' sin(twist)      flap     x out of plane, downwind
    psi_x'' = psi'' sin(twist)     psi_y'' =  psi'' cos(twist)      edge     y in plane, to the trailing edge

Masses are lumped at the middles of the elements that the data name, because the report's blade mass and
moments are such sums; shapes and stiffnesses are integrated on a fine grid. finite_elements.py checks the
shapes.

Sources: J. Jonkman et al., NREL/TP-500-38060 (2009); J. Jonkman, M. Buhl, FAST User's Guide,
NREL/EL-500-38230 (2005).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from fatigue_runner.errors import InputError

Array = NDArray[np.float64]

# The functions a whose products are integrated over a blade: BladeModes.integrals[i, j] = int m a_i a_j dr.
INTEGRAND_NAMES = ("1", "r", "phi_x", "phi_y", "psi_x", "psi_y", "S_ff", "S_fe", "S_ee")

_FINE_POINTS = 4001  # trapezoids on this grid are exact to about 1e-7 of the integral


def columns(table: Mapping[str, Any]) -> dict[str, Any]:
    """A `columns`/`rows` table of a turbine file as {column: array}; columns of words stay lists."""
    names, rows = table["columns"], table["rows"]
    for number, row in enumerate(rows, start=1):
        if len(row) != len(names):
            raise InputError(
                f"stations, row {number}: {len(row)} values for the {len(names)} columns {names}"
            )
    values = {name: [row[i] for row in rows] for i, name in enumerate(names)}
    return {
        name: column if isinstance(column[0], str) else np.array(column, dtype=float)
        for name, column in values.items()
    }


@dataclass(frozen=True)
class BladeModes:
    """One blade with one flap and one edge mode; r runs from the rotor apex along the pitch axis [m].

    integrals: (9, 9) symmetric, int m a_i a_j dr over the blade for a = INTEGRAND_NAMES [kg, kg.m, ...];
    S_ab(r) is the integral of a'.b' from the root: a point moves inwards by (S_ff qf^2 + 2 S_fe qf qe + S_ee
    qe^2) / 2. stiffness [N/m], damping [N.s/m], modal mass [kg] and frequency [Hz] are those of the single
    untwisted mode at rest; the damping is 2 * ratio * stiffness / (angular frequency), as ElastoDyn has it.
    grid: (n,) r of flap and edge, (n, 2) displacements x, y per unit modal coordinate, and of their slopes.
    """

    hub_radius: float
    tip_radius: float
    integrals: Array
    flap_modal_mass: float
    flap_stiffness: float
    flap_damping: float
    flap_frequency: float
    edge_modal_mass: float
    edge_stiffness: float
    edge_damping: float
    edge_frequency: float
    grid: Array
    flap: Array
    edge: Array
    flap_slope: Array
    edge_slope: Array
    shortening: Array  # (n, 3) S_ff, S_fe, S_ee
    elements: tuple[Array, Array]  # (k,) masses [kg], (k, 9) INTEGRAND_NAMES at their middles

    def beyond(self, radius: float) -> Array:
        """`integrals` over the part of the blade beyond r = `radius` [m], element by element."""
        masses, a = self.elements
        outer = a[:, INTEGRAND_NAMES.index("r")] > radius
        found = np.einsum("n,ni,nj->ij", masses[outer], a[outer], a[outer])
        return (found + found.T) / 2

    @property
    def mass(self) -> float:
        """Mass of the blade [kg]."""
        return float(self.integrals[0, 0])

    @property
    def first_moment(self) -> float:
        """First moment of mass about the blade root [kg.m]."""
        return float(self.integrals[0, 1] - self.hub_radius * self.mass)

    @property
    def second_moment(self) -> float:
        """Second moment of mass about the blade root [kg.m2]."""
        h = self.hub_radius
        return float(self.integrals[1, 1] - 2 * h * self.integrals[0, 1] + h * h * self.mass)

    def flap_at(self, radius: Array) -> Array:
        """Flap displacement (phi_x, phi_y) at `radius` [m], shape (..., 2); zero inside the root."""
        return _interpolate(radius, self.grid, self.flap)

    def edge_at(self, radius: Array) -> Array:
        """Edge displacement (psi_x, psi_y) at `radius` [m], shape (..., 2); zero inside the root."""
        return _interpolate(radius, self.grid, self.edge)

    @property
    def flap_tip(self) -> Array:
        """(phi_x, phi_y) at the tip."""
        return self.flap[-1]

    @property
    def edge_tip(self) -> Array:
        """(psi_x, psi_y) at the tip."""
        return self.edge[-1]


def blade_modes(parameters: Mapping[str, Any]) -> BladeModes:
    """Blade modes of a turbine file (`geometry`, `blade`). Raises InputError for data that make no beam."""
    hub, tip = float(parameters["geometry"]["hub_radius"]), float(parameters["geometry"]["tip_radius"])
    if not 0 <= hub < tip:
        raise InputError(f"geometry: hub_radius {hub} must be at least 0 and below tip_radius {tip}")
    length, blade = tip - hub, parameters["blade"]
    stations = stations_of(blade, "span_fraction", "blade: stations")
    x = np.linspace(0.0, 1.0, _FINE_POINTS)
    z = x * length
    twist = np.radians(np.interp(x, stations["span_fraction"], stations["structural_twist_deg"]))
    curve = {
        n: mode_shape(blade[f"{n}_mode"], f"blade: {n}_mode").deriv(2)(x) / length**2
        for n in ("flap", "edge")
    }
    bent = {
        "flap": curve["flap"][:, None] * np.column_stack([np.cos(twist), -np.sin(twist)]),
        "edge": curve["edge"][:, None] * np.column_stack([np.sin(twist), np.cos(twist)]),
    }
    slope = {name: _cumulative(bent[name], z) for name in bent}
    shape = {name: _cumulative(slope[name], z) for name in bent}
    pairs = (("flap", "flap"), ("flap", "edge"), ("edge", "edge"))
    shortening = _cumulative(np.column_stack([(slope[a] * slope[b]).sum(axis=1) for a, b in pairs]), z)
    nodes, masses = _lumped(
        blade["mass_element_lengths"], length, stations, "span_fraction", blade["mass_factor"]
    )
    if blade.get("tip_mass"):
        nodes, masses = np.append(nodes, length), np.append(masses, float(blade["tip_mass"]))
    a = np.column_stack(
        [
            np.ones_like(nodes),
            hub + nodes,
            *(_interpolate(nodes, z, values) for values in (shape["flap"], shape["edge"], shortening)),
        ]
    )
    integrals = np.einsum("n,ni,nj->ij", masses, a, a)
    single = {
        name: _single_mode(
            blade[f"{name}_mode"],
            length,
            (nodes, masses),
            blade[f"{name}_stiffness_factor"]
            * np.interp(x, stations["span_fraction"], stations[f"{name}_stiffness"]),
            blade[f"{name}_damping_ratio"],
        )
        for name in ("flap", "edge")
    }
    return BladeModes(
        hub_radius=hub,
        tip_radius=tip,
        integrals=(integrals + integrals.T) / 2,
        grid=hub + z,
        flap=shape["flap"],
        edge=shape["edge"],
        flap_slope=slope["flap"],
        edge_slope=slope["edge"],
        shortening=shortening,
        elements=(masses, a),
        **{f"{name}_{key}": value for name, mode in single.items() for key, value in mode.items()},
    )


@dataclass(frozen=True)
class TowerMode:
    """One bending mode of the tower, unit displacement at its top; z runs up from the tower base [m].

    Of the tower alone: modal_mass int m phi^2 dz, mass_shape int m phi dz [kg], mass_height_shape int m z
    phi dz [kg.m]; stiffness [N/m], damping [N.s/m] and frequency [Hz] without the mass on its top, as
    ElastoDyn has them. top_slope phi'(H) [1/m]; shortening_top S(H), S(z) = int_0^z phi'^2 [1/m] (a point
    sinks by S q^2 / 2); mass_shortening int m S dz [kg/m].
    """

    polynomial: Polynomial
    length: float
    modal_mass: float
    mass_shape: float
    mass_height_shape: float
    stiffness: float
    damping: float
    frequency: float
    top_slope: float
    shortening_top: float
    mass_shortening: float

    def shape_at(self, height: Array) -> Array:
        """phi(z), 1 at the top; height [m] above the tower base."""
        return self.polynomial(np.asarray(height) / self.length)

    def shortening_at(self, height: float) -> float:
        """S(z) [1/m]; height [m] above the tower base."""
        x = np.linspace(0.0, height / self.length, _FINE_POINTS)
        slope = self.polynomial.deriv()(x) / self.length
        return float(np.trapezoid(slope**2, x * self.length))

    def slope_at(self, height: Array) -> Array:
        """phi'(z) [1/m]; height [m] above the tower base."""
        return self.polynomial.deriv()(np.asarray(height) / self.length) / self.length


@dataclass(frozen=True)
class TowerModes:
    """The tower: length [m], mass [kg], first moment int m z dz about its base [kg.m], and its two modes."""

    length: float
    mass: float
    first_moment: float
    fore_aft: TowerMode
    side_side: TowerMode
    elements: tuple[Array, Array]  # (k,) heights of the middles [m], masses [kg]


def tower_modes(parameters: Mapping[str, Any]) -> TowerModes:
    """Tower modes of a turbine file (`geometry`, `tower`). Raises InputError for data that make no beam."""
    geometry, tower = parameters["geometry"], parameters["tower"]
    length = float(geometry["tower_height"]) - float(geometry["tower_base_height"])
    if length <= 0:
        raise InputError("geometry: tower_height must be above tower_base_height")
    stations = stations_of(tower, "height_fraction", "tower: stations")
    elements = np.ones(int(tower["mass_elements"]))
    lumped = _lumped(elements, length, stations, "height_fraction", tower["mass_factor"])
    modes = {name: _tower_mode(tower, name, length, stations, lumped) for name in ("fore_aft", "side_side")}
    nodes, masses = lumped
    return TowerModes(
        length=length, mass=float(masses.sum()), first_moment=float(masses @ nodes), elements=lumped, **modes
    )


def _tower_mode(
    tower: Mapping[str, Any],
    name: str,
    length: float,
    stations: dict[str, Array],
    lumped: tuple[Array, Array],
) -> TowerMode:
    x = np.linspace(0.0, 1.0, _FINE_POINTS)
    nodes, masses = lumped
    polynomial = mode_shape(tower[f"{name}_mode"], f"tower: {name}_mode")
    stiffness = np.interp(x, stations["height_fraction"], stations[f"{name}_stiffness"])
    phi, slope = polynomial(nodes / length), polynomial.deriv()(x) / length
    shortening = _cumulative(slope[:, None] ** 2, x * length)[:, 0]
    return TowerMode(
        polynomial=polynomial,
        length=length,
        mass_shape=float(masses @ phi),
        mass_height_shape=float(masses @ (nodes * phi)),
        top_slope=float(slope[-1]),
        shortening_top=float(shortening[-1]),
        mass_shortening=float(masses @ np.interp(nodes, x * length, shortening)),
        **_single_mode(
            tower[f"{name}_mode"],
            length,
            lumped,
            tower[f"{name}_stiffness_factor"] * stiffness,
            tower[f"{name}_damping_ratio"],
        ),
    )


def _single_mode(
    coefficients: Any, length: float, lumped: tuple[Array, Array], stiffness: Array, ratio: float
) -> dict[str, float]:
    """Modal mass, stiffness, damping and frequency [Hz] of one mode alone, without centrifugal stiffening."""
    polynomial = mode_shape(coefficients, "mode")
    nodes, masses = lumped
    x = np.linspace(0.0, 1.0, len(stiffness))
    modal_mass = float(masses @ polynomial(nodes / length) ** 2)
    work = stiffness * polynomial.deriv(2)(x) ** 2 / length**4
    k = float(_cumulative(work[:, None], x * length)[-1, 0])
    omega = np.sqrt(k / modal_mass)
    return {
        "modal_mass": modal_mass,
        "stiffness": k,
        "damping": float(2 * ratio * k / omega),
        "frequency": float(omega / (2 * np.pi)),
    }


def mode_shape(coefficients: Any, place: str) -> Polynomial:
    """The mode shape over the span fraction from its coefficients of x^2, x^3, ...; 1 at the free end."""
    values = np.array(coefficients, dtype=float)
    if not abs(values.sum() - 1.0) <= 1e-3:
        raise InputError(
            f"{place}: the coefficients must add up to 1 (unit displacement at the end), got {values.sum():g}"
        )
    return Polynomial([0.0, 0.0, *values])


def stations_of(member: Mapping[str, Any], fraction: str, place: str) -> dict[str, Any]:
    """The stations' columns of a blade or tower. Raises InputError where they do not run from end to end, or have no mass or stiffness."""
    stations = columns(member["stations"])
    x = stations[fraction]
    if not (x[0] == 0.0 and x[-1] == 1.0 and np.all(np.diff(x) > 0)):
        raise InputError(f"{place}: {fraction} must rise from 0 to 1")
    for name, column in stations.items():
        if name.endswith(("density", "stiffness")) and not np.all(column > 0):
            raise InputError(f"{place}: {name} must be positive")
    return stations


def _lumped(
    lengths: Any, length: float, stations: dict[str, Array], fraction: str, factor: float
) -> tuple[Array, Array]:
    """Middles [m] and masses [kg] of elements with these relative lengths."""
    sizes = np.array(lengths, dtype=float)
    sizes *= length / sizes.sum()
    nodes = np.cumsum(sizes) - sizes / 2
    return nodes, factor * sizes * np.interp(nodes / length, stations[fraction], stations["mass_density"])


def _cumulative(values: Array, z: Array) -> Array:
    """Integral of each column from the first point on, by trapezoids."""
    steps = np.diff(z)[:, None] * (values[1:] + values[:-1]) / 2
    return np.vstack([np.zeros((1, values.shape[1])), np.cumsum(steps, axis=0)])


def _interpolate(at: Array, grid: Array, values: Array) -> Array:
    at = np.asarray(at, dtype=float)
    return np.stack([np.interp(at, grid, values[:, j]) for j in range(values.shape[1])], axis=-1)
