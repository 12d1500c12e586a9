"""What the rotor sees of a turbulent field: azimuthal modes of the disc, and their share of the spectrum.

With rho = r/R and psi from the top of the disc, z = r cos psi, y = -r sin psi, mode n has the shapes
rho^n cos(n psi) and rho^n sin(n psi): n = 0 is the mean over the disc, n = 1 are the linear modes z/R and
y/R. The amplitude of a shape phi is its least-squares fit to the field u over the disc's area,

    a = (integral of u phi dA) / (integral of phi^2 dA).

The shapes are orthogonal, so the fit of one does not depend on the others: a_0 = (1/A) int u dA,
a_z = (4/A) int u z/R dA. The field's cross-spectrum depends on distance only, so it is the same after a turn
of the disc: amplitudes of different n, and of cosine and sine, are uncorrelated. The spectral matrix of the
signals is exactly diagonal, with entries S_u(f) H_n(f),

    H_n = (double integral of phi(x) phi(x') exp(-d |x - x'|) dA dA') / (integral of phi^2 dA)^2.

Sorting pairs of points by their distance s R gives H_n(d R) = int_0^2 exp(-d R s) w_n(s) ds with a weight
that belongs to the unit disc alone. For two points c - s/2 and c + s/2, as complex numbers,

    w_n(s) = 2 pi s / (m_n N_n^2) * integral of Re[(c - s/2)^n conj(c + s/2)^n] dc,

over the lens of all c for which both lie in the disc; N_0 = pi, N_n = pi / (2 n + 2) is the integral of
phi^2, m_0 = 1, m_n = 2 the number of shapes. w_0 is the density of the distance between two random points
of a disc, and H_0 that of the rotor-effective wind speed (D. Schlipf, dissertation, Stuttgart 2016, 5.2).
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

# Panels that halve towards s = 0 resolve exp(-d R s) up to d R = 1e4 (the 5 MW at 3 m/s: 40 Hz).
PANELS, NODES = 16, 12
CHUNK = 4096  # frequencies at once, to bound the memory of long series


@lru_cache(maxsize=16)
def pair_weights(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes s and weights w_n(s) ds of the quadrature over the distance of two points; both read-only."""
    x, w = np.polynomial.legendre.leggauss(NODES)
    edges = np.concatenate([[0.0], 0.5 ** np.arange(PANELS)[::-1]]) * (np.pi / 2)
    half = np.diff(edges)[:, None] / 2
    angle = edges[:-1, None] + half * (1 + x)  # s = 2 sin(angle): w_n is smooth in it, up to s = 2
    s = (2 * np.sin(angle)).ravel()
    ds = (2 * np.cos(angle) * half * w).ravel()
    norm, shapes = (np.pi, 1) if n == 0 else (np.pi / (2 * n + 2), 2)
    weights = 2 * np.pi * s * _lens_integral(n, s) * ds / (shapes * norm**2)
    s.flags.writeable = weights.flags.writeable = False
    return s, weights


def _lens_integral(n: int, s: np.ndarray) -> np.ndarray:
    """Integral of Re[(c - s/2)^n conj(c + s/2)^n] over the lens |c - s/2|, |c + s/2| < 1, for each s."""
    x, w = np.polynomial.legendre.leggauss(20 + 2 * n)
    s = s[:, None, None]
    limit = np.arccos(s / 2)
    t = limit * (1 + x[:, None]) / 2  # right half of the lens: c = cos t - s/2 + i eta sin t, -1 < eta < 1
    c = np.cos(t) - s / 2 + 1j * x * np.sin(t)
    pair = ((c - s / 2) * np.conj(c + s / 2)) ** n
    area = limit / 2 * w[:, None] * w * np.sin(t) ** 2
    return 2 * (pair.real * area).sum(axis=(1, 2))


def admittance(n: int, decay: np.ndarray) -> np.ndarray:
    """H_n at `decay` = d R (n_frequencies,): the spectrum of a mode-n amplitude over that of u at a point.

    Where the disc is fully coherent (decay 0): 1 for n = 0, 0 for n > 0. Far above: 2 pi / (N_n decay^2).
    """
    s, weights = pair_weights(n)
    chunks = [decay[i : i + CHUNK] for i in range(0, len(decay), CHUNK)]
    return np.concatenate([np.exp(-np.multiply.outer(chunk, s)) @ weights for chunk in chunks])
