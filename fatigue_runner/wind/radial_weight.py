"""How much of a blade's load the wind at each radius makes: the weight of a blade-effective wind."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fatigue_runner.errors import InputError

_ENOUGH = 1e-12  # share of the largest density below which an integral counts as nothing


@dataclass(frozen=True)
class RadialWeight:
    """Weight g(rho) of the wind at rho = r/R, linear between `radii`, zero outside them, of integral one.

    radii: (n,) rising fractions of the rotor radius within [0, 1]; density: (n,) g there on any scale: it is
    normalised when made. A stalled part of the blade may weigh less than nothing. Hashable, so that what is
    computed for one weight can be kept. Raises InputError for unequal lengths, radii that do not rise within
    the rotor, NaN, and an integral that is not positive.
    """

    radii: tuple[float, ...]
    density: tuple[float, ...]

    def __post_init__(self) -> None:
        radii = np.asarray(self.radii, float)
        density = np.asarray(self.density, float)
        if radii.ndim != 1 or radii.shape != density.shape or len(radii) < 2:
            shapes = f"{radii.shape} and {density.shape}"
            raise InputError(
                f"radial weight: radii and density have shapes {shapes}; give one density per radius"
            )
        if not (radii[0] >= 0 and radii[-1] <= 1 + 1e-12 and np.all(np.diff(radii) > 0)):
            raise InputError("radial weight: radii must rise from 0 or more to 1 or less, as r/R")
        integral = np.trapezoid(density, radii)
        if not integral > _ENOUGH * abs(density).max():
            raise InputError(f"radial weight: the density's integral is {integral:g}; it must be positive")
        object.__setattr__(self, "radii", tuple(radii.tolist()))
        object.__setattr__(self, "density", tuple((density / integral).tolist()))

    def at(self, rho: np.ndarray) -> np.ndarray:
        """g at any rho >= 0, of the shape of `rho`."""
        return np.interp(rho, self.radii, self.density, left=0.0, right=0.0)

    @property
    def mean_radius(self) -> float:
        """int g rho d rho: where a linear shear acts, as a fraction of R."""
        nodes, shares = self.rule(2)
        return float(shares @ nodes)

    def rule(self, nodes: int = 4) -> tuple[np.ndarray, np.ndarray]:
        """Radii as fractions of R and their shares, (k,) each: Gauss's rule between the knots, of sum one.

        What averages a field given by its values at points; exact for polynomials of degree 2 nodes - 2
        between the knots.
        """
        x, w = np.polynomial.legendre.leggauss(nodes)
        knots = np.array(self.radii)
        half = np.diff(knots)[:, None] / 2
        rho = (knots[:-1, None] + half * (1 + x)).ravel()
        return rho, (half * w).ravel() * self.at(rho)


# The area's: what the mean over the rotor disc is made with.
DISC = RadialWeight((0.0, 1.0), (0.0, 2.0))
