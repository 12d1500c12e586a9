"""Loads of sections along tower and blade: moments at given heights and radii, from the same bodies as those at base and root.

A section carries what lies beyond it: inertia, weight and air load, about the point where it is (deflected). The bodies are those of the
equations: prescribed modes, masses lumped in the file's elements, the air load of the blade elements with the derivatives that the
coefficient tables have (`table_builder`), integrated from the section on. So the section at the root is the root, that at height 0 the
tower base.

Axes: a tower section's are those of the tower base (OpenFAST's TwHtiMLyt and TwHtiMLxt lean with the tower); a blade section's are those
of the root, which turn with the pitch, as OpenFAST's SpniMLyb1 and SpniMLxb1 but for the blade's own slope.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fatigue_runner.channels import edgewise_at, flapwise_at, fore_aft_at, sections, side_side_at, towards
from fatigue_runner.errors import InputError
from fatigue_runner.layout import ACROSS, BLADES, HARMONICS, Channel
from fatigue_runner.turbine.aerodynamics import weights_beyond
from fatigue_runner.turbine.beam import BladeModes, TowerMode, TowerModes, blade_modes, tower_modes
from fatigue_runner.turbine.generated.sections import hub_motion, section_blade, section_tower
from fatigue_runner.turbine.parameters import blade_integrals
from fatigue_runner.turbine.table_builder import (
    coefficients_beyond,
    has_skewed_wake,
    perturbations,
    table_names,
    turbine_blade,
)
from fatigue_runner.turbine.tables import AeroTables

if TYPE_CHECKING:
    from fatigue_runner.turbine.turbine import Turbine

Array = NDArray[np.float64]
Arrays = Mapping[str, Any]

LOADS = ("thrust", "tangential", "torque", "bending")
BLADE_COSINE, BLADE_SINE = (1.0, -0.5, -0.5), (0.0, 0.75**0.5, -(0.75**0.5))
_CHUNK = 4096  # samples at a time: what they need stays in the processor's cache


@dataclass(frozen=True)
class BladeSection:
    """What lies beyond r = `radius` [m]: mass integrals of the equations; shape (4,): phi_x, phi_y, psi_x, psi_y there; shortening (3,):
    S_ff, S_fe, S_ee."""

    radius: float
    integrals: Mapping[str, float]
    shape: Array
    shortening: Array

    @classmethod
    def of(cls, modes: BladeModes, radius: float) -> BladeSection:
        """The section of a blade."""
        at = np.array(radius)
        shortening = [np.interp(radius, modes.grid, column) for column in modes.shortening.T]
        shape = np.concatenate([modes.flap_at(at), modes.edge_at(at)])
        return cls(radius, blade_integrals(modes.beyond(radius)), shape, np.array(shortening))

    def place(self, f: Array, e: Array) -> Array:
        """(3, n) where the section is, in the axes that turn with the pitch, for deflections (n,) [m]."""
        phi_x, phi_y, psi_x, psi_y = self.shape
        ff, fe, ee = self.shortening
        sunk = (ff * f**2 + 2 * fe * f * e + ee * e**2) / 2
        return np.stack([phi_x * f + psi_x * e, phi_y * f + psi_y * e, self.radius - sunk])


@dataclass(frozen=True)
class TowerSection:
    """What one mode makes of the tower beyond `height` [m]: shape and S there, and what it lacks of the whole tower's integrals: lever
    [kg m] of the inertia, weight [kg] of the lean."""

    height: float
    shape: float
    shortening: float
    lever: float
    weight: float

    @classmethod
    def of(cls, modes: TowerModes, mode: TowerMode, height: float) -> TowerSection:
        """The section of a tower for one of its modes."""
        z, masses = modes.elements
        phi, here = mode.shape_at(z), float(mode.shape_at(np.array(height)))
        above = z > height
        lever = mode.mass_height_shape - masses[above] @ ((z[above] - height) * phi[above])
        weight = mode.mass_shape - masses[above] @ (phi[above] - here)
        return cls(height, here, mode.shortening_at(height), float(lever), float(weight))


@dataclass(frozen=True, eq=False)
class SectionLoads:
    """The loads of a turbine's sections: tower_heights above the tower's foot [m], blade_radii along blade 1 from the rotor's apex [m],
    directions of the root's bending moment over half a circle.

    Made once for a turbine (`of_turbine`, seconds for the blade elements' tables), plain data that travels to workers.
    """

    tower_heights: tuple[float, ...]
    blade_radii: tuple[float, ...]
    directions: int
    blade: tuple[BladeSection, ...]  # the root, then the radii
    tower: tuple[tuple[TowerSection, TowerSection], ...]  # fore-aft, side-side
    tables: tuple[AeroTables, ...]  # of every section of the blade

    @classmethod
    def of_turbine(
        cls,
        turbine: Turbine,
        tower_heights: Sequence[float] = (),
        blade_radii: Sequence[float] = (),
        directions: int = 0,
    ) -> SectionLoads:
        """Raises InputError for a place off the tower or the blade, and for a turbine of which only parameters or tables are known."""
        heights, radii = tuple(map(float, tower_heights)), tuple(map(float, blade_radii))
        if directions < 0:
            raise InputError(f"root_directions must be 0 or more, got {directions}")
        if not heights and not radii:
            return cls((), (), int(directions), (), (), ())
        data = turbine.content
        if data is None or "airfoils" not in data["aerodynamics"]:
            raise InputError(
                f"turbine {turbine.name} gives no blade elements, only finished parameters or tables: loads of sections need a turbine "
                "file with `aerodynamics: airfoils:`"
            )
        modes, tower = blade_modes(data), tower_modes(data)
        _check("tower_heights", heights, 0.0, tower.length, "the tower reaches from 0 at its foot")
        _check("blade_radii", radii, modes.hub_radius, modes.tip_radius, "blade 1 reaches from")
        blade = tuple(BladeSection.of(modes, r) for r in (modes.hub_radius, *radii))
        pairs = tuple(
            (TowerSection.of(tower, tower.fore_aft, h), TowerSection.of(tower, tower.side_side, h))
            for h in heights
        )
        return cls(heights, radii, int(directions), blade, pairs, _tables(turbine, modes, blade))

    @property
    def channels(self) -> tuple[Channel, ...]:
        """What `of` gives."""
        return sections(self.tower_heights, self.blade_radii, self.directions)

    def of(
        self,
        turbine: Turbine,
        state: Array,
        wind: Array,
        loads: Mapping[str, Array],
        pitch: ArrayLike = 0.0,
        signals: Sequence[Channel] | None = None,
    ) -> dict[str, Array]:
        """Moments (n,) [N m] by channel in states (n, k) under wind; loads: the turbine's own channels of these states, else as
        `Turbine.loads`."""
        found = self._directions(loads)
        if not self.blade:
            return found
        turned, angle = turbine.turned(state, pitch), np.asarray(pitch, float)
        held = float(angle.flat[0]) if angle.size and np.all(angle == angle.flat[0]) else None
        parts = []
        for first in range(0, len(state), _CHUNK):
            part = slice(first, first + _CHUNK)
            given = held if held is not None else np.broadcast_to(angle, len(state))[part]
            slopes = turbine.derivative(state[part], wind[part], given, signals)
            parts.append(self._part(turbine, state[part], slopes, wind[part], turned[part], signals))
        found |= {name: np.concatenate([p[name] for p in parts]) for name in (parts[0] if parts else ())}
        return {c.name: found[c.name] for c in self.channels}

    def _directions(self, loads: Mapping[str, Array]) -> dict[str, Array]:
        """The root's bending moment by direction: 0 deg is flapwise, 90 deg edgewise."""
        y, x = loads["blade1_root_flapwise_moment"], loads["blade1_root_edgewise_moment"]
        angles = np.pi * np.arange(self.directions) / max(self.directions, 1)
        return {
            towards(float(np.degrees(angle))).name: np.cos(angle) * y + np.sin(angle) * x for angle in angles
        }

    def _part(
        self,
        turbine: Turbine,
        state: Array,
        slopes: Array,
        wind: Array,
        pitch: Array,
        signals: Sequence[Channel] | None,
    ) -> dict[str, Array]:
        x = _symbols(turbine, state, slopes, wind, signals)
        moved = hub_motion(turbine.parameters, x)
        ratio = moved["tip_speed_ratio"]
        wanted = range(len(self.blade))
        root, *beyond = (self._coefficients[i](ratio, pitch) for i in wanted)
        turn = _Turn(np.cos(pitch), np.sin(pitch))
        blades = [_Blade(turbine, x, moved, turn, number) for number in (1, 2, 3)]
        found = {}
        for section, values in zip(self.blade[1:], beyond, strict=True):
            force, moment = blades[0].load(section, values)
            moment = moment - np.cross(section.place(*blades[0].deflections), force, axis=0)
            found[flapwise_at(section.radius).name] = moment[1]
            found[edgewise_at(section.radius).name] = moment[0]
        if self.tower:
            given = {**x, **{name: moved[name] for name in moved if name[-2] == "_" and name[-1] in "xyz"}}
            for number, blade in enumerate(blades, start=1):
                for what, vector in zip(("force", "moment"), blade.load(self.blade[0], root), strict=True):
                    given |= dict(
                        zip((f"{what}{number}_{axis}" for axis in "xyz"), turn.coned(vector), strict=True)
                    )
            found |= self._tower(turbine, x, section_tower(turbine.parameters, given))
        return found

    def _tower(self, turbine: Turbine, x: Arrays, base: Arrays) -> dict[str, Array]:
        """What is left of the base's moments at the heights: less the lever of the force on top, of inertia and of weight below."""
        g, a, s = turbine.parameters["gravity"], x["a"], x["s"]
        found = {}
        for fore_aft, side_side in self.tower:
            up = fore_aft.height - (fore_aft.shortening * a**2 + side_side.shortening * s**2) / 2
            found[fore_aft_at(fore_aft.height).name] = (
                base["tower_base_fore_aft_moment"] - up * base["force_x"] + fore_aft.shape * a * base["force_z"]
                + fore_aft.lever * x["add"] - g * fore_aft.weight * a
            )  # fmt: skip
            found[side_side_at(side_side.height).name] = (
                base["tower_base_side_side_moment"] + up * base["force_y"] - side_side.shape * s * base["force_z"]
                - side_side.lever * x["sdd"] + g * side_side.weight * s
            )  # fmt: skip
        return found

    @cached_property
    def _coefficients(self) -> list[_Coefficients]:
        return [_Coefficients(tables) for tables in self.tables]


def _check(key: str, places: Sequence[float], low: float, high: float, what: str) -> None:
    for place in places:
        if not low - 1e-9 <= place <= high + 1e-9:
            start = "" if low == 0.0 else f" {low:g} m at its root"
            raise InputError(
                f"{key}: {place:g} m is not on it: {what}{start} to {high:g} m at its {'top' if low == 0.0 else 'tip'}"
            )


def _tables(turbine: Turbine, modes: BladeModes, sections: Sequence[BladeSection]) -> tuple[AeroTables, ...]:
    """The coefficient tables of what lies beyond every section, on the turbine's own grid."""
    assert turbine.content is not None
    blade, _ = turbine_blade(turbine.content)
    skewed, grid = has_skewed_wake(turbine.content), turbine.tables
    weights = [weights_beyond(blade, modes, section.radius) for section in sections]
    columns = [
        coefficients_beyond(blade, weights, grid.tip_speed_ratio, np.full_like(grid.tip_speed_ratio, angle), skewed)
        for angle in grid.pitch
    ]  # fmt: skip
    stack = np.stack(columns, axis=-1)
    names = table_names(skewed)
    kept = [i for i, name in enumerate(names) if name.split("_")[0] in LOADS]
    return tuple(
        AeroTables(
            grid.tip_speed_ratio, grid.pitch, {names[i]: part[i] for i in kept}, grid.interpolation, grid.span_weight
        )
        for part in stack
    )  # fmt: skip


class _Coefficients:
    """The coefficients of one section over tip-speed ratio and pitch: `AeroTables` as splines that take many places at once."""

    def __init__(self, tables: AeroTables) -> None:
        from scipy.interpolate import NdBSpline, make_interp_spline

        suffixes = ("", *(f"_{name}" for name in perturbations(True)), "_w")
        self.names = [name + suffix for name in LOADS for suffix in suffixes]
        self.grids = tables.tip_speed_ratio, tables.pitch
        values = np.stack([tables.coefficient(name) for name in self.names], axis=-1)
        degree = 3 if tables.interpolation == "cubic" else 1
        first = make_interp_spline(self.grids[0], values, k=degree, axis=0)
        second = make_interp_spline(self.grids[1], first.c, k=degree, axis=1)
        self.spline = NdBSpline((first.t, second.t), np.moveaxis(second.c, 0, 1), k=degree)

    def __call__(self, ratio: Array, pitch: Array) -> dict[str, Array]:
        """{name: (n,)}; what lies outside the tables is clamped, as in the kernels."""
        places = [np.clip(x, grid[0], grid[-1]) for x, grid in zip((ratio, pitch), self.grids, strict=True)]
        return dict(zip(self.names, self.spline(np.stack(places, axis=-1)).T, strict=True))


@dataclass(frozen=True)
class _Turn:
    """Between coned axes and those that turn with the pitch: twist and pitch add up about e3."""

    cosine: Array
    sine: Array

    def pitched(self, v: Sequence[Array] | Array) -> Array:
        c, s = self.cosine, self.sine
        return np.stack([c * v[0] - s * v[1], s * v[0] + c * v[1], v[2] + 0.0 * c])

    def coned(self, v: Sequence[Array] | Array) -> Array:
        c, s = self.cosine, self.sine
        return np.stack([c * v[0] + s * v[1], c * v[1] - s * v[0], v[2] + 0.0 * c])


class _Blade:
    """One blade at all samples: how it moves, and what air it meets."""

    def __init__(self, turbine: Turbine, x: Arrays, moved: Arrays, turn: _Turn, number: int) -> None:
        self.radius, self.turn, self.pressure = turbine.parameters["radius"], turn, moved["pressure"]
        self.deflections = x[f"f{number}"], x[f"e{number}"]
        self.moving = {
            name: x[f"{name[0]}{number}{name[1:]}"] for name in ("f", "e", "fd", "ed", "fdd", "edd")
        }
        for what in ("omega", "acceleration", "spin"):
            vector = turn.pitched([moved[f"{what}{number}_{axis}"] for axis in "xyz"])
            self.moving |= {f"{what}_{axis}": part for axis, part in zip("xyz", vector, strict=True)}
        c, s = BLADE_COSINE[number - 1], BLADE_SINE[number - 1]
        periodic = {
            f"_{key}": moved[f"{key}_cos"] * c + moved[f"{key}_sin"] * s
            for key in ("kappa", "y", "skew", "w")
        }
        self.flow = {
            "": moved["normal"], **periodic, "_flap": self.moving["fd"], "_edge": self.moving["ed"],
            "_w": periodic["_w"] + moved["w_mean"],
        }  # fmt: skip

    def load(self, section: BladeSection, coefficients: Mapping[str, Array]) -> tuple[Array, Array]:
        """Force and moment about the apex (3, n) of what lies beyond a section, in the axes that turn with the pitch."""
        thrust, tangential, torque, bending = (
            sum(coefficients[name + suffix] * flow for suffix, flow in self.flow.items()) for name in LOADS
        )
        none, pressure = 0.0 * self.pressure, self.pressure
        push = self.turn.pitched([thrust * pressure, -tangential * pressure, none])
        bend = self.turn.pitched([torque * pressure, bending * pressure, none]) * self.radius
        inert = section_blade(section.integrals, self.moving)
        force, moment = (
            np.stack([inert[f"{what}_{axis}"] for axis in "xyz"]) for what in ("force", "moment")
        )
        return push - force, bend - moment


def _symbols(
    turbine: Turbine, state: Array, slopes: Array, wind: Array, signals: Sequence[Channel] | None
) -> dict[str, Array]:
    """States, their rates and the wind (n,) by the names of the equations' symbols."""
    layout = turbine.layout
    names = ["a", "s", "f1", "f2", "f3"]
    names += ["e1", "e2", "e3"] if len(layout.blade_sets) > 1 else ["e"]
    names += ["phi", "gen"]
    found: dict[str, Array] = {}
    for i, name in enumerate(names):
        found |= {
            name: state[:, i], f"{name}d": state[:, layout.freedoms + i], f"{name}dd": slopes[:, layout.freedoms + i],
        }  # fmt: skip
    if "e" in found:
        found |= {f"e{n}{d}": found[f"e{d}"] for n in (1, 2, 3) for d in ("", "d", "dd")}
    sine, cosine = np.sin(found["phi"]), np.cos(found["phi"])
    known = (*layout.wind, *HARMONICS)[: wind.shape[1]] if signals is None else signals
    blown = {c.name: column for c, column in zip(known, wind.T, strict=True)}
    none = np.zeros(len(state))
    across = [blown.get(c.name, none) for c in ACROSS]
    found |= dict(zip(("v", "kv", "kh"), (blown[c.name] for c in layout.wind), strict=True))
    found |= dict(zip(("v_lateral", "v_vertical"), across, strict=True))
    folded = _fold([blown.get(c.name, none) for c in HARMONICS if c.name in blown], sine, cosine)
    return (
        found
        | {"sin_phi": sine, "cos_phi": cosine}
        | dict(zip(("w_fold_mean", "w_fold_cos", "w_fold_sin"), folded, strict=True))
    )


def _fold(pairs: Sequence[Array], sine: Array, cosine: Array) -> tuple[Array, Array, Array]:
    """Azimuthal harmonics c_1, s_1, c_2, ... at three blades: mean + cos cos(alpha) + sin sin(alpha), as `lane_code.Code`."""
    mean, cos, sin = (np.zeros_like(sine) for _ in range(BLADES))
    turned = np.exp(1j * np.arctan2(sine, cosine))
    for m, (c, s) in enumerate(zip(pairs[::2], pairs[1::2], strict=True), start=1):
        # c_m - i s_m times exp(i m psi): the part along cos(m alpha), and less that along sin(m alpha)
        both = (c - 1j * s) * turned**m
        if m % BLADES == 0:
            mean = mean + both.real
        else:
            cos = cos + both.real
            sin = sin + (-both.imag if m % BLADES == 1 else both.imag)
    return mean, cos, sin
