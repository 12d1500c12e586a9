"""Turbulence as a turning blade feels it: series of its blade-effective azimuthal harmonics.

The amplitudes c_0, c_1, s_1, ..., c_M, s_M [m/s] of `azimuthal_spectrum` are independent series, each one inverse
FFT whose harmonics hold the point's spectrum, integrated over their frequency bin, times H_m. c_1 ... s_M
have the weight g by which the blade's load feels the wind, and act alike all along the blade. c_0 is the mean
over the disc instead, because the tip-speed ratio is made of it; a blade then feels

    w(psi, t) = V + c_0(t) + sum over m = 1 ... M of c_m(t) cos(m psi) + s_m(t) sin(m psi).

The blade's own mean over g differs from the disc's by 0.03 sigma_1 (correlation 0.998, 5 MW, 6 to 24 m/s); to
have it as a signal of its own would change no damage-equivalent load by more than 0.5 %.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from fatigue_runner.wind.azimuthal_spectrum import admittances
from fatigue_runner.wind.radial_weight import DISC, RadialWeight
from fatigue_runner.wind.spectrum import turbulence_spectrum
from fatigue_runner.wind.streams import speed_stream, uniform


@dataclass(frozen=True)
class RotorTurbulence:
    """What the statistics of the amplitudes depend on, for sigma_1 = 1 m/s.

    mean: hub-height speed V [m/s]; rotor_radius, hub_height [m]; weight: g; harmonics: M; spectrum: a name of
    `spectrum.SPECTRA`; samples (even) every time_step [s]; scaled: the point's variance between the first
    harmonic and the Nyquist frequency is brought up to sigma_1^2.
    """

    mean: float
    rotor_radius: float
    hub_height: float
    weight: RadialWeight
    harmonics: int
    samples: int
    time_step: float
    spectrum: str = "kaimal"
    scaled: bool = False

    @property
    def frequencies(self) -> np.ndarray:
        """Frequencies [Hz] of the harmonics of time, (samples/2 - 1,): without zero and Nyquist."""
        return np.arange(1, self.samples // 2) / (self.samples * self.time_step)

    def variances(self) -> np.ndarray:
        """Variance of c_0, and of c_m and s_m each, per harmonic of time: (1 + M, samples/2 - 1); read-only.

        Kept for the last few turbulences: all seeds and intensities of one mean wind speed share it.
        """
        return _variances(self)

    def series(self, seed: int, random_phase: bool = False) -> np.ndarray:
        """Amplitudes c_0, c_1, s_1, ..., c_M, s_M at the samples, (samples, 1 + 2 M), for sigma_1 = 1 m/s.

        Gaussian; with `random_phase` every harmonic of time has its expected power and only its phase is
        random. One seed gives independent series at different mean wind speeds; more harmonics, another
        spectrum or a finer time step leave the random numbers of what was there as they are.
        """
        half = np.zeros((1 + 2 * self.harmonics, self.samples // 2 + 1), complex)
        for order, variance in enumerate(self.variances()):
            for sine in range(1 if order == 0 else 2):
                stream = (*speed_stream(self.mean), order, sine)
                power = variance
                if not random_phase:
                    power = variance * -np.log1p(-uniform(seed, (*stream, 1), len(variance)))
                phase = 2 * np.pi * uniform(seed, (*stream, 0), len(variance))
                row = max(2 * order - 1 + sine, 0)
                half[row, 1:-1] = np.sqrt(power / 2) * np.exp(1j * phase)  # half of A = sqrt(2 * variance)
        return np.fft.irfft(half, self.samples, axis=1, norm="forward").T


@lru_cache(maxsize=64)
def _variances(turbulence: RotorTurbulence) -> np.ndarray:
    t, model = turbulence, turbulence_spectrum(turbulence.spectrum)
    scale, half_bin = model.length_scale(t.hub_height), 0.5 / (t.samples * t.time_step)
    frequency = t.frequencies
    point = model.variance(frequency - half_bin, frequency + half_bin, t.mean, scale)
    if t.scaled:
        point = point / point.sum()
    decay = model.decay(frequency, t.mean, scale) * t.rotor_radius
    shares = admittances(decay, t.weight, t.harmonics, model.coherence)
    shares[0] = admittances(decay, DISC, 0, model.coherence)[0]
    variances = point * shares
    variances.flags.writeable = False
    return variances
