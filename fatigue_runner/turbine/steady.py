"""Operating point, and the modes of the spinning turbine about it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.errors import InputError
from fatigue_runner.layout import BLADES, Layout

Array = NDArray[np.float64]


class Equations(Protocol):
    """What is balanced and linearised here: a `Turbine`, or whatever has its right-hand side."""

    @property
    def name(self) -> str: ...

    @property
    def parameters(self) -> Mapping[str, float]: ...

    @property
    def layout(self) -> Layout: ...

    @property
    def way_out(self) -> str:
        """What to do where there is no steady rotation."""
        ...

    def guesses(self, wind: float) -> tuple[list[tuple[float, Array]], float]:
        """(rotor speed [rad/s], first-order states) to start from, the best first; and the slowest speed that is operation."""
        ...

    def rhs(
        self, state: Any, wind: Any, vertical_shear: Any = ..., horizontal_shear: Any = ..., pitch: Any = ...
    ) -> Array: ...


LARGE = (
    60.0  # m, rotor radius from which deflections have the sizes below; a smaller rotor's are in proportion
)
AZIMUTHS = 24  # of one revolution; three blades and up to the second harmonic repeat well within them

# What is unknown of a steady rotation, in the layout's order: a deflection, or the mean, cosine and sine part over the azimuth of a
# blade set; then the shaft's twist and the rotor's speed; then first-order states. Per coordinate: size of its deflection and of
# its swing, where the search starts at a wind speed, and what its acceleration is divided by.
_TOWER = {"tower_fore_aft": (0.1, 1.0), "tower_side_side": (0.01, -0.5)}
_DRIVE = (1e-3, 2.0)


def _sizes(layout: Layout) -> tuple[list[float], list[float]]:
    """Size of every unknown, and where its search starts by that size; the flap's for a wind of 1 m/s."""
    size, start = [], []
    for row in _firsts(layout):
        name = layout.coordinates[row].position.name
        own, begin = _TOWER.get(name, (1.0, 0.35) if name.endswith("flap") else (0.1, 0.1))
        swing = 2 if row in layout.blade_sets else 0
        size += [own, *[0.1] * swing]
        start += [begin, *[0.0] * swing]
    slow = [1e4 * s.nudge for s in layout.first_order]
    return [*size, _DRIVE[0], 1.0, *slow], [*start, _DRIVE[1]]


def _firsts(layout: Layout) -> list[int]:
    """Rows of the deflections, of a blade set the first."""
    return [i for i in range(layout.deflections) if layout.coordinates[i].blade <= 1]


def _flap_row(layout: Layout) -> int:
    """Number of the flap's mean among the unknowns."""
    return _firsts(layout).index(layout.row("blade1_flap"))


def _speed_row(layout: Layout) -> int:
    """Number of the rotor's speed among the unknowns."""
    return len(_firsts(layout)) + 2 * len(layout.blade_sets) + 1


def _states(layout: Layout, unknown: Array, azimuths: Array, ratio: float) -> Array:
    """(size, n) from the unknowns."""
    values = iter(unknown[: _speed_row(layout) - 1])
    twist, speed = unknown[_speed_row(layout) - 1 : _speed_row(layout) + 1]
    x = np.zeros((layout.size, len(azimuths)))
    psi = azimuths + np.arange(BLADES)[:, None] * 2 * np.pi / BLADES
    for row in _firsts(layout):
        if row in layout.blade_sets:
            mean, cosine, sine = next(values), next(values), next(values)
            blades, rates = _set(layout, row)
            x[blades] = mean + cosine * np.cos(psi) + sine * np.sin(psi)
            x[rates] = speed * (sine * np.cos(psi) - cosine * np.sin(psi))
        else:
            x[row] = next(values)
    x[layout.rotor], x[layout.generator] = azimuths, ratio * (azimuths - twist)
    x[layout.rotor_speed], x[layout.generator_speed] = speed, ratio * speed
    x[layout.first_order_rows] = unknown[_speed_row(layout) + 1 :, None]
    return x


def _set(layout: Layout, row: int) -> tuple[slice, slice]:
    """Rows of a blade set, and of its rates."""
    return slice(row, row + BLADES), slice(layout.freedoms + row, layout.freedoms + row + BLADES)


def _steady(
    turbine: Equations, wind: float, vertical_shear: float, horizontal_shear: float, pitch: float
) -> Array:
    """The unknowns of `_states` that balance the mean of every equation, and the once-per-revolution part of the blade sets'.

    First-order states are constant over the revolution, their slopes zero in the mean.
    """
    from scipy.optimize import root

    if not wind > 0:
        raise InputError(f"operating point: the wind speed must be positive, got {wind} m/s")
    p, layout = turbine.parameters, turbine.layout
    ratio, azimuths = p["g_ratio"], np.arange(AZIMUTHS) * 2 * np.pi / AZIMUTHS
    psi = azimuths + np.arange(BLADES)[:, None] * 2 * np.pi / BLADES
    sizes, begin = _sizes(layout)
    own, scale, freedoms = (
        np.array([1e4 * s.nudge for s in layout.first_order]),
        np.array(sizes),
        layout.freedoms,
    )
    at_speed = _speed_row(layout)
    scale[: at_speed - 1] *= min(1.0, p["radius"] / LARGE)

    def residual(z: Array) -> Array:
        unknown = z * scale
        x = _states(layout, unknown, azimuths, ratio)
        acc = turbine.rhs(x, wind, vertical_shear, horizontal_shear, pitch)[freedoms:]
        mean = acc.mean(axis=1)
        out, number = [], 0
        for row in _firsts(layout):
            if row in layout.blade_sets:
                blades, _ = _set(layout, row)
                swing = x[blades] - unknown[number]
                blade = (acc[blades] + unknown[at_speed] ** 2 * swing) / 50
                out += [blade.mean(), (blade * np.cos(psi)).mean(), (blade * np.sin(psi)).mean()]
                number += BLADES
            else:
                out.append(mean[row] if layout.coordinates[row].position.name in _TOWER else mean[row] / 50)
                number += 1
        # a rigid shaft has no twist to be found: its generator turns as the rotor does
        twisting = unknown[at_speed - 1] if p["g_rigid"] else mean[layout.generator] / ratio
        drive = mean[layout.rotor], twisting
        return np.array([*out, *drive, *(mean[freedoms:] / own)])

    guesses, slowest = turbine.guesses(wind)
    begin[_flap_row(layout)] *= wind
    for speed, states in guesses:
        found = root(residual, np.array([*begin, speed, *(states / own)]), tol=1e-11)
        # whether the search says that it ended does not matter: of a small stiff machine rounding is more than its tolerance
        if np.abs(found.fun).max() < 1e-6 and found.x[at_speed] > slowest:
            return found.x * scale
    raise InputError(
        f"{turbine.name} has no steady rotation at {wind:g} m/s and {np.degrees(pitch):g} deg pitch; "
        f"{turbine.way_out}"
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


def revolution(turbine: Equations, wind: float, pitch: float) -> Array:
    """(AZIMUTHS, size) states of steady rotation in uniform wind."""
    azimuths = np.arange(AZIMUTHS) * 2 * np.pi / AZIMUTHS
    unknown = _steady(turbine, wind, 0.0, 0.0, pitch)
    return _states(turbine.layout, unknown, azimuths, turbine.parameters["g_ratio"]).T


def _multiblade(layout: Layout, azimuth: float, speed: float) -> tuple[Array, Array, Array]:
    """T, dT/dt, d2T/dt2 (freedoms, freedoms): blade sets from their mean, cosine and sine parts (Coleman's transformation)."""
    psi = azimuth + np.arange(BLADES) * 2 * np.pi / BLADES
    none = np.zeros(BLADES)
    parts = [np.column_stack([np.ones(BLADES), np.cos(psi), np.sin(psi)])]
    parts.append(speed * np.column_stack([none, -np.sin(psi), np.cos(psi)]))
    parts.append(-(speed**2) * np.column_stack([none, np.cos(psi), np.sin(psi)]))
    out = []
    for i, block in enumerate(parts):
        t = np.eye(layout.freedoms) if i == 0 else np.zeros((layout.freedoms, layout.freedoms))
        for row in layout.blade_sets:
            blades, _ = _set(layout, row)
            t[blades, blades] = block
        out.append(t)
    return out[0], out[1], out[2]


def linearised(turbine: Equations, wind: float, pitch: float = 0.0) -> Array:
    """(size, size) state matrix about the operating point in multiblade coordinates, averaged over the azimuth."""
    unknown = _steady(turbine, wind, 0.0, 0.0, pitch)
    layout = turbine.layout
    ratio, speed, freedoms = turbine.parameters["g_ratio"], unknown[_speed_row(layout)], layout.freedoms
    size, q, rates, more = layout.size, layout.positions, layout.velocities, layout.first_order_rows
    total, delta = np.zeros((size, size)), np.array(layout.nudges)
    for azimuth in np.arange(AZIMUTHS) * 2 * np.pi / AZIMUTHS:
        x = _states(layout, unknown, np.array([azimuth]), ratio)[:, 0]
        shifts = np.concatenate([np.diag(delta), -np.diag(delta)], axis=1)
        slopes = turbine.rhs(x[:, None] + shifts, wind, pitch=pitch)[freedoms:]
        jacobian = (slopes[:, :size] - slopes[:, size:]) / (2 * delta)
        acc, own = jacobian[:freedoms], jacobian[freedoms:]
        t, t1, t2 = _multiblade(layout, azimuth, speed)
        inverse = np.linalg.inv(t)
        block = np.zeros((size, size))
        block[q, rates] = np.eye(freedoms)
        block[rates, q] = inverse @ (acc[:, q] @ t + acc[:, rates] @ t1 - t2)
        block[rates, rates] = inverse @ (acc[:, rates] @ t - 2 * t1)
        block[rates, more] = inverse @ acc[:, more]
        block[more, q] = own[:, q] @ t + own[:, rates] @ t1
        block[more, rates], block[more, more] = own[:, rates] @ t, own[:, more]
        total += block / AZIMUTHS
    return total


def natural_frequencies(turbine: Equations, wind: float, pitch: float) -> list[tuple[str, float, float]]:
    """See Turbine.natural_frequencies."""
    p, layout = turbine.parameters, turbine.layout
    values, vectors = np.linalg.eig(linearised(turbine, wind, pitch))
    flap, edge = np.sqrt(p["b_fxfx"] + p["b_fyfy"]), np.sqrt(p["b_exex"] + p["b_eyey"])
    tower = np.sqrt(p["t_maa"] + p["n_m"] + p["h_m"] + 3 * p["b_m"])
    rotor = np.sqrt(3 * p["b_m2"] + p["h_ixx"])
    weight: list[float] = []
    for row in _firsts(layout):
        name = layout.coordinates[row].position.name
        if name in _TOWER:
            weight.append(tower)
        else:
            own = flap if name.endswith("flap") else edge
            cyclic = [np.sqrt(1.5) * own] * 2 if row in layout.blade_sets else []
            weight += [np.sqrt(3) * own, *cyclic]
    weights = np.array([*weight, rotor, np.sqrt(p["g_i"])])
    modes = []
    for value, vector in zip(values, vectors.T, strict=True):
        if value.imag > 2 * np.pi * 0.05:
            share = (np.abs(vector[layout.velocities]) * weights) ** 2
            share[layout.rotor : layout.freedoms] = share[layout.rotor : layout.freedoms].sum() / 2
            modes.append((float(abs(value) / (2 * np.pi)), float(-value.real / abs(value)), share))
    modes.sort(key=lambda m: m[0])
    names = _names(layout, [m[2] for m in modes])
    return [(name, f, damping) for name, (f, damping, _) in zip(names, modes, strict=True)]


def _names(layout: Layout, shares: list[Array]) -> list[str]:
    """Names by the coordinates with the largest kinetic energy; the two cyclic modes of a blade set by their order."""
    groups = {
        "tower fore-aft": [layout.row("tower_fore_aft")],
        "tower side-side": [layout.row("tower_side_side")],
    }
    drive = [layout.rotor, layout.generator]
    for row in _firsts(layout):
        name = layout.coordinates[row].position.name
        kind = "flap" if name.endswith("flap") else "edge"
        if name in _TOWER:
            continue
        if kind == "flap":
            groups["flap collective"] = [row]
        else:
            drive.append(row)
        if row in layout.blade_sets:
            groups[f"{kind} cyclic"] = [row + 1, row + 2]
    groups["drivetrain and collective edge"] = drive
    raw = []
    for share in shares:
        raw.append(max(groups, key=lambda name: sum(share[i] for i in groups[name])))
    out = []
    for i, name in enumerate(raw):
        same = [j for j, other in enumerate(raw) if other == name]
        if name.endswith(" cyclic"):
            name = name.replace("cyclic", "regressing" if i == same[0] else "progressing")
        elif len(same) > 1:
            name = f"{name} {same.index(i) + 1}"
        out.append(name)
    return out
