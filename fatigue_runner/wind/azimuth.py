"""Azimuthal Fourier amplitudes: the form in which any wind over the rotor disc reaches a turning blade.

Axes of OpenFAST: x downwind, z up, y to the left looking downwind. Azimuth psi is 0 where blade 1 points up and
turns clockwise looking downwind, so a blade's point at radius r is at y = -r sin(psi), z = hub + r cos(psi).
Wind u over the disc, averaged along the blade with the weight g(r), is at azimuth psi

    w(psi) = c_0 + sum over m = 1 ... M of c_m cos(m psi) + s_m sin(m psi),

    c_0 = <u>,   c_m = 2 <u cos(m psi)>,   s_m = 2 <u sin(m psi)>,

where < > is the mean over azimuth and the g-weighted mean over the radius. Amplitudes stand in the order
c_0, c_1, s_1, ..., c_M, s_M everywhere. Wind that grows upwards has c_1 > 0, wind that grows to the left has
s_1 < 0: the linear shears v (1 + kappa_v z/R + kappa_h y/R) are v (1 + kappa_v rho cos(psi) - kappa_h rho sin(psi))
with rho = r/R, as in `turbine.equations`.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from fatigue_runner.errors import InputError
from fatigue_runner.wind.azimuthal_spectrum import DEFAULT_HARMONICS

# Wind on a circle through a grid of m cells has about 4 m kinks where it is interpolated linearly; the sums over
# equal steps of azimuth converge as the step squared there and faster than any power for smooth profiles.
AZIMUTHS = 360
RESOLVED_HARMONICS = (
    AZIMUTHS // 8
)  # eight points per period of the highest; far beyond what a rotor's wind needs


def azimuth_grid() -> np.ndarray:
    """The azimuths [rad] at which wind on a circle is sampled, (AZIMUTHS,), from 0 by equal steps."""
    return 2 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS


def whole_harmonics(harmonics: Any, most: int = RESOLVED_HARMONICS, what: str = "") -> int:
    """Number M of azimuthal harmonics; raises InputError, which begins with `what`, outside 0 ... most."""
    whole = isinstance(harmonics, int | np.integer) and not isinstance(harmonics, bool)
    if not whole or not 0 <= harmonics <= most:
        raise InputError(
            f"{what}harmonics must be a whole number from 0 to {most}, got {harmonics!r}; "
            f"{DEFAULT_HARMONICS} hold 98 % of every load range, 1 is linear shear only"
        )
    return int(harmonics)


def fourier_rows(azimuth: np.ndarray, harmonics: int) -> np.ndarray:
    """Basis c_0, cos, sin, cos 2, ... at `azimuth` (n,) [rad]: (1 + 2 M, n), the first row ones."""
    angle = np.multiply.outer(np.arange(1, harmonics + 1), azimuth)
    rows = np.ones((1 + 2 * harmonics, len(azimuth)))
    rows[1::2], rows[2::2] = np.cos(angle), np.sin(angle)
    return rows


def analysis_rows(harmonics: int) -> np.ndarray:
    """(1 + 2 M, AZIMUTHS): times the wind at `azimuth_grid()` these are its amplitudes on one circle."""
    rows = fourier_rows(azimuth_grid(), harmonics) * (2 / AZIMUTHS)
    rows[0] /= 2
    return rows


def wind_at(amplitudes: np.ndarray, azimuth: np.ndarray) -> np.ndarray:
    """Blade-effective wind [m/s] at `azimuth` (n,) [rad] of amplitudes (..., 1 + 2 M): (..., n)."""
    amplitudes = np.asarray(amplitudes, float)
    return amplitudes @ fourier_rows(np.asarray(azimuth, float), (amplitudes.shape[-1] - 1) // 2)


def radial_shares(radii: Any, weight: Any, rotor_radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Radii (k,) [m] and the share (k,) of each in the blade-effective wind, of sum one.

    `weight` (k,) is the sensitivity at each radius times the length of blade that it stands for, on any scale.
    Raises InputError for unequal lengths, radii outside the rotor, NaN, and weights that add up to nothing.
    """
    radii, weight = np.atleast_1d(np.asarray(radii, float)), np.atleast_1d(np.asarray(weight, float))
    if radii.ndim != 1 or radii.shape != weight.shape:
        raise InputError(
            f"radii and weight have shapes {radii.shape} and {weight.shape}; give one weight per radius"
        )
    for i in np.flatnonzero(~((radii >= 0) & (radii <= rotor_radius * (1 + 1e-9))))[:1]:
        raise InputError(f"radius {i} is {radii[i]:g} m, but the rotor reaches from 0 to {rotor_radius:g} m")
    total = weight.sum()
    if not np.isfinite(total) or not total > 0:
        raise InputError(f"the weights over the radius add up to {total:g}; their sum must be positive")
    return radii, weight / total


@cache
def disc_rule(nodes: int = 48) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Radii as fractions of R (n,), weights of the disc mean (n,) and of the slopes per radius (n,).

    The disc's area-weighted mean is int 2 rho c_0 d rho; the least-squares plane v + G_z z/R + G_y y/R over the
    disc has G_z = int 4 rho^2 c_1 d rho and G_y = -int 4 rho^2 s_1 d rho (`rotor_modes`), c and s the
    amplitudes on the circle of radius rho R.
    """
    x, w = np.polynomial.legendre.leggauss(nodes)
    rho = (1 + x) / 2
    return rho, rho * w, 2 * rho**2 * w
