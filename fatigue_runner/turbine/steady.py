"""Operating point, and the modes of the spinning turbine about it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.errors import InputError
from fatigue_runner.layout import T2B1I1CG, Layout

Array = NDArray[np.float64]


class Equations(Protocol):
    """What is balanced and linearised here: a `Turbine`, or whatever has its right-hand side."""

    @property
    def name(self) -> str: ...

    @property
    def parameters(self) -> Mapping[str, float]: ...

    @property
    def layout(self) -> Layout: ...

    def guesses(self, wind: float) -> tuple[list[tuple[float, Array]], float]:
        """(rotor speed [rad/s], first-order states) to start from, the best first; and the slowest speed that is operation."""
        ...

    def rhs(
        self, state: Any, wind: Any, vertical_shear: Any = ..., horizontal_shear: Any = ..., pitch: Any = ...
    ) -> Array: ...


AZIMUTHS = 24  # of one revolution; three blades and up to the second harmonic repeat well within them


# rows of T2B1i1cG by what they are here; first-order states follow them where a turbine has any
_FREEDOMS = T2B1I1CG.freedoms
_FORE_AFT, _SIDE_SIDE = T2B1I1CG.row("tower_fore_aft"), T2B1I1CG.row("tower_side_side")
_FLAP = T2B1I1CG.blade_sets[0]
_FLAPS, _FLAP_RATES = slice(_FLAP, _FLAP + 3), slice(_FREEDOMS + _FLAP, _FREEDOMS + _FLAP + 3)
_EDGE = T2B1I1CG.row("edge")
_ROTOR, _GENERATOR = T2B1I1CG.rotor, T2B1I1CG.generator
_SPEED, _GENERATOR_SPEED = T2B1I1CG.rotor_speed, T2B1I1CG.generator_speed
_UNKNOWNS = 8  # of a steady rotation, before the first-order states


def _states(layout: Layout, unknown: Array, azimuths: Array, ratio: float) -> Array:
    """(size, n) from (fore-aft, side-side, flap, its cosine and sine over the azimuth, edge, shaft twist, rotor speed) and the
    first-order states."""
    a, s, f, fc, fs, e, twist, speed = unknown[:_UNKNOWNS]
    x = np.zeros((layout.size, len(azimuths)))
    psi = azimuths + np.arange(3)[:, None] * 2 * np.pi / 3
    x[_FORE_AFT], x[_SIDE_SIDE], x[_EDGE] = a, s, e
    x[_FLAPS] = f + fc * np.cos(psi) + fs * np.sin(psi)
    x[_FLAP_RATES] = speed * (fs * np.cos(psi) - fc * np.sin(psi))
    x[_ROTOR], x[_GENERATOR] = azimuths, ratio * (azimuths - twist)
    x[_SPEED], x[_GENERATOR_SPEED] = speed, ratio * speed
    x[layout.first_order_rows] = unknown[_UNKNOWNS:, None]
    return x


def _steady(
    turbine: Equations, wind: float, vertical_shear: float, horizontal_shear: float, pitch: float
) -> Array:
    """The unknowns of `_states` that balance the mean of every equation, and the once-per-revolution part of the flap's.

    First-order states are constant over the revolution, their slopes zero in the mean.
    """
    from scipy.optimize import root

    if not wind > 0:
        raise InputError(f"operating point: the wind speed must be positive, got {wind} m/s")
    p, layout = turbine.parameters, turbine.layout
    ratio, azimuths = p["g_ratio"], np.arange(AZIMUTHS) * 2 * np.pi / AZIMUTHS
    psi = azimuths + np.arange(3)[:, None] * 2 * np.pi / 3
    own = np.array([1e4 * s.nudge for s in layout.first_order])
    scale = np.array([0.1, 0.01, 1.0, 0.1, 0.1, 0.1, 1e-3, 1.0, *own])

    def residual(z: Array) -> Array:
        unknown = z * scale
        x = _states(layout, unknown, azimuths, ratio)
        acc = turbine.rhs(x, wind, vertical_shear, horizontal_shear, pitch)[_FREEDOMS:]
        swing = x[_FLAPS] - unknown[2]
        flap = (acc[_FLAPS] + unknown[7] ** 2 * swing) / 50
        mean = acc.mean(axis=1)
        harmonics = (flap * np.cos(psi)).mean(), (flap * np.sin(psi)).mean()
        drive = mean[_ROTOR], mean[_GENERATOR] / ratio
        more = mean[_FREEDOMS:] / own
        tower = mean[_FORE_AFT], mean[_SIDE_SIDE]
        return np.array([*tower, flap.mean(), *harmonics, mean[_EDGE] / 50, *drive, *more])

    guesses, slowest = turbine.guesses(wind)
    for speed, states in guesses:
        start = np.array([1.0, -0.5, wind * 0.35, 0.0, 0.0, 0.1, 2.0, speed, *(states / own)])
        found = root(residual, start, tol=1e-11)
        if found.success and np.abs(found.fun).max() < 1e-6 and found.x[7] > slowest:
            return found.x * scale
    raise InputError(
        f"{turbine.name} has no steady rotation at {wind:g} m/s and {np.degrees(pitch):g} deg pitch; "
        "give `initial` explicitly"
    )


def operating_point(
    turbine: Equations,
    wind: float,
    vertical_shear: float,
    horizontal_shear: float,
    azimuth: float,
    pitch: float,
) -> Array:
    """See Turbine.operating_point."""
    unknown = _steady(turbine, wind, vertical_shear, horizontal_shear, pitch)
    return _states(turbine.layout, unknown, np.array([azimuth]), turbine.parameters["g_ratio"])[:, 0]


def _multiblade(azimuth: float, speed: float) -> tuple[Array, Array, Array]:
    """T, dT/dt, d2T/dt2 (8, 8): blade flaps from their mean, cosine and sine parts (Coleman's transformation)."""
    psi = azimuth + np.arange(3) * 2 * np.pi / 3
    parts = [np.column_stack([np.ones(3), np.cos(psi), np.sin(psi)])]
    parts.append(speed * np.column_stack([np.zeros(3), -np.sin(psi), np.cos(psi)]))
    parts.append(-(speed**2) * np.column_stack([np.zeros(3), np.cos(psi), np.sin(psi)]))
    out = []
    for i, block in enumerate(parts):
        t = np.eye(_FREEDOMS) if i == 0 else np.zeros((_FREEDOMS, _FREEDOMS))
        t[_FLAPS, _FLAPS] = block
        out.append(t)
    return out[0], out[1], out[2]


def linearised(turbine: Equations, wind: float, pitch: float = 0.0) -> Array:
    """(size, size) state matrix about the operating point in multiblade coordinates, averaged over the azimuth."""
    unknown = _steady(turbine, wind, 0.0, 0.0, pitch)
    ratio, speed = turbine.parameters["g_ratio"], unknown[7]
    layout = turbine.layout
    size, q, rates, more = layout.size, layout.positions, layout.velocities, layout.first_order_rows
    total, delta = np.zeros((size, size)), np.array(layout.nudges)
    for azimuth in np.arange(AZIMUTHS) * 2 * np.pi / AZIMUTHS:
        x = _states(layout, unknown, np.array([azimuth]), ratio)[:, 0]
        shifts = np.concatenate([np.diag(delta), -np.diag(delta)], axis=1)
        slopes = turbine.rhs(x[:, None] + shifts, wind, pitch=pitch)[_FREEDOMS:]
        jacobian = (slopes[:, :size] - slopes[:, size:]) / (2 * delta)
        acc, own = jacobian[:_FREEDOMS], jacobian[_FREEDOMS:]
        t, t1, t2 = _multiblade(azimuth, speed)
        inverse = np.linalg.inv(t)
        block = np.zeros((size, size))
        block[q, rates] = np.eye(_FREEDOMS)
        block[rates, q] = inverse @ (acc[:, q] @ t + acc[:, rates] @ t1 - t2)
        block[rates, rates] = inverse @ (acc[:, rates] @ t - 2 * t1)
        block[rates, more] = inverse @ acc[:, more]
        block[more, q] = own[:, q] @ t + own[:, rates] @ t1
        block[more, rates], block[more, more] = own[:, rates] @ t, own[:, more]
        total += block / AZIMUTHS
    return total


def natural_frequencies(turbine: Equations, wind: float, pitch: float) -> list[tuple[str, float, float]]:
    """See Turbine.natural_frequencies."""
    p = turbine.parameters
    values, vectors = np.linalg.eig(linearised(turbine, wind, pitch))
    flap = np.sqrt(p["b_fxfx"] + p["b_fyfy"])
    tower = np.sqrt(p["t_maa"] + p["n_m"] + p["h_m"] + 3 * p["b_m"])
    rotor = np.sqrt(3 * p["b_m2"] + p["h_ixx"])
    weight = np.array(
        [tower, tower, np.sqrt(3) * flap, np.sqrt(1.5) * flap, np.sqrt(1.5) * flap,
         np.sqrt(3 * (p["b_exex"] + p["b_eyey"])), rotor, np.sqrt(p["g_i"])]
    )  # fmt: skip
    modes = []
    for value, vector in zip(values, vectors.T, strict=True):
        if value.imag > 2 * np.pi * 0.05:
            share = (np.abs(vector[_FREEDOMS : 2 * _FREEDOMS]) * weight) ** 2
            share[_ROTOR:_FREEDOMS] = share[_ROTOR:_FREEDOMS].sum() / 2
            modes.append((float(abs(value) / (2 * np.pi)), float(-value.real / abs(value)), share))
    modes.sort(key=lambda m: m[0])
    return [
        (name, f, damping) for name, (f, damping, _) in zip(_names([m[2] for m in modes]), modes, strict=True)
    ]


def _names(shares: list[Array]) -> list[str]:
    """Names by the coordinates with the largest kinetic energy; the two cyclic flap modes by their order."""
    kinds = (
        "tower fore-aft",
        "tower side-side",
        "flap collective",
        "flap cyclic",
        "flap cyclic",
        "drivetrain and collective edge",
    )
    cyclic, drive = [_FLAP + 1, _FLAP + 2], [_EDGE, _ROTOR, _GENERATOR]
    groups = [[_FORE_AFT], [_SIDE_SIDE], [_FLAP], cyclic, [], drive]
    raw = []
    for share in shares:
        raw.append(kinds[int(np.argmax([sum(share[i] for i in g) for g in groups]))])
    out = []
    for i, name in enumerate(raw):
        same = [j for j, other in enumerate(raw) if other == name]
        if name == "flap cyclic":
            name = "flap regressing" if i == same[0] else "flap progressing"
        elif len(same) > 1:
            name = f"{name} {same.index(i) + 1}"
        out.append(name)
    return out
