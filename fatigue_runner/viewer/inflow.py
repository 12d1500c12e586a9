"""The wind that the blades see, from the signals in a log: over the rotor disc, and at each blade's own azimuth.

Axes as in `scene`; azimuth 0 is up and turns clockwise for who looks downwind, so that a point of the disc is at y = -r sin, z = r cos.
What the harmonics add is the same all along a blade: towards the hub the disc shows what a blade there feels, not a field's point.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fatigue_runner.layout import BLADES, WIND, Channel

Array = NDArray[np.float64]

SPAN = (
    0.7  # of the radius: where along a blade its wind is told; the flap moment's weight has its middle there
)
BLADE_WIND = tuple(
    Channel(f"blade{i}_wind", "m/s", f"wind at blade {i}, {SPAN:g} R", "m/s") for i in (1, 2, 3)
)


def local_wind(wind: Array, y: Array, z: Array, radius: float) -> Array:
    """Wind speed (n, points) [m/s] at points (y, z) [m] about the hub, for signals (n, 3 + 2 M) as a trajectory has them."""
    v, vertical, horizontal = (wind[:, i, None] for i in range(len(WIND)))
    linear = v * (1.0 + vertical * z / radius + horizontal * y / radius)
    return linear + wind[:, len(WIND) :] @ _basis(np.arctan2(-y, z), wind.shape[1])


def blade_wind(wind: Array, azimuth: Array) -> Array:
    """Wind speed (n, 3) [m/s] at `SPAN` of each blade, for signals (n, 3 + 2 M) and the rotor's azimuth (n,) [rad]."""
    v, vertical, horizontal = (wind[:, i, None] for i in range(len(WIND)))
    psi = azimuth[:, None] + 2 * np.pi / BLADES * np.arange(BLADES)
    linear = v * (1.0 + SPAN * (vertical * np.cos(psi) - horizontal * np.sin(psi)))
    return linear + np.einsum("nk,kni->ni", wind[:, len(WIND) :], _basis(psi, wind.shape[1]))


def _basis(psi: Array, columns: int) -> Array:
    """cos(m psi), sin(m psi) for the amplitudes among so many signals: (2 M, *psi.shape)."""
    orders = np.arange(1, (columns - len(WIND)) // 2 + 1)
    angle = np.multiply.outer(orders, psi)
    return np.stack([np.cos(angle), np.sin(angle)], axis=1).reshape(-1, *psi.shape)
