"""Skins of the parts: which points around a beam's axis make its surface, and which triangles join them.

Chords and twists are the turbine file's; what it does not say (thickness of the sections, diameters of tower and hub, size of the
nacelle) is drawn as on a machine of this size and carries no information.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.turbine.beam import columns
from fatigue_runner.viewer.scene import Geometry, Pose

Array = NDArray[np.float64]
Triangles = NDArray[np.uint32]

# A section's outline from the leading edge over the downwind side: fraction of the chord, and of the thickness.
_AIRFOIL = np.array([[0.0, 0.0], [0.25, -0.5], [0.7, -0.28], [1.0, 0.0], [0.7, 0.28], [0.25, 0.5]])
_CIRCLE = np.array([[(1 - np.cos(t)) / 2, -np.sin(t) / 2] for t in np.arange(6) * pi / 3])
_STATIONS = 14  # along the drawn blade
_TOWER_SIDES = 10


@dataclass(frozen=True)
class BladeSkin:
    """radius (m,): distances from the apex [m]; outline (m, 6, 2): points of the sections along e1, e2 at zero pitch [m]."""

    radius: Array
    outline: Array

    def triangles(self) -> Triangles:
        """Of one blade's (m * 6) vertices."""
        return tube_triangles(len(self.radius), self.outline.shape[1])

    def vertices(self, pose: Pose) -> NDArray[np.float32]:
        """(n, 3, m * 6, 3) of the blades of a pose that was made at `radius`."""
        # the sections turn with the pitch about the span: their axes do
        c, s = (f(pose.pitch)[:, None, None] for f in (np.cos, np.sin))
        across, along = pose.coned[..., 0], pose.coned[..., 1]
        e1, e2 = c * across - s * along, s * across + c * along
        around = (
            self.outline[None, None, :, :, 0, None] * e1[:, :, None, None]
            + self.outline[None, None, :, :, 1, None] * e2[:, :, None, None]
        )
        points = pose.blades[:, :, :, None] + around
        return points.reshape(*points.shape[:2], -1, 3).astype(np.float32)


def blade_skin(turbine: Mapping[str, Any], geometry: Geometry) -> BladeSkin:
    """Sections of the turbine file's blade, or a slender wedge where it has no aerodynamic stations."""
    hub, tip = geometry.blade.hub_radius, geometry.blade.tip_radius
    # closer together at the tip, where the blade bends and narrows
    x = np.sin(np.linspace(0.0, pi / 2, _STATIONS)) ** 1.15
    radius = hub + x * (tip - hub)
    stations = turbine.get("aerodynamics", {}).get("stations")
    if stations:
        table = columns(stations)
        span = table["span"] / table["span"][-1]
        chord, twist = (np.interp(x, span, table[name]) for name in ("chord", "twist_deg"))
        names = [str(name) for name in table["airfoil"]]
        round_part = np.interp(x, span, [name.startswith("cylinder") for name in names])
    else:
        chord, twist, round_part = 4.0 - 2.8 * x, 13.0 * (1 - x), (x < 0.08).astype(float)
    chord[-1] *= 0.35
    thickness = np.interp(x, [0.15, 0.4, 0.7, 1.0], [0.40, 0.27, 0.18, 0.16])
    along = round_part[:, None] * (_CIRCLE[:, 0] - 0.5) + (1 - round_part[:, None]) * (_AIRFOIL[:, 0] - 0.3)
    across = (
        round_part[:, None] * _CIRCLE[:, 1] + (1 - round_part[:, None]) * thickness[:, None] * _AIRFOIL[:, 1]
    )
    angle = np.radians(twist)
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    # The chord points to the trailing edge: (sin, cos) along e1, e2, so that twist turns the leading edge upwind.
    outline = np.stack([along * s - across * c, along * c + across * s], axis=-1) * chord[:, None, None]
    return BladeSkin(radius, outline)


def tower_vertices(pose: Pose) -> NDArray[np.float32]:
    """(n, levels * sides, 3): a tapering tube around the bent axis, 6 m at the foot and 3.9 m at the top."""
    levels = pose.tower.shape[1]
    half = np.linspace(3.0, 1.95, levels)
    angle = np.arange(_TOWER_SIDES) * 2 * pi / _TOWER_SIDES
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    points = pose.tower[:, :, None] + half[:, None, None] * ring
    return points.reshape(len(points), -1, 3).astype(np.float32)


def tower_triangles(levels: int) -> Triangles:
    """Of the vertices of `tower_vertices`."""
    return tube_triangles(levels, _TOWER_SIDES)


def tube_triangles(rings: int, sides: int) -> Triangles:
    """Triangles between rings of equally many vertices, and a lid at the last ring."""
    faces = []
    for i in range(rings - 1):
        for j in range(sides):
            a, b = i * sides + j, i * sides + (j + 1) % sides
            faces += [(a, b, b + sides), (a, b + sides, a + sides)]
    last = (rings - 1) * sides
    faces += [(last, last + j, last + j + 1) for j in range(1, sides - 1)]
    return np.array(faces, np.uint32)


def revolved(x: Array, radius: Array, sides: int = 20) -> tuple[NDArray[np.float32], Triangles]:
    """A surface of revolution about the x axis through the points (x, radius) [m]."""
    angle = np.arange(sides) * 2 * pi / sides
    ring = np.stack([0 * angle, np.cos(angle), np.sin(angle)], axis=-1)
    points = radius[:, None, None] * ring
    points[..., 0] = x[:, None]
    return points.reshape(-1, 3).astype(np.float32), tube_triangles(len(x), sides)


def hub_skin(geometry: Geometry) -> tuple[NDArray[np.float32], Triangles]:
    """Spinner around the apex, in frame F: rounded upwind, flat towards the nacelle."""
    r = geometry.blade.hub_radius + 0.4
    t = np.linspace(0.0, pi / 2, 7)
    x = np.concatenate([-1.5 * r * np.cos(t) - 0.2, [r, r]])
    return revolved(x, np.concatenate([r * np.sin(t), [r * 0.95, 0.01]]))


def nacelle_skin(geometry: Geometry) -> tuple[NDArray[np.float32], Triangles]:
    """A rounded box from behind the hub over the tower, in frame N with the tower top as origin."""
    front = min(geometry.overhang + geometry.blade.hub_radius + 0.5, -2.0)
    height = geometry.tower_to_shaft
    x = np.array([front, front, front + 1.5, 9.0, 11.5, 11.5])
    half = np.array([0.01, 1.7, 2.1, 2.3, 1.8, 0.01])
    sides = 12
    angle = (np.arange(sides) + 0.5) * 2 * pi / sides
    # a superellipse: flat sides, rounded edges
    y, z = (np.sign(f) * np.abs(f) ** 0.45 for f in (np.cos(angle), np.sin(angle)))
    points = np.stack(
        [np.broadcast_to(x[:, None], (len(x), sides)), half[:, None] * y, half[:, None] * z + height], axis=-1
    )
    return points.reshape(-1, 3).astype(np.float32), tube_triangles(len(x), sides)


def disc_points(geometry: Geometry, rings: int = 5, sides: int = 72) -> tuple[Array, Triangles]:
    """(points, 2) y, z about the hub and the triangles of the rotor disc, from the blades' roots on.

    Twelve points per period of the sixth harmonic; along the radius the wind is linear, and few rings hold it.
    """
    angle = np.arange(sides) * 2 * pi / sides
    r = np.linspace(geometry.blade.hub_radius, geometry.radius, rings)
    points = np.stack([r[:, None] * np.cos(angle), r[:, None] * np.sin(angle)], axis=-1).reshape(-1, 2)
    return points, tube_triangles(rings, sides)[: 2 * sides * (rings - 1)]


def normals(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Unit normals (n, vertices, 3) of moving surfaces (n, vertices, 3), averaged over the adjoining triangles."""
    corner = vertices[:, triangles]
    face = np.cross(corner[:, :, 1] - corner[:, :, 0], corner[:, :, 2] - corner[:, :, 0])
    out = np.zeros_like(vertices)
    for i in range(3):
        order = np.argsort(triangles[:, i], kind="stable")
        which, start = np.unique(triangles[order, i], return_index=True)
        out[:, which] += np.add.reduceat(face[:, order], start, axis=1)
    length = np.linalg.norm(out, axis=-1, keepdims=True)
    return (out / np.where(length > 0, length, 1.0)).astype(np.float32)
