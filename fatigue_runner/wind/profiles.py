"""Steady wind over the rotor with all its azimuthal harmonics: mean shear, and the tower in the blade's way.

A power law seen by a turning blade is not its slope at the hub times cos(psi): with exponent 0.2 the 5 MW's second
and third harmonics are an eighth and a fortieth of the first, and of the three blades' third the tower feels
all. The amplitudes here are exact up to quadrature, in m/s per m/s of wind at the reference height and in the
order of `wind.azimuth`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fatigue_runner.errors import InputError
from fatigue_runner.wind.azimuth import (
    analysis_rows,
    azimuth_grid,
    disc_rule,
    radial_shares,
    whole_harmonics,
)
from fatigue_runner.wind.checks import number


class Profile(Protocol):
    """Mean wind over height; hashable, so that what is computed for one profile can be kept."""

    def __hash__(self) -> int: ...

    @property
    def words(self) -> str:
        """What it is, as a person reads it."""
        ...

    def factor(self, height: np.ndarray, reference_height: float) -> np.ndarray:
        """Wind at `height` [m] over the wind at `reference_height` [m]."""
        ...


@dataclass(frozen=True)
class PowerLaw:
    """(z / z_ref)^exponent, IEC 61400-1:2005, 6.3.1.2; exponent 0 is the same wind at every height."""

    exponent: float

    def __post_init__(self) -> None:
        number("shear exponent", self.exponent, at_least=-1.0, at_most=1.0, hint="IEC 61400-1 has 0.2")

    @property
    def words(self) -> str:
        return f"power law, exponent {self.exponent:g}"

    def factor(self, height: np.ndarray, reference_height: float) -> np.ndarray:
        return (np.asarray(height) / reference_height) ** self.exponent


@dataclass(frozen=True)
class Logarithmic:
    """ln(z / z_0) / ln(z_ref / z_0) with the roughness length z_0 [m]; below z_0 there is no wind."""

    roughness_length: float

    def __post_init__(self) -> None:
        hint = "0.03 is farmland, 0.0002 the sea"
        number("roughness length", self.roughness_length, above=0.0, unit=" m", hint=hint)

    @property
    def words(self) -> str:
        return f"logarithmic, roughness length {self.roughness_length:g} m"

    def factor(self, height: np.ndarray, reference_height: float) -> np.ndarray:
        if not reference_height > self.roughness_length:
            raise InputError(
                f"the reference height {reference_height:g} m does not lie above the roughness length "
                f"{self.roughness_length:g} m; 0.03 m is farmland"
            )
        height = np.maximum(height, self.roughness_length)
        return np.log(height / self.roughness_length) / math.log(reference_height / self.roughness_length)


@dataclass(frozen=True)
class LinearShear:
    """1 + kappa (z - z_ref) / R with the rotor radius R [m]: the linear shear of the wind signals."""

    kappa: float
    radius: float

    @property
    def words(self) -> str:
        return f"linear shear, {self.kappa:g} over the rotor's radius"

    def factor(self, height: np.ndarray, reference_height: float) -> np.ndarray:
        return 1 + self.kappa * (np.asarray(height) - reference_height) / self.radius


def profile_amplitudes(
    profile: Profile,
    hub_height: float,
    radii: np.ndarray,
    weight: np.ndarray,
    harmonics: int,
    reference_height: float | None = None,
) -> np.ndarray:
    """Amplitudes (1 + 2 M,) of a mean wind profile over that at `reference_height` [m] (None: the hub).

    radii, weight (k,) as in `radial_shares`. The sine amplitudes are zero: a profile is the same left and right.
    c_0 is not 1: a concave profile blows less on average over a circle than at its centre. Raises InputError
    where the rotor reaches into the ground.
    """
    harmonics = whole_harmonics(harmonics)
    radii, weight = radial_shares(radii, weight, np.max(radii))
    refuse_ground(hub_height, float(radii.max()))
    height = hub_height + np.multiply.outer(radii, np.cos(azimuth_grid()))
    wind = weight @ profile.factor(height, reference_height or hub_height)
    amplitudes = analysis_rows(harmonics) @ wind
    amplitudes[2::2] = 0.0  # what is there is rounding
    return amplitudes


def profile_disc_fit(
    profile: Profile, hub_height: float, rotor_radius: float, reference_height: float | None = None
) -> np.ndarray:
    """Disc mean and slopes per rotor radius along z and y, (3,), of a profile: its least-squares plane."""
    refuse_ground(hub_height, rotor_radius)
    rho, mean, slope = disc_rule()
    height = hub_height + rotor_radius * np.multiply.outer(rho, np.cos(azimuth_grid()))
    circles = profile.factor(height, reference_height or hub_height) @ analysis_rows(1).T
    return np.array([mean @ circles[:, 0], slope @ circles[:, 1], 0.0])


def refuse_ground(hub_height: float, radius: float) -> None:
    """Raises InputError for a rotor that would reach into the ground."""
    if not hub_height > radius:
        raise InputError(
            f"a rotor of radius {radius:g} m at hub height {hub_height:g} m reaches into the ground; "
            "the hub must lie higher"
        )


@dataclass(frozen=True)
class Tower:
    """What the rotor passes: tower diameters [m] at heights [m] above ground, rising, linear between them.

    Raises InputError for heights that do not rise and diameters that are not positive.
    """

    heights: Sequence[float]
    diameters: Sequence[float]

    def __post_init__(self) -> None:
        heights, diameters = np.asarray(self.heights, float), np.asarray(self.diameters, float)
        if heights.ndim != 1 or heights.shape != diameters.shape or len(heights) < 2:
            raise InputError("a tower needs at least two heights and one diameter for each; give both lists")
        if not (np.diff(heights) > 0).all():
            raise InputError(f"the tower's heights must rise, got {heights.tolist()}")
        if not (diameters > 0).all():
            raise InputError(f"the tower's diameters must be positive, got {diameters.tolist()}")


def tower_deficit(tower: Tower, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Change of the wind at points (x, y, z) [m] over the wind at that height: flow around a cylinder.

    (y'^2 - x'^2) / (x'^2 + y'^2)^2 with x', y' in tower radii from the tower's axis at x = y = 0: -1 at the
    stagnation point, positive beside the tower. AeroDyn's baseline potential flow (TwrPotent = 1), ending as
    there within one tower radius above the top: the cylinder shrinks as cos(pi/2 z'). Raises InputError for a
    point inside the tower.
    """
    heights, diameters = np.asarray(tower.heights, float), np.asarray(tower.diameters, float)
    radius = np.interp(z, heights, diameters) / 2
    above = np.maximum(z - heights[-1], 0.0) / radius
    taper = np.where(above < 1, np.cos(np.pi / 2 * np.minimum(above, 1.0)), 0.0)
    squared = np.maximum((x**2 + y**2) / radius**2, 1e-12)  # the axis itself, above the top
    if (inside := (squared <= 1) & (above == 0)).any():
        height = float(np.asarray(z)[inside][0])
        raise InputError(f"the blade meets the tower at height {height:.1f} m; check overhang, tilt and cone")
    return taper**2 * (y**2 - x**2) / radius**2 / squared**2


def tower_amplitudes(
    tower: Tower,
    hub_height: float,
    apex_x: float,
    radii: np.ndarray,
    weight: np.ndarray,
    harmonics: int,
    *,
    tilt: float = 0.0,
    cone: float = 0.0,
    profile: Profile | None = None,
    yaw: float = 0.0,
) -> np.ndarray:
    """Amplitudes (1 + 2 M,) of the tower's influence on undeflected blades, over the hub-height wind.

    `apex_x` [m] is the rotor apex's place downwind of the tower axis (upwind rotor: negative), `tilt` and
    `cone` [rad] as OpenFAST's ShftTilt and PreCone (upwind rotor: both negative). The deficit scales with the
    wind at the tower, so with `profile` (None: uniform); `yaw` [rad] as in `rotor.Rotor`: the flow around the tower turns with the
    wind. The deficit is local: cut off at M harmonics it is
    spread over about 1/M of the turn, with the right energy in each harmonic up to M.
    """
    harmonics = whole_harmonics(harmonics)
    radii, weight = radial_shares(radii, weight, np.max(radii))
    refuse_ground(hub_height, float(radii.max()))
    psi, r = azimuth_grid(), radii[:, None]
    out, axial = r * np.cos(cone) * np.cos(psi), r * np.sin(cone)  # along the vertical of the shaft; along it
    x = apex_x + axial * np.cos(tilt) - out * np.sin(tilt)
    z = hub_height + out * np.cos(tilt) + axial * np.sin(tilt)
    y = -r * np.cos(cone) * np.sin(psi)
    across, down = x * np.sin(yaw) + y * np.cos(yaw), x * np.cos(yaw) - y * np.sin(yaw)
    local = tower_deficit(tower, down, across, z)
    if profile is not None:
        local = local * profile.factor(z, hub_height)
    amplitudes = analysis_rows(harmonics) @ (weight @ local)
    if not yaw:
        amplitudes[2::2] = 0.0  # what is there is rounding
    return amplitudes
