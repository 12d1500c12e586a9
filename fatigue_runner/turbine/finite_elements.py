"""An Euler-Bernoulli finite-element beam, to check the prescribed mode shapes of beam.py by another road.

Cubic Hermite elements, two bending planes coupled by the twist of the principal axes, consistent mass, axial
tension, and a rigid body on the free end. Source: K.-J. Bathe, "Finite Element Procedures" (1996), sections
4.2 and 6.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.turbine.beam import columns

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Beam:
    """Distributed properties at stations, linear in between.

    position (n,) [m] from the clamped end, mass_density (n,) [kg/m], stiffness (n, 2) [N.m2] of the two
    planes, twist (n,) [rad]: the first plane moves the beam along (cos, -sin) in (x, y), the second along
    (sin, cos); tension (n,) [N] (negative: compression). The body on the free end: mass [kg], height of its
    centre beyond the end [m], and inertia about its centre [kg.m2] for bending in each of the two planes.
    """

    position: Array
    mass_density: Array
    stiffness: Array
    twist: Array
    tension: Array
    end_mass: float = 0.0
    end_height: float = 0.0
    end_inertia: tuple[float, float] = (0.0, 0.0)


def clamped_frequencies(beam: Beam, count: int = 4, elements: int = 100) -> tuple[Array, Array]:
    """Lowest natural frequencies of the clamped beam and where its free end goes.

    Returns frequencies (count,) [Hz] and end displacements (count, 2) in planes x and y, of unit length.
    """
    frequencies, vectors = _clamped_modes(beam, count, elements)
    ends = vectors[[-4, -2], :].T
    return frequencies, ends / np.linalg.norm(ends, axis=1, keepdims=True)


def _clamped_modes(beam: Beam, count: int, elements: int) -> tuple[Array, Array]:
    """Frequencies (count,) [Hz] and shapes (4 (elements + 1), count): u, u', v, v' at every node."""
    from scipy.linalg import eigh

    nodes = np.linspace(beam.position[0], beam.position[-1], elements + 1)
    size = 4 * (elements + 1)  # per node: u, u', v, v'
    mass, stiff = np.zeros((size, size)), np.zeros((size, size))
    for e in range(elements):
        m, k = _element(beam, nodes[e], nodes[e + 1])
        block = slice(4 * e, 4 * e + 8)
        mass[block, block] += m
        stiff[block, block] += k
    h = beam.end_height
    for plane, inertia in enumerate(beam.end_inertia):
        tip = np.arange(size - 4 + 2 * plane, size - 2 + 2 * plane)
        body = beam.end_mass * np.array([[1.0, h], [h, h * h]]) + np.diag([0.0, inertia])
        mass[np.ix_(tip, tip)] += body
        # The weight or pull at the end acts at the body's centre: it follows the slope over the height h.
        stiff[tip[1], tip[1]] += beam.tension[-1] * h
    squares, vectors = eigh(stiff[4:, 4:], mass[4:, 4:], subset_by_index=[0, count - 1])
    clamped = np.zeros((4, count))
    return np.sqrt(squares) / (2 * np.pi), np.concatenate([clamped, vectors])


def _element(beam: Beam, start: float, end: float) -> tuple[Array, Array]:
    """Mass and stiffness (8, 8) of one element with freedoms u, u', v, v' at both ends; 4-point Gauss."""
    length = end - start
    points, weights = np.polynomial.legendre.leggauss(4)
    mass, stiff = np.zeros((8, 8)), np.zeros((8, 8))
    planes = (np.array([0, 1, 4, 5]), np.array([2, 3, 6, 7]))
    for s, w in zip((points + 1) / 2, weights * length / 2, strict=True):
        z = start + s * length
        shape = np.array(
            [
                1 - 3 * s**2 + 2 * s**3,
                length * (s - 2 * s**2 + s**3),
                3 * s**2 - 2 * s**3,
                length * (s**3 - s**2),
            ]
        )
        slope = np.array(
            [6 * s**2 - 6 * s, length * (1 - 4 * s + 3 * s**2), 6 * s - 6 * s**2, length * (3 * s**2 - 2 * s)]
        )
        curve = np.array([-6 + 12 * s, length * (6 * s - 4), 6 - 12 * s, length * (6 * s - 2)]) / length**2
        m, tension, twist = (
            np.interp(z, beam.position, values) for values in (beam.mass_density, beam.tension, beam.twist)
        )
        principal = np.diag([np.interp(z, beam.position, beam.stiffness[:, j]) for j in range(2)])
        turn = np.array([[np.cos(twist), np.sin(twist)], [-np.sin(twist), np.cos(twist)]])
        bending = turn @ principal @ turn.T
        slope /= length
        for i in range(2):
            rows = np.ix_(planes[i], planes[i])
            mass[rows] += w * m * np.outer(shape, shape)
            stiff[rows] += w * tension * np.outer(slope, slope)
            for j in range(2):
                stiff[np.ix_(planes[i], planes[j])] += w * bending[i, j] * np.outer(curve, curve)
    return mass, stiff


def blade_beam(parameters: Mapping[str, Any], rotor_speed: float = 0.0) -> Beam:
    """The blade of a turbine file, stretched by the centrifugal force at `rotor_speed` [rad/s].

    Plane x is out of the rotor plane, y in it; principal planes flap and edge. Spin softening is left out.
    """
    geometry, blade = parameters["geometry"], parameters["blade"]
    table = columns(blade["stations"])
    length = geometry["tip_radius"] - geometry["hub_radius"]
    position = table["span_fraction"] * length
    density = blade["mass_factor"] * table["mass_density"]
    pull = density * (geometry["hub_radius"] + position) * rotor_speed**2
    return Beam(
        position=position,
        mass_density=density,
        stiffness=np.column_stack(
            [blade[f"{name}_stiffness_factor"] * table[f"{name}_stiffness"] for name in ("flap", "edge")]
        ),
        twist=np.radians(table["structural_twist_deg"]),
        tension=_beyond(pull, position),
    )


def tower_beam(
    parameters: Mapping[str, Any],
    top_mass: float = 0.0,
    top_height: float = 0.0,
    top_inertia: tuple[float, float] = (0.0, 0.0),
    gravity: float = 0.0,
) -> Beam:
    """The tower of a turbine file under its weight and that of a body on its top; x is fore-aft, y side-side.

    top_mass [kg] with its centre top_height [m] above the tower top and top_inertia [kg.m2] about that centre
    for fore-aft and side-side bending; gravity [m/s2], 0: no softening by weight.
    """
    geometry, tower = parameters["geometry"], parameters["tower"]
    table = columns(tower["stations"])
    position = table["height_fraction"] * (geometry["tower_height"] - geometry["tower_base_height"])
    density = tower["mass_factor"] * table["mass_density"]
    return Beam(
        position=position,
        mass_density=density,
        stiffness=np.column_stack(
            [
                tower[f"{name}_stiffness_factor"] * table[f"{name}_stiffness"]
                for name in ("fore_aft", "side_side")
            ]
        ),
        twist=np.zeros_like(position),
        tension=-gravity * (top_mass + _beyond(density, position)),
        end_mass=top_mass,
        end_height=top_height,
        end_inertia=top_inertia,
    )


def _beyond(density: Array, position: Array) -> Array:
    """Integral of a station-wise linear density from each station to the free end."""
    pieces = np.diff(position) * (density[1:] + density[:-1]) / 2
    return np.concatenate([np.cumsum(pieces[::-1])[::-1], [0.0]])


POWERS = np.arange(2, 7)  # of the span fraction in a mode's polynomial, as in ElastoDyn's files


def first_mode(beam: Beam, plane: int) -> tuple[float, list[float]]:
    """Frequency [Hz] and polynomial (coefficients of x^2 .. x^6 that add up to 1) of the first bending mode in a plane, 0 or 1.

    The beam is taken as untwisted, for that is what the polynomial bends about.
    """
    straight = replace(beam, twist=np.zeros_like(beam.twist))
    frequencies, vectors = _clamped_modes(straight, 8, 100)
    shapes = vectors.reshape(101, 2, 2, -1)  # node, plane, value and slope
    share = np.abs(shapes[-1, plane, 0]) / np.linalg.norm(shapes[-1, :, 0], axis=0)
    chosen = int(np.argmax(share > 0.99))
    length = beam.position[-1] - beam.position[0]
    value, slope = shapes[:, plane, 0, chosen], shapes[:, plane, 1, chosen] * length
    x = np.linspace(0.0, 1.0, 101)[:, None]
    # the slope with it: a mode's stiffness comes from its curvature
    rows = np.concatenate([x**POWERS, 0.3 * POWERS * x ** (POWERS - 1)])
    right = np.concatenate([value, 0.3 * slope]) / value[-1]
    coefficients = np.linalg.lstsq(rows, right, rcond=None)[0]
    coefficients /= coefficients.sum()
    return float(frequencies[chosen]), [round(float(c), 6) for c in coefficients]


def rotor_nacelle_mass(parameters: Mapping[str, Any]) -> float:
    """What stands on the tower [kg]."""
    hub, nacelle, blade = (parameters[key] for key in ("hub", "nacelle", "blade"))
    table = columns(blade["stations"])
    length = parameters["geometry"]["tip_radius"] - parameters["geometry"]["hub_radius"]
    one = blade["mass_factor"] * np.trapezoid(table["mass_density"], table["span_fraction"]) * length
    one += blade.get("tip_mass", 0.0)
    return float(hub["mass"] + nacelle["mass"] + nacelle.get("yaw_bearing_mass", 0.0) + 3 * one)


def with_modes(data: Mapping[str, Any]) -> dict[str, Any]:
    """A turbine file's mapping with the modes that it does not give: of the clamped beam, the tower with the mass on its top."""
    out = dict(data)
    for member, names in (("blade", ("flap", "edge")), ("tower", ("fore_aft", "side_side"))):
        missing = [name for name in names if data[member].get(f"{name}_mode") is None]
        if not missing:
            continue
        beam = blade_beam(data) if member == "blade" else tower_beam(data, rotor_nacelle_mass(data))
        modes = {f"{name}_mode": first_mode(beam, names.index(name))[1] for name in missing}
        out[member] = {**data[member], **modes}
    return out
