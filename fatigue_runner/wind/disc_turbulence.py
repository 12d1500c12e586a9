"""Turbulence of a wind with one harmonic: the disc's mean and its two linear shears, least squares over the disc.

What the signals were before blades had a wind of their own, and what the paper's campaigns and older correctors know.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from fatigue_runner.wind import rotor_modes, spectrum
from fatigue_runner.wind.streams import speed_stream, uniform

# Order n of the azimuthal mode behind each signal, in the order of `channels.WIND_SIGNALS`. A signal's place
# is its random stream, so signals added at the end leave the others' series as they are.
MODES = (0, 1, 1)


@lru_cache(maxsize=64)
def modal_variances(
    mean: float, rotor_radius: float, hub_height: float, samples: int, time_step: float, scaled: bool
) -> np.ndarray:
    """Diagonal of the spectral matrix per harmonic, (3, samples/2 - 1), as shares of sigma_1^2; read-only.

    Harmonic k = 1, 2, ... has frequency k / (samples * time_step) and holds the bin half a step to either
    side; the mean and the Nyquist frequency hold nothing. Cached: all seeds and intensities of one mean wind
    speed share it.
    """
    scale, bin_width = spectrum.length_scale(hub_height), 1 / (samples * time_step)
    harmonic = np.arange(1, samples // 2)
    low, high = (harmonic - 0.5) * bin_width, (harmonic + 0.5) * bin_width
    point = spectrum.kaimal_variance(low, high, mean, scale)
    if scaled:
        point = point / point.sum()
    decay = spectrum.coherence_decay(harmonic * bin_width, mean, scale) * rotor_radius
    admittances = {n: rotor_modes.admittance(n, decay) for n in set(MODES)}
    variances = point * np.stack([admittances[n] for n in MODES])
    variances.flags.writeable = False
    return variances


def modal_series(variances: np.ndarray, mean: float, seed: int, random_phase: bool) -> np.ndarray:
    """Amplitudes a_0, a_z, a_y at the samples, (n, 3), of these variances (3, n/2 - 1); of zero mean."""
    samples = 2 * (variances.shape[1] + 1)
    half = np.zeros((samples // 2 + 1, len(MODES)), complex)
    for place, variance in enumerate(variances):
        stream = (place, *_stream(mean))  # so that one seed is independent from speed to speed
        power = variance
        if not random_phase:
            power = variance * -np.log1p(-uniform(seed, (*stream, 1), len(variance)))
        phase = 2 * np.pi * uniform(seed, (*stream, 0), len(variance))
        half[1:-1, place] = np.sqrt(power / 2) * np.exp(1j * phase)  # half of A = sqrt(2 * variance)
    return np.fft.irfft(half, samples, axis=0, norm="forward")


def _stream(mean: float) -> tuple[int, ...]:
    """Whole thousandths as they always were; any other speed by all its digits, so that no two share a stream."""
    thousandths = round(1000 * mean)
    return (thousandths,) if thousandths / 1000 == mean else speed_stream(mean)
