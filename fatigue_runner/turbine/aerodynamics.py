"""Quasi-steady blade-element-momentum theory of one rotor: the loads of a blade in an equilibrium wake.

Frames and signs: e1 normal to the coned blade, downwind; e3 along the span; e2 = e3 x e1, towards the
trailing edge, against the motion. r is the distance from the rotor apex along e3. Everything is in units of
the wind speed V along the shaft: velocities by V, loads of ONE blade by (1/3) * rho/2 * A * V^2 * [R], with
R = tip_radius * cos(cone) and A = pi R^2, so that the rotor's coefficient is the mean of its blades'.

The inflow angle solves one equation per blade station (Ning, Wind Energy 17, 2014, doi 10.1002/we.1636), with
Prandtl's tip and hub loss, Buhl's empirical thrust at high induction (NREL/TP-500-36834, 2005), tangential
induction, and without drag in the momentum balance (as in the reference turbine's OpenFAST model); drag is
in the loads. Two choices make the loads smooth, so that splines through their tables converge:
- polars are monotone cubics through their points, averaged over a window of angles that the turbine file
  sets, because the kinks of static stall are not in the flow;
- Buhl's parabola is carried on beyond an axial induction of 1 (reversed flow through the disc), where the
  branch of the propeller brake would jump. This matters at tip-speed ratios above 12 with pitch below 0 only.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.turbine.beam import BladeModes, columns

Array = NDArray[np.float64]
Polar = Callable[[Array], Array]

LOAD_NAMES = ("thrust", "tangential", "torque", "bending", "flap", "edge")

# Half widths of the central differences, by the wind speed; those in the rotor plane grow with the tip-speed
# ratio, so that they turn the flow as much as the others and yet never turn it round near the hub.
STEPS = {"kappa": 0.05, "y": 0.02, "flap": 0.05, "edge": 0.05, "skew": 0.05}


@dataclass(frozen=True)
class BladeAerodynamics:
    """What the aerodynamics know of a blade. n stations, without the unloaded ones at hub and tip.

    radius, chord (n,) [m], twist (n,) [rad]; cone [rad]; lift, drag: per station, the coefficient as function
    of the angle of attack [rad]; shapes (n, 4): phi_x, phi_y, psi_x, psi_y at the stations, at zero pitch;
    weights (6, n): the integral over the blade of 1, r, phi_x, phi_y, psi_x, psi_y times a load that is 1 at
    one station, 0 at the others and linear in between. prebend, sweep (n,): where the section is off the pitch axis, along e1
    and e2 [m]; cant (n,): by how much it leans beyond the cone [rad]; bent: whether a turbine file gives them.
    """

    blades: int
    hub_radius: float
    tip_radius: float
    cone: float
    radius: Array
    chord: Array
    twist: Array
    lift: tuple[Polar, ...]
    drag: tuple[Polar, ...]
    shapes: Array
    weights: Array
    prebend: Array
    sweep: Array
    cant: Array
    bent: bool

    @property
    def arm(self) -> Array:
        """(n,) distance of the sections from the shaft by cos(cone) [m]: r where the blade is straight."""
        return self.radius - self.prebend * np.tan(self.cone)

    @property
    def rotor_radius(self) -> float:
        """R: the radius that the tips sweep [m]."""
        return float(self.tip_radius * np.cos(self.cone))


def blade_aerodynamics(
    parameters: Mapping[str, Any], airfoils: Mapping[str, Any], modes: BladeModes
) -> BladeAerodynamics:
    """From a turbine file, its airfoil file and its blade modes.

    Raises InputError for an airfoil without polar and for stations that do not span the blade.
    """
    aerodynamics, geometry = parameters["aerodynamics"], parameters["geometry"]
    stations = columns(aerodynamics["stations"])
    span, radius = stations["span"], modes.hub_radius + stations["span"]
    if not (span[0] == 0 and np.all(np.diff(span) > 0) and np.isclose(radius[-1], modes.tip_radius)):
        raise InputError(
            "aerodynamics: stations: span must rise from 0 at the root to the length of the blade"
        )
    polars = _smooth_polars(airfoils, aerodynamics["polar_smoothing_deg"])
    for name in stations["airfoil"]:
        if name not in polars:
            raise InputError(
                f"aerodynamics: stations: no polar of airfoil {name!r}{did_you_mean(name, polars)}"
            )
    grid = modes.grid
    hats = _hats(grid, radius)
    inner = slice(1, -1)
    lift, drag = zip(*(polars[name] for name in stations["airfoil"][inner]), strict=True)
    straight = np.zeros_like(span)
    prebend, sweep = stations.get("prebend", straight), stations.get("sweep", straight)
    cant = (
        np.radians(stations["cant_deg"]) if "cant_deg" in stations else np.arctan(np.gradient(prebend, span))
    )
    deflection = aerodynamics.get("deflection", 0.0)
    if deflection:
        slope = np.interp(radius, grid, modes.flap_slope[:, 0])
        prebend, cant = (
            prebend + deflection * modes.flap_at(radius)[:, 0],
            cant + np.arctan(deflection * slope),
        )
    return BladeAerodynamics(
        blades=int(geometry["blades"]),
        hub_radius=modes.hub_radius,
        tip_radius=modes.tip_radius,
        cone=float(np.radians(geometry["precone_deg"])),
        radius=radius[inner],
        chord=stations["chord"][inner],
        twist=np.radians(stations["twist_deg"][inner]),
        lift=lift,
        drag=drag,
        shapes=np.concatenate([modes.flap_at(radius[inner]), modes.edge_at(radius[inner])], axis=1),
        # along the bent blade, not along its axis
        weights=(hats * _steps(grid) @ _carried(modes)).T * np.hypot(1.0, np.gradient(prebend, span))[inner],
        prebend=prebend[inner],
        sweep=sweep[inner],
        cant=cant[inner],
        bent=bool(deflection) or any(name in stations for name in ("prebend", "cant_deg")),
    )


def _hats(grid: Array, radius: Array) -> Array:
    """(n, m) loads on the grid that are 1 at one inner station and 0 at the others."""
    return np.stack([np.interp(grid, radius, unit) for unit in np.eye(len(radius))[1:-1]])


def _steps(grid: Array) -> Array:
    """Weights of the trapezoids."""
    return np.gradient(grid) * np.where((grid == grid[0]) | (grid == grid[-1]), 0.5, 1.0)


def _carried(modes: BladeModes) -> Array:
    """(m, 6) what a load on the grid is multiplied with."""
    grid = modes.grid
    return np.column_stack([np.ones_like(grid), grid, modes.flap, modes.edge])


def weights_beyond(blade: BladeAerodynamics, modes: BladeModes, radius: float) -> Array:
    """`blade.weights` of the part beyond r = `radius` [m]; those of the whole blade at its root."""
    grid = modes.grid
    hats = _hats(grid, np.array([grid[0], *blade.radius, grid[-1]]))
    inside = np.clip((radius - grid[:-1]) / np.diff(grid), 0.0, 1.0)  # share of every step that is not beyond
    values = hats[:, :, None] * _carried(modes)
    slopes = np.diff(values, axis=1)
    first = values[:, :-1]
    area = (first * inside[:, None] + slopes * (inside**2 / 2)[:, None]) * np.diff(grid)[:, None]
    whole = np.sum(values * _steps(grid)[:, None], axis=1)
    stretch = blade.weights[0] / whole[:, 0]  # along the bent blade
    return ((whole - area.sum(axis=1)) * stretch[:, None]).T


def rotor_loads(
    blade: BladeAerodynamics,
    tip_speed_ratio: ArrayLike,
    pitch: ArrayLike,
    kappa: ArrayLike = 0.0,
    y: ArrayLike = 0.0,
    flap: ArrayLike = 0.0,
    edge: ArrayLike = 0.0,
    skew: ArrayLike = 0.0,
) -> Array:
    """Coefficients (6, ...) of LOAD_NAMES of one blade; the arguments broadcast against each other.

    tip_speed_ratio: rotor speed * R / V; pitch [rad], positive to feather. kappa: the wind at r is V (1 +
    kappa r / R). y: uniform in-plane air velocity along e2, by V. flap, edge: modal velocities by V; pitch
    turns the modes. skew: in-plane wind along the blade, by V: the wake leans that way and the blade sees more of
    it (`_skewed`). Torque and bending are moments about the apex; flap and edge are generalised forces of the modes.
    """
    flow = {"kappa": kappa, "y": y, "flap": flap, "edge": edge, "skew": skew}
    return loads_beyond(blade, (blade.weights,), tip_speed_ratio, pitch, **flow)[0]


def loads_beyond(
    blade: BladeAerodynamics,
    weights: Sequence[Array],
    tip_speed_ratio: ArrayLike,
    pitch: ArrayLike,
    **flow: ArrayLike,
) -> Array:
    """`rotor_loads` of parts of the blade, (k, 6, ...), by their k `weights`; flow: kappa, y, flap, edge, skew."""
    given = (tip_speed_ratio, pitch, *(flow.get(name, 0.0) for name in STEPS))
    arguments = [np.asarray(v, dtype=float) for v in given]
    shape = np.broadcast_shapes(*(v.shape for v in arguments))
    arguments = [np.broadcast_to(v, shape).reshape(-1, 1) for v in arguments]
    normal, driving = strip_loads(blade, *arguments)
    found = [_resultants(blade, part, arguments[1][:, 0], normal, driving) for part in weights]
    return np.stack(found).reshape(len(weights), len(LOAD_NAMES), *shape)


def _resultants(
    blade: BladeAerodynamics, weights: Array, theta: Array, normal: Array, driving: Array
) -> Array:
    """LOAD_NAMES (6, m) of the loads per length (m, n) on the part of the blade that `weights` are of."""
    # A canted section presses along the blade, too: the force that turns and pushes the rotor as the whole of it does.
    cant, lean, whole = np.cos(blade.cant), np.sin(blade.cant), blade.cone + blade.cant
    pushing = (normal * (np.cos(whole) / np.cos(blade.cone))) @ weights[0] if blade.bent else None
    n, t = ((normal * cant) @ weights.T).T, (driving @ weights.T).T
    turning = driving * (blade.prebend * np.tan(blade.cone)) + normal * blade.sweep * np.sin(whole) / np.cos(
        blade.cone
    )
    c, s = np.cos(theta), np.sin(theta)
    return np.stack(
        [
            n[0] if pushing is None else pushing,
            t[0],
            (t[1] - turning @ weights[0]) / blade.rotor_radius,
            (n[1] + (normal * lean * blade.prebend) @ weights[0]) / blade.rotor_radius,
            *((c * n[i] + s * n[i + 1]) - (c * t[i + 1] - s * t[i]) for i in (2, 4)),
        ]
    )


def strip_loads(
    blade: BladeAerodynamics,
    lam: Array,
    theta: Array,
    kappa: Array,
    y: Array,
    flap: Array,
    edge: Array,
    skew: Array,
) -> tuple[Array, Array]:
    """Loads per length of blade at the stations, (m, n): normal to the section, and in the rotor plane along the motion.

    Arguments of `rotor_loads` as columns (m, 1); lam is the tip-speed ratio, theta the pitch. In units of
    (1/3) rho/2 A V^2 per metre.
    """
    r, big_r, cos_cone = blade.arm, blade.rotor_radius, np.cos(blade.cone)
    c, s = np.cos(theta), np.sin(theta)
    flap_x, flap_y, edge_x, edge_y = blade.shapes.T
    speed_x = flap * flap_x + edge * edge_x  # structural velocity in the axes that turn with pitch
    speed_y = flap * flap_y + edge * edge_y
    normal = (1.0 + kappa * r / big_r) * np.cos(blade.cone + blade.cant) - (
        c * speed_x + s * speed_y
    ) * np.cos(blade.cant)
    if blade.bent:  # the wind along the blade presses on it where it leans; on a straight coned blade that is 0.4 % of the wind
        normal = normal - skew * np.sin(blade.cone + blade.cant)
    in_plane = lam * r / big_r * cos_cone + y - (c * speed_y - s * speed_x)
    angle = inflow_angle(blade, normal, in_plane, theta)
    lift = _coefficient(blade.lift, angle - blade.twist - theta)
    speed = normal / _balance(blade, lift, angle)[0]
    if np.any(skew):
        speed, angle = _skewed(normal, speed, angle, skew * r / big_r)
    attack = angle - blade.twist - theta
    lift, drag = (_coefficient(polars, attack) for polars in (blade.lift, blade.drag))
    pressure = blade.chord * speed**2 * (3.0 / (np.pi * big_r**2))
    along_1 = pressure * (lift * np.cos(angle) + drag * np.sin(angle))
    driving = pressure * (lift * np.sin(angle) - drag * np.cos(angle))
    return along_1, driving


def _skewed(normal: Array, speed: Array, angle: Array, lean: Array) -> tuple[Array, Array]:
    """Speed and angle of the flow where the wake leans by `lean` = (in-plane wind along the blade / V) (r / R).

    Pitt & Peters' redistribution, as OpenFAST's default: a (1 + 15 pi/32 tan(chi/2) r/R cos psi), with the wake's skew chi =
    (1 + 0.6 a) times that of the wind, linear in the angle. Source: Burton et al., Wind Energy Handbook, 3.10;
    Ning et al. (2015), doi:10.2514/6.2015-0215.
    """
    induced = 1.0 - speed * np.sin(angle) / normal
    axial = normal * (1.0 - induced * (1.0 + 15 * np.pi / 64 * (1.0 + 0.6 * induced) * lean))
    in_plane = speed * np.cos(angle)
    return np.hypot(axial, in_plane), np.arctan2(axial, in_plane)


def power_coefficient(blade: BladeAerodynamics, tip_speed_ratio: ArrayLike, pitch: ArrayLike) -> Array:
    """Shaft power of the rotor in uniform wind by rho/2 A V^3."""
    torque = rotor_loads(blade, tip_speed_ratio, pitch)[LOAD_NAMES.index("torque")]
    return np.asarray(tip_speed_ratio) * torque * np.cos(blade.cone)


def frozen_power_slope(blade: BladeAerodynamics, tip_speed_ratio: ArrayLike, pitch: ArrayLike) -> Array:
    """d(power coefficient)/d(pitch) [1/rad], (n,), with the induced flow held as it was: what a fast change of pitch does before the
    wake follows. Arguments (n,), pitch in rad."""
    ratio, theta = (np.asarray(v, float).reshape(-1, 1) for v in (tip_speed_ratio, pitch))
    r, big_r, cos_cone = blade.radius, blade.rotor_radius, np.cos(blade.cone)
    normal, in_plane = np.full((len(ratio), len(r)), cos_cone), ratio * r / big_r * cos_cone
    angle = inflow_angle(blade, normal, in_plane, theta)
    speed = normal / _balance(blade, _coefficient(blade.lift, angle - blade.twist - theta), angle)[0]

    def power(change: float) -> Array:
        attack = angle - blade.twist - theta - change
        lift, drag = (_coefficient(polars, attack) for polars in (blade.lift, blade.drag))
        driving = blade.chord * speed**2 * (lift * np.sin(angle) - drag * np.cos(angle))
        return np.asarray(ratio[:, 0] * (driving @ blade.weights[1]) * (3.0 * cos_cone / (np.pi * big_r**3)))

    step = 1e-3
    return (power(step) - power(-step)) / (2 * step)


def thrust_coefficient(blade: BladeAerodynamics, tip_speed_ratio: ArrayLike, pitch: ArrayLike) -> Array:
    """Thrust of the rotor along the shaft in uniform wind by rho/2 A V^2."""
    return rotor_loads(blade, tip_speed_ratio, pitch)[LOAD_NAMES.index("thrust")] * np.cos(blade.cone)


def inflow_angle(blade: BladeAerodynamics, normal: Array, in_plane: Array, pitch: Array) -> Array:
    """Angle of the induced flow to the rotor plane [rad], (m, n); velocities (m, n), pitch (m, 1) [rad].

    The equation has one root between reversed flow and flow along the shaft for the polars of wind turbine
    blades; Chandrupatla's bracketing method (Advances in Engineering Software 28, 1997) finds it to rounding.
    """

    def residual(angle: Array) -> Array:
        lift = _coefficient(blade.lift, angle - blade.twist - pitch)
        ratio, tangential = _balance(blade, lift, angle)
        # Reversed flow with a negative load has no equilibrium: that is below the root.
        return np.where((angle <= 0) & (lift <= 0), -1e3, ratio * in_plane - tangential * normal)

    low = np.full(np.broadcast_shapes(normal.shape, in_plane.shape), -0.5 * np.pi + 1e-3)
    # Up to 108 deg, because a perturbation can turn the in-plane flow round near the hub of a slow rotor.
    return _find_root(residual, low, np.full_like(low, 0.6 * np.pi))


def _balance(blade: BladeAerodynamics, lift: Array, angle: Array) -> tuple[Array, Array]:
    """sin(phi)/(1-a) and cos(phi)/(1+a'): normal and in-plane velocity by the induced speed, in equilibrium.

    Written so that nothing is singular at phi = 0. With k = loading/sin^2: a = k/(1+k) up to k = 2/3, beyond
    it 4 F k (1-a)^2 = 8/9 + (4F - 40/9) a + (50/9 - 4F) a^2 (Buhl), which is quadratic in sin(phi)/(1-a).
    """
    s, c = np.sin(angle), np.cos(angle)
    solidity = blade.blades * blade.chord / (2 * np.pi * blade.arm * np.cos(blade.cone))
    loss = _loss(blade, s)
    swirl = solidity * lift / (4 * loss)
    loading = swirl * c
    b = 20 / 3 - 4 * loss
    root = np.sqrt(np.maximum((b * s) ** 2 - 8 * ((50 / 9 - 4 * loss) * s**2 - 4 * loss * loading), 0.0))
    momentum = (s > 0) & (loading <= 2 / 3 * s**2)
    ratio = np.where(momentum, s + loading / np.where(momentum, s, 1.0), (b * s + root) / 4)
    return ratio, c - swirl


def _loss(blade: BladeAerodynamics, sine: Array) -> Array:
    """Prandtl's tip and hub loss factor; at least 1e-4, as the momentum balance divides by it."""
    r, half = blade.radius, blade.blades / 2
    slope = np.maximum(np.abs(sine), 1e-9)
    tip = np.arccos(np.exp(-half * (blade.tip_radius - r) / (r * slope)))
    hub = np.arccos(np.exp(-half * (r - blade.hub_radius) / (blade.hub_radius * slope)))
    return np.maximum((2 / np.pi) ** 2 * tip * hub, 1e-4)


def _smooth_polars(airfoils: Mapping[str, Any], width_deg: float) -> dict[str, tuple[Polar, Polar]]:
    """Lift and drag of each airfoil over the angle of attack [rad]: monotone cubics, then averaged."""
    from scipy.interpolate import PchipInterpolator  # only the table builder needs scipy

    def smooth(attack: Array, values: Array) -> Polar:
        curve = PchipInterpolator(attack, values)
        area, half = curve.antiderivative(), np.radians(width_deg) / 2
        return curve if half == 0 else lambda at: (area(at + half) - area(at - half)) / (2 * half)

    polars = {}
    for name, points in airfoils["airfoils"].items():
        table = np.array(points, dtype=float)
        if table.ndim != 2 or table.shape[1] != 3 or not np.all(np.diff(table[:, 0]) > 0):
            raise InputError(
                f"airfoil {name!r}: rows of rising angle_of_attack_deg, lift and drag are needed"
            )
        if not (table[0, 0] <= -180 and table[-1, 0] >= 180):
            raise InputError(f"airfoil {name!r}: the polar must reach from -180 to 180 deg")
        attack = np.radians(table[:, 0])
        polars[name] = smooth(attack, table[:, 1]), smooth(attack, table[:, 2])
    return polars


def _coefficient(polars: tuple[Polar, ...], attack: Array) -> Array:
    """Coefficients (m, n) at the angles of attack (m, n) [rad] of the n stations."""
    return np.stack([polar(attack[:, i]) for i, polar in enumerate(polars)], axis=1)


def _find_root(function: Callable[[Array], Array], low: Array, high: Array) -> Array:
    """Elementwise root between low and high, where the function changes sign."""
    a, b = high, low.copy()
    fa, fb = function(a), function(b)
    # Deep in reversed flow a stalled polar may change the sign once more: the bracket begins nearer to the axial flow then.
    for nearer in (-1.0, -0.5, -0.2, -0.05):
        lost = np.sign(fa) * np.sign(fb) > 0
        if not lost.any():
            break
        b[lost] = nearer
        fb = np.where(lost, function(b), fb)
    if np.any(np.sign(fa) * np.sign(fb) > 0):
        raise InputError(
            "blade-element momentum: no equilibrium between reversed and axial flow for this blade"
        )
    c, fc, t = a, fa, np.full_like(a, 0.5)
    for _ in range(100):
        x = a + t * (b - a)
        fx = function(x)
        same = np.sign(fx) == np.sign(fa)
        c, fc = np.where(same, a, b), np.where(same, fa, fb)
        b, fb = np.where(same, b, a), np.where(same, fb, fa)
        a, fa = x, fx
        best = np.where(np.abs(fa) < np.abs(fb), a, b)
        width = np.abs(b - a)
        tolerance = 0.5 * (2e-15 + 4e-16 * np.abs(best)) / np.maximum(width, 1e-300)
        if np.all((tolerance > 0.5) | (fa == 0) | (fb == 0)):
            return best
        with np.errstate(divide="ignore", invalid="ignore"):
            xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
            inverse = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
        smooth = (phi**2 < xi) & ((1 - phi) ** 2 < 1 - xi)
        t = np.clip(
            np.where(smooth, inverse, 0.5), np.minimum(tolerance, 0.5), 1 - np.minimum(tolerance, 0.5)
        )
    raise ArithmeticError("blade-element momentum: no equilibrium found within 100 steps")
