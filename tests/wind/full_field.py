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

    def simulate(self, runs, seed=0, onto=None):
        """Fluctuation at all points, (runs, samples, points) [m/s].

        onto (n, points): weighted sums over the points instead, (runs, samples, n); taken before the inverse transform they cost next
        to nothing.
        """
        random = np.random.default_rng(seed)
        sums = np.eye(len(self.y)) if onto is None else onto
        half = np.zeros((runs, self.samples // 2 + 1, len(sums)), complex)
        for k, frequency in enumerate(self.frequency):
            amplitude = np.sqrt(2 * self.spectrum(frequency) / self.period)
            factor = amplitude * sums @ np.linalg.cholesky(self.coherence(frequency))
            phase = 2 * np.pi * random.random((len(self.y), runs))
            half[:, k + 1] = (factor @ np.cos(phase) + 1j * (factor @ np.sin(phase))).T
        return np.fft.irfft(half, self.samples, axis=1) * self.samples / 2

    def expected_matrix(self, frequency):
        """Spectral matrix of (v, slope along z, slope along y) that the points have on average."""
        return self.spectrum(frequency) * self.fit @ self.coherence(frequency) @ self.fit.T

    def parameters(self, planes, shear):
        """(v, kappa_v, kappa_h), (..., 3), of the field V (1 + shear z/R) + u'; planes (..., 3): u' onto `fit`."""
        v, slope_z, slope_y = np.moveaxis(planes + self.mean * np.array([1.0, shear, 0.0]), -1, 0)
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


class PolarField(FullField):
    """The same simulation on circles around the hub, and the amplitudes of its azimuthal harmonics.

    weight: function of r/R, on any scale, by which a blade averages; the circles stand at Gauss's nodes between
    `root` and the tip.
    """

    def __init__(self, mean, sigma, weight, *, root=0.02, circles=8, angles=32, **options):
        super().__init__(mean, sigma, across=3, **options)
        rho, self.share, self.area = blade_rule(weight, root, circles)
        self.azimuth = 2 * np.pi * np.arange(angles) / angles
        self.y = -np.outer(rho, np.sin(self.azimuth)).ravel()
        self.z = np.outer(rho, np.cos(self.azimuth)).ravel()
        self.distance = self.radius * np.hypot(self.y[:, None] - self.y, self.z[:, None] - self.z)

    def rows(self, harmonics):
        """(1 + 2 M, points): times the wind at the points these are the disc mean, c_1, s_1, ..., c_M, s_M."""
        return np.array(
            [
                np.outer(self.area if m == 0 else self.share, wave).ravel()
                for m, wave in zip(orders(harmonics), analysis(self.azimuth, harmonics), strict=True)
            ]
        )


class GridField(FullField):
    """The same simulation on a square grid that covers the rotor, linear between its points, as TurbSim's fields."""

    def __init__(self, mean, sigma, weight, *, across=15, width=145.0, root=0.02, **options):
        super().__init__(mean, sigma, across=3, **options)
        self.rho, self.share, self.area = blade_rule(weight, root, 24)
        self.across, self.step = across, width / self.radius / (across - 1)
        axis = (np.arange(across) - (across - 1) / 2) * self.step
        y, z = np.meshgrid(axis, axis)
        self.y, self.z = y.ravel(), z.ravel()
        self.distance = self.radius * np.hypot(self.y[:, None] - self.y, self.z[:, None] - self.z)

    def along(self, azimuth, share):
        """(n, points): times the wind at the points these are its averages by `share` along radii, at azimuths (n,)."""
        matrix, row = np.zeros((len(azimuth), len(self.y))), np.arange(len(azimuth))
        for rho, part in zip(self.rho, share, strict=True):
            place = (
                np.array([rho * np.cos(azimuth), -rho * np.sin(azimuth)]) / self.step + (self.across - 1) / 2
            )
            corner = np.floor(place).astype(int)
            up, left = place - corner
            for i, high in ((0, 1 - up), (1, up)):
                for j, side in ((0, 1 - left), (1, left)):
                    matrix[row, (corner[0] + i) * self.across + corner[1] + j] += part * high * side
        return matrix

    def blade(self, fluctuation, azimuth):
        """Wind averaged along a blade at `azimuth` (samples,) [rad], (runs, samples): all harmonics."""
        return np.einsum("tp,rtp->rt", self.along(azimuth, self.share), fluctuation)

    def rows(self, harmonics, angles=120):
        """(1 + 2 M, points), as `PolarField.rows`."""
        azimuth = 2 * np.pi * np.arange(angles) / angles
        disc, blade = self.along(azimuth, self.area), self.along(azimuth, self.share)
        waves = zip(orders(harmonics), analysis(azimuth, harmonics), strict=True)
        return np.array([wave @ (disc if m == 0 else blade) for m, wave in waves])


def blade_rule(weight, root, nodes):
    """Radii by R, their shares in a blade's average by `weight`, and in the mean over the disc from the root on."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    rho = root + (1 - root) * (1 + x) / 2
    share, area = w * weight(rho), w * rho
    return rho, share / share.sum(), area / area.sum()


def orders(harmonics):
    """Azimuthal order of each amplitude: 0, 1, 1, 2, 2, ..., M, M."""
    return [(k + 1) // 2 for k in range(1 + 2 * harmonics)]


def analysis(azimuth, harmonics):
    """(1 + 2 M, n): times values at equally spaced azimuths these are the Fourier coefficients c_0, c_1, s_1, ..."""
    waves = [np.ones_like(azimuth) / 2]
    for m in range(1, harmonics + 1):
        waves += [np.cos(m * azimuth), np.sin(m * azimuth)]
    return np.array(waves) * 2 / len(azimuth)


def turning(amplitudes, azimuth):
    """Wind (runs, samples) at `azimuth` (samples,) [rad] of amplitudes c_0, c_1, s_1, ... (runs, samples, 1 + 2 M)."""
    wind = amplitudes[..., 0].copy()
    for k, m in enumerate(orders((amplitudes.shape[-1] - 1) // 2)):
        if m:
            wind += amplitudes[..., k] * (np.cos if k % 2 else np.sin)(m * azimuth)
    return wind
