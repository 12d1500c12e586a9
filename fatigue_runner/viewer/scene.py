"""Where everything of the turbine is, from the states in a log: the kinematics of `turbine/derivation/equations.py` as arrays.

Axes: x downwind, y to the left of who looks downwind, z up, origin at the tower base [m]. Frames N (nacelle), S (shaft), F
(turning with the rotor) and the coned blade axes are those of the equations: N = Ry(slope_fa a) Rx(-slope_ss s), S is N
tilted, F is S turned by the azimuth, so that the rotor turns clockwise for who looks downwind.

Everything is drawn at `scale` times its true deflection; the scale multiplies the modal coordinates, so lengths are kept to
second order at any scale. No viewer is needed here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, pi, radians, sin
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.errors import InputError
from fatigue_runner.layout import BLADES, FAMILIES, T2B1I1CG, Layout
from fatigue_runner.turbine.beam import BladeModes, TowerMode, TowerModes, blade_modes, tower_modes

Array = NDArray[np.float64]

_AROUND: Array = np.linspace(0.0, 2 * pi, BLADES, endpoint=False)  # the blades' places on the hub [rad]


@dataclass(frozen=True)
class Pose:
    """Where the turbine is at n times, [m], in the axes of the module.

    tower (n, levels, 3); top and apex (n, 3); nacelle and rotor (n, 3, 3): columns are the axes of frames N and F; blades
    (n, 3, stations, 3): the deflected pitch axes; coned (n, 3, 3, 3): of each blade, columns are e1, e2, e3 of its coned axes; pitch
    (n,) [rad].
    """

    tower: Array
    top: Array
    nacelle: Array
    apex: Array
    rotor: Array
    blades: Array
    coned: Array
    pitch: Array


@dataclass(frozen=True)
class Geometry:
    """What is needed of a turbine file to place its parts. `pitch` [rad], positive to feather."""

    name: str
    tower: TowerModes
    blade: BladeModes
    cone: float
    tilt: float
    overhang: float
    tower_to_shaft: float
    tower_base: float
    pitch: float = 0.0
    layout: Layout = T2B1I1CG

    @property
    def drawn(self) -> slice:
        """The states that a picture needs."""
        return slice(0, self.layout.rotor + 1)

    @property
    def radius(self) -> float:
        """Radius of the rotor disc [m]."""
        return self.blade.tip_radius * cos(self.cone)

    @property
    def hub_height(self) -> float:
        """Height of the rotor's apex at rest above the tower base [m]."""
        return self.tower.length + self.tower_to_shaft + self.overhang * sin(self.tilt)

    def deflection(
        self, state: Array, radius: Array, scale: float = 1.0, pitch: Array | None = None
    ) -> Array:
        """Displacement of the blades along e1, e2, e3 (n, 3, stations, 3) [m] for states (n, rows of the layout).

        pitch (n,) [rad], None where it is the geometry's: the modes turn with it.
        """
        flap, edge = self.blade.flap_at(radius), self.blade.edge_at(radius)
        f, e = (scale * self._of_blades(state, name)[..., None] for name in ("flap", "edge"))
        straight = f[..., None] * flap + e[..., None] * edge
        angle = np.broadcast_to(self.pitch if pitch is None else pitch, len(state))[:, None, None]
        c, s, x, y = np.cos(angle), np.sin(angle), straight[..., 0], straight[..., 1]
        across = np.stack([c * x + s * y, c * y - s * x], axis=-1)
        shortening = [np.interp(radius, self.blade.grid, column) for column in self.blade.shortening.T]
        along = -(shortening[0] * f**2 + 2 * shortening[1] * f * e + shortening[2] * e**2) / 2
        return np.concatenate([across, along[..., None]], axis=-1)

    def _of_blades(self, state: Array, mode: str) -> Array:
        """A modal coordinate of each blade (n, 3), or (n, 1) where the blades share it."""
        if mode in self.layout.names:
            return state[:, [self.layout.row(mode)]]
        first = self.layout.row(f"blade1_{mode}")
        return state[:, first : first + BLADES]

    def pose(
        self, state: Array, radius: Array, levels: int = 9, scale: float = 1.0, pitch: Array | None = None
    ) -> Pose:
        """Place all parts for states (n, rows of the layout); blades at the distances `radius` from the apex [m].

        pitch (n,) [rad], None where it is the geometry's.

        Raises InputError for states of another shape.
        """
        state = np.asarray(state, float)
        size = self.layout.size
        if state.ndim != 2 or state.shape[1] < size:
            raise InputError(f"states must have shape (n, {size} or more), got {state.shape}")
        a, s = (scale * state[:, self.layout.row(name)] for name in ("tower_fore_aft", "tower_side_side"))
        tower = self._tower(a, s, np.linspace(0.0, self.tower.length, levels))
        nacelle = rotation_y(self.tower.fore_aft.top_slope * a) @ rotation_x(
            -self.tower.side_side.top_slope * s
        )
        arm = np.array(
            [self.overhang * cos(self.tilt), 0.0, self.tower_to_shaft + self.overhang * sin(self.tilt)]
        )
        apex = tower[:, -1] + nacelle @ arm
        # the shaft axis is (cos tilt, 0, sin tilt) in N
        shaft = nacelle @ rotation_y(np.array([-self.tilt]))
        rotor = shaft @ rotation_x(state[:, self.layout.rotor])
        place = rotation_x(_AROUND) @ rotation_y(np.full(BLADES, self.cone))
        coned = rotor[:, None] @ place
        local = self.deflection(state, radius, scale, pitch)
        local[..., 2] += radius
        blades = apex[:, None, None] + np.einsum("nbij,nbkj->nbki", coned, local)
        turned = np.broadcast_to(self.pitch if pitch is None else pitch, len(state))
        return Pose(tower, tower[:, -1], nacelle, apex, rotor, blades, coned, turned)

    def _tower(self, a: Array, s: Array, heights: Array) -> Array:
        """Points of the tower's axis (n, levels, 3)."""
        fa, ss = self.tower.fore_aft, self.tower.side_side
        drop = _shortening(fa, heights) * a[:, None] ** 2 + _shortening(ss, heights) * s[:, None] ** 2
        x = fa.shape_at(heights) * a[:, None]
        y = ss.shape_at(heights) * s[:, None]
        return np.stack([x, y, self.tower_base + heights - drop / 2], axis=-1)

    def straight_blades(self) -> Array:
        """(3, 2, 3): root and tip of the undeflected pitch axes in frame F [m]."""
        place = rotation_x(_AROUND) @ rotation_y(np.full(BLADES, self.cone))
        span = np.array([self.blade.hub_radius, self.blade.tip_radius])
        return place[:, None, :, 2] * span[:, None]

    def tip_channels(self, state: Array, pitch: Array | None = None) -> Array:
        """(n, 3, 2) out-of-plane and in-plane tip deflections, as the load channels of a log [m]; pitch as in `deflection`."""
        return self.deflection(state, np.array([self.blade.tip_radius]), pitch=pitch)[:, :, 0, :2]


def geometry(turbine: Mapping[str, Any], pitch: float = 0.0) -> Geometry:
    """The geometry of a turbine file's mapping; pitch [rad]. Raises InputError naming a missing entry."""
    try:
        g = turbine["geometry"]
        return Geometry(
            name=str(turbine.get("name", "unnamed")),
            tower=tower_modes(turbine),
            blade=blade_modes(turbine),
            cone=radians(g["precone_deg"]),
            tilt=radians(g["shaft_tilt_deg"]),
            overhang=float(g["overhang"]),
            tower_to_shaft=float(g["tower_top_to_shaft"]),
            tower_base=float(g["tower_base_height"]),
            pitch=pitch,
            layout=FAMILIES[str(turbine.get("model", "t2b1i1cg"))],
        )
    except KeyError as missing:
        raise InputError(f"turbine {turbine.get('name', '?')}: the entry {missing} is missing") from None


def rotation_x(angle: Array) -> Array:
    """Rotations about x (n, 3, 3) by angles (n,) [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return _stack([[1, 0, 0], [0, c, -s], [0, s, c]], angle)


def rotation_y(angle: Array) -> Array:
    """Rotations about y (n, 3, 3) by angles (n,) [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return _stack([[c, 0, s], [0, 1, 0], [-s, 0, c]], angle)


def _stack(rows: list[list[Any]], like: Array) -> Array:
    return np.stack([np.stack([np.broadcast_to(x, like.shape) for x in row], -1) for row in rows], -2)


def _shortening(mode: TowerMode, heights: Array) -> Array:
    """S(z), the integral of phi'^2 from the foot: a point sinks by S q^2 / 2 [1/m]."""
    slope = mode.polynomial.deriv()
    return (slope**2).integ()(heights / mode.length) / mode.length
