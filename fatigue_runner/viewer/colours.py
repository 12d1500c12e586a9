"""Colours: one per integrator and per blade, and scales from a number to a colour."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Okabe & Ito's palette, told apart by colour-blind readers too; the reference is near white.
INTEGRATORS = ((86, 180, 233), (230, 159, 0), (0, 190, 130), (213, 94, 0), (204, 121, 167), (240, 228, 66))
REFERENCE = (225, 225, 225)
BLADES = ((86, 180, 233), (240, 228, 66), (204, 121, 167))
ACCEPTED, REJECTED = (0, 190, 130), (235, 70, 50)

# Anchors from low to high; light rises along both, so they also read in grey.
FLAP_SCALE = ((84, 16, 140), (136, 30, 160), (204, 71, 120), (248, 149, 64), (250, 232, 60))
WIND_SCALE = ((12, 44, 132), (34, 94, 168), (29, 145, 192), (100, 195, 200), (220, 245, 225))


def on_scale(
    values: ArrayLike, low: float, high: float, scale: tuple[tuple[int, ...], ...], alpha: int = 255
) -> NDArray[np.uint8]:
    """RGBA (..., 4) of values between `low` and `high`; beyond them the colour of the end, grey for NaN."""
    values = np.asarray(values, float)
    x = np.clip((values - low) / (high - low or 1.0), 0.0, 1.0)
    known = np.isfinite(x)
    x = np.where(known, x, 0.0)
    grid = np.linspace(0.0, 1.0, len(scale))
    rgb = [np.interp(x, grid, [colour[i] for colour in scale]) for i in range(3)]
    out = np.stack([*rgb, np.full(x.shape, float(alpha))], axis=-1)
    out[~known] = (120, 120, 120, alpha)
    return out.round().astype(np.uint8)


def packed(rgba: NDArray[np.uint8]) -> NDArray[np.uint32]:
    """RGBA (..., 4) as numbers 0xRRGGBBAA (...)."""
    r, g, b, a = (rgba[..., i].astype(np.uint32) for i in range(4))
    return np.asarray((r << 24) | (g << 16) | (b << 8) | a, np.uint32)
