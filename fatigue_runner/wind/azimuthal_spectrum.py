"""What a turning blade feels of a turbulent field: spectra of its blade-effective azimuthal harmonics.

The wind u over the disc, averaged along the blade with the weight g(rho), rho = r/R, is at azimuth psi

    w(psi) = c_0 + sum over m = 1, 2, ... of c_m cos(m psi) + s_m sin(m psi),
    c_m = (2 - delta_m0) * mean over psi of (int g(rho) u(rho, psi) d rho) cos(m psi), s_m likewise.

A field whose cross-spectrum S_u(f) coh(a |x - x'|) is real and depends on the distance only (in rotor radii;
a is the decay times R) is the same after a turn of the disc. So amplitudes of different m, and cosine and sine,
are uncorrelated, and c_m and s_m have the same spectrum S_u(f) H_m(a),

    H_m = (2 - delta_m0) int int g(rho) g(rho') (1/2pi) int coh(a |x - x'|) cos(m dpsi) dpsi d rho d rho',

and w at any azimuth has the spectrum S_u(f) sum H_m. Sorting pairs of points by their distance s gives
H_m(a) = int_0^2 coh(a s) w_m(s) ds with a weight that belongs to g alone (as `rotor_modes` does for modes of
the disc). For two points p, q = c -+ s/2, as complex numbers, and h(x) = g(|x|) / (2 pi |x|),

    w_m(s) = 2 pi s (2 - delta_m0) int h(p) h(q) cos(m arg(q conj(p))) dc

over the lens of all c for which both lie in the disc. Where all of the disc is coherent, H_0 = 1 and H_m = 0;
far above, H_m -> (2 - delta_m0) 2 pi / a^2 int h^2 dA for exponential coherence: white in azimuth.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np

from fatigue_runner.errors import InputError
from fatigue_runner.layout import MOST_HARMONICS
from fatigue_runner.wind.radial_weight import RadialWeight

Coherence = Callable[[np.ndarray], np.ndarray]

# Panels that halve towards s = 0 resolve coh(a s) up to a = 1e4 (the 5 MW at 3 m/s: 40 Hz).
PANELS, NODES = 16, 20
LENS_NODES = 64  # across half a lens; kinks of g between its knots leave an error of 2e-6 in H
# Beyond, the quadrature grows coarse for slow eddies. Ten harmonics keep 99.7 % of every fatigue load.
# The least number that keeps 98 % of the damage-equivalent loads of a full field, 6 to 24 m/s: tests/wind measures it.
DEFAULT_HARMONICS = 6
# The table's range of a: smooth power laws on both sides of it.
LEAST_DECAY, LARGEST_DECAY, ENTRIES = 1e-6, 1e4, 501


@lru_cache(maxsize=16)
def pair_weights(weight: RadialWeight, harmonics: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes s (n,) of the quadrature over the distance of two points, w_m(s) ds (1 + M, n); both read-only."""
    x, w = np.polynomial.legendre.leggauss(NODES)
    edges = np.concatenate([[0.0], 0.5 ** np.arange(PANELS)[::-1]]) * (np.pi / 2)
    half = np.diff(edges)[:, None] / 2
    angle = edges[:-1, None] + half * (1 + x)  # s = 2 sin(angle), smooth up to s = 2
    s = (2 * np.sin(angle)).ravel()
    ds = (2 * np.cos(angle) * half * w).ravel()
    weights = 2 * np.pi * s * ds * _lens_integrals(weight, harmonics, s)
    # Full coherence is known exactly, H_0 = 1 and H_m = 0: it takes the quadrature's error out of slow eddies.
    excess = weights.sum(axis=1)
    weights[0] /= excess[0]
    weights[1:] -= np.multiply.outer(excess[1:], weights[0])
    s.flags.writeable = weights.flags.writeable = False
    return s, weights


def _lens_integrals(weight: RadialWeight, harmonics: int, s: np.ndarray) -> np.ndarray:
    """(2 - delta_m0) times the integral of h(p) h(q) cos(m dpsi) over the lens, (1 + M, n).

    Over a quarter of the lens: it is symmetric in p and q and upwards and downwards.
    """
    x, w = np.polynomial.legendre.leggauss(LENS_NODES)
    share, w = (1 + x) / 2, w / 2
    s = s[:, None, None]
    limit = np.arccos(s / 2)
    t = limit * share[:, None]
    q = np.cos(t) + 1j * share * np.sin(t)  # right of the middle, within the unit circle
    p = q - s
    left, right = abs(p), abs(q)
    area = 4 * limit * w[:, None] * w * np.sin(t) ** 2
    pairs = area * weight.at(left) * weight.at(right) / (4 * np.pi**2 * left * right)
    turn = q * np.conj(p) / (left * right)
    wave = np.ones_like(turn)
    integrals = np.empty((1 + harmonics, len(s)))
    for m in range(1 + harmonics):
        integrals[m] = (1 if m == 0 else 2) * (pairs * wave.real).sum(axis=(1, 2))
        wave *= turn
    return integrals


def admittances(decay: np.ndarray, weight: RadialWeight, harmonics: int, coherence: Coherence) -> np.ndarray:
    """H_m at `decay` = a (n,) > 0, (1 + M, n): spectrum of c_m (and of s_m) over that of u at a point.

    `coherence` takes a times the distance in rotor radii. From a table over log(a), made once for each weight,
    number of harmonics and coherence: cubics, and power laws beyond its ends. Its relative error of 1e-7 is
    below the quadrature's. Raises InputError for a number of harmonics outside 0 ... MOST_HARMONICS.
    """
    if not 0 <= harmonics <= MOST_HARMONICS:
        raise InputError(
            f"turbulence has 0 to {MOST_HARMONICS} azimuthal harmonics, got {harmonics!r}; "
            f"{DEFAULT_HARMONICS} keep 98 % of every fatigue load"
        )
    table = _log_table(weight, harmonics, coherence)
    position = np.log(decay)
    low, high = np.log(LEAST_DECAY), np.log(LARGEST_DECAY)
    inside = np.clip(position, low, high)
    beyond = (position - inside)[:, None]
    return np.exp(table(inside) + beyond * table(inside, 1)).T


@lru_cache(maxsize=16)
def _log_table(weight: RadialWeight, harmonics: int, coherence: Coherence) -> Any:
    from scipy.interpolate import CubicSpline  # slower to import than all of wind

    decay = np.geomspace(LEAST_DECAY, LARGEST_DECAY, ENTRIES)
    s, weights = pair_weights(weight, harmonics)
    values = coherence(np.multiply.outer(decay, s)) @ weights.T
    return CubicSpline(np.log(decay), np.log(values))
