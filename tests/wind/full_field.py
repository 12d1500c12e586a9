"""A full-field turbulence simulation, written to check the projected signals (Veers, SAND88-0152; Shinozuka).

Longitudinal wind on a Cartesian grid of points over the rotor disc: per frequency the coherence matrix of all
points is factored by Cholesky and excited by independent random phases. It shares no code with
`fatigue_runner.wind`, down to the spectrum; the wind's parameters come from a least-squares fit of the field,
instant by instant.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np


class FullField:
    """Grid and statistics: V, sigma_1 [m/s], rotor radius, hub height [m], period, time step [s]."""

    def __init__(self, mean, sigma, *, radius=63.0, hub_height=90.0, across=13, period=600.0, time_step=1.0):
        self.mean, self.sigma, self.radius, self.period = mean, sigma, radius, period
        self.scale = 8.1 * (42.0 if hub_height >= 60.0 else 0.7 * hub_height)
        self.samples = round(period / time_step)
        self.frequency = np.arange(1, self.samples // 2) / period
        axis = (
            np.arange(across) + 0.5
        ) / across * 2 - 1  # centres of equal squares, so that all weigh the same
        y, z = (grid.ravel() for grid in np.meshgrid(axis, axis))
        inside = y**2 + z**2 < 1
        self.y, self.z = y[inside], z[inside]
        planes = np.stack([np.ones_like(self.z), self.z, self.y], axis=1)
        self.fit = np.linalg.pinv(planes)  # (3, points): least squares for the mean and the slopes per radius
        self.distance = radius * np.hypot(self.y[:, None] - self.y, self.z[:, None] - self.z)

    def spectrum(self, frequency):
        """Kaimal auto-spectrum [m^2/s^2/Hz] at a point, IEC 61400-1:2005 (B.14)."""
        reduced = frequency * self.scale / self.mean
        return self.sigma**2 / frequency * 4 * reduced / (1 + 6 * reduced) ** (5 / 3)

    def coherence(self, frequency):
        """Coherence matrix of all points, IEC 61400-1:2005 (B.16)."""
        r = self.distance
        return np.exp(-12 * np.sqrt((frequency * r / self.mean) ** 2 + (0.12 * r / self.scale) ** 2))

    def simulate(self, runs, seed=0):
        """Fluctuation at all points, (runs, samples, points) [m/s]."""
        phase = np.random.default_rng(seed).random((len(self.frequency), len(self.y), runs)) * 2 * np.pi
        half = np.zeros((runs, self.samples // 2 + 1, len(self.y)), complex)
        for k, frequency in enumerate(self.frequency):
            amplitude = np.sqrt(2 * self.spectrum(frequency) / self.period)
            factor = amplitude * np.linalg.cholesky(self.coherence(frequency))
            half[:, k + 1] = (factor @ np.exp(1j * phase[k])).T
        return np.fft.irfft(half, self.samples, axis=1) * self.samples / 2

    def expected_matrix(self, frequency):
        """Spectral matrix of (v, slope along z, slope along y) that the points have on average."""
        return self.spectrum(frequency) * self.fit @ self.coherence(frequency) @ self.fit.T

    def parameters(self, fluctuation, shear):
        """(v, kappa_v, kappa_h), (..., 3), of the field V (1 + shear z/R) + u': its least-squares plane."""
        field = self.mean * (1 + shear * self.z) + fluctuation
        v, slope_z, slope_y = np.moveaxis(field @ self.fit.T, -1, 0)
        return np.stack([v, slope_z / v, slope_y / v], axis=-1)


def cross_spectra(signals, period, edges):
    """One-sided spectral matrices (bands, 3, 3), averaged over runs and over the harmonics of each band.

    signals (runs, samples, 3); a band has the frequencies from edges[i] to below edges[i + 1] [Hz].
    """
    spectrum = np.fft.rfft(signals - signals.mean(axis=1, keepdims=True), axis=1) / signals.shape[1]
    frequency = np.arange(spectrum.shape[1]) / period
    matrices = 2 * period * np.einsum("rki,rkj->kij", spectrum.conj(), spectrum) / len(signals)
    band = [(frequency >= low) & (frequency < high) for low, high in pairwise(edges)]
    return np.array([matrices[b].mean(axis=0) for b in band])
