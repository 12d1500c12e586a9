"""Series of the blade-effective harmonics: their variances, their independence, their random streams."""

import numpy as np
import pytest

from fatigue_runner.wind.azimuthal_spectrum import admittances
from fatigue_runner.wind.harmonic_series import RotorTurbulence
from fatigue_runner.wind.radial_weight import DISC, RadialWeight
from fatigue_runner.wind.spectrum import SPECTRA
from fatigue_runner.wind.streams import speed_stream, uniform
from fatigue_runner.wind.turbulence import modal_variances

BLADE = RadialWeight((0.02, 0.2, 0.5, 0.75, 0.9, 0.96, 1.0), (0.0, 0.11, 1.0, 1.95, 2.25, 1.9, 0.0))


def turbulence(mean=10.0, **options):
    given = {"weight": BLADE, "harmonics": 3, "samples": 600, "time_step": 0.2} | options
    return RotorTurbulence(mean, 63.0, 90.0, **given)


def correlations(series):
    return np.corrcoef(series.T) - np.eye(series.shape[1])


@pytest.mark.parametrize("spectrum", SPECTRA)
def test_random_phases_have_exactly_the_variances_of_the_spectrum(spectrum):
    wind = turbulence(spectrum=spectrum)
    variances = wind.variances().sum(axis=1)
    series = wind.series(seed=4, random_phase=True)
    assert series.var(axis=0) == pytest.approx(variances[[0, 1, 1, 2, 2, 3, 3]], rel=1e-12)
    assert series.mean(axis=0) == pytest.approx(np.zeros(7), abs=1e-12)


def test_gaussian_series_have_these_variances_on_average_and_scatter_as_their_spectrum_demands():
    wind = turbulence(time_step=1.0, samples=120)
    runs = np.array([wind.series(seed).var(axis=0) for seed in range(400)])
    expected = wind.variances()[[0, 1, 1, 2, 2, 3, 3]]
    assert runs.mean(axis=0) == pytest.approx(expected.sum(axis=1), rel=0.1)
    # Independent harmonics with exponentially distributed power: var(sum) = sum of squared means.
    assert runs.std(axis=0) == pytest.approx(np.sqrt((expected**2).sum(axis=1)), rel=0.15)


def test_the_uniform_part_is_the_disc_mean_that_the_program_always_had():
    wind = turbulence(samples=3000)
    assert wind.variances()[0] == pytest.approx(
        modal_variances(10.0, 63.0, 90.0, 3000, 0.2, False)[0], rel=1e-6
    )


def test_the_disc_mean_and_the_blades_own_mean_are_nearly_the_same_signal():
    # What it costs to have one signal for both: the spectra of the two means and of their difference, from
    # the mean of the two weights. Numbers of `harmonic_series`.
    wind = turbulence(samples=3000, harmonics=0)
    model, rho = SPECTRA["kaimal"], np.linspace(0, 1, 501)
    decay = model.decay(wind.frequencies, 10.0, model.length_scale(90.0)) * 63.0
    half = RadialWeight(tuple(rho), tuple(DISC.at(rho) + BLADE.at(rho)))
    disc, blade, both = (admittances(decay, w, 0, model.coherence)[0] for w in (DISC, BLADE, half))
    cross = 2 * both - (disc + blade) / 2  # H of the mean of two weights: (H_1 + 2 H_12 + H_2) / 4
    point = wind.variances()[0] / disc
    var_disc, var_blade, covariance = ((point * h).sum() for h in (disc, blade, cross))
    assert covariance / np.sqrt(var_disc * var_blade) > 0.998
    assert var_disc + var_blade - 2 * covariance < 0.035**2
    assert np.sqrt(var_disc / var_blade) == pytest.approx(1.01, abs=0.005)


def test_amplitudes_of_one_seed_are_uncorrelated_at_each_frequency():
    wind = turbulence(samples=6000)
    phase = np.angle(np.fft.rfft(wind.series(seed=8), axis=0)[1:-1])
    assert abs(correlations(np.cos(phase))).max() < 4 / np.sqrt(len(phase))


def test_more_harmonics_leave_the_first_ones_as_they_are():
    few, many = (turbulence(harmonics=m).series(seed=3) for m in (2, 6))
    assert many.shape == (600, 13)
    assert many[:, :5] == pytest.approx(few, abs=1e-12)


def test_a_finer_time_step_adds_higher_frequencies_to_the_same_series():
    coarse = turbulence(time_step=0.4, samples=300).series(seed=9)
    fine = turbulence(time_step=0.1, samples=1200).series(seed=9)
    low = np.fft.rfft(coarse, axis=0, norm="forward")[:-1]
    assert np.fft.rfft(fine, axis=0, norm="forward")[: len(low)] == pytest.approx(low, abs=1e-12)


def test_scaled_turbulence_has_sigma_1_at_a_point():
    point = turbulence(scaled=True).variances()[0] / turbulence().variances()[0]
    assert point == pytest.approx(np.full(299, point[0]), rel=1e-12)
    tiny = RotorTurbulence(10.0, 1e-6, 90.0, BLADE, 1, 600, 0.2, scaled=True)
    assert tiny.variances().sum(axis=1) == pytest.approx([1.0, 0.0], abs=1e-5)


def test_isotropic_turbulence_is_more_coherent_over_the_rotor_than_kaimals():
    # The same sigma_1 at a point: von Karman's wind holds more in the disc mean and less in high harmonics.
    kaimal, karman = (
        turbulence(samples=3000, harmonics=6, spectrum=s).variances().sum(axis=1) for s in SPECTRA
    )
    assert np.sqrt(kaimal[0]) == pytest.approx(0.618, abs=5e-4)  # as `TurbulentWind` has it
    assert np.all(karman[:3] > 1.05 * kaimal[:3]) and np.all(karman[4:] < 0.95 * kaimal[4:])


# Random streams


@pytest.mark.parametrize(
    ("speed", "neighbour"), [(8.0001, 8.0002), (8.0, np.nextafter(8.0, 9.0)), (10.0, 12.0)]
)
def test_winds_of_close_speeds_have_turbulence_of_their_own(speed, neighbour):
    first, second = (turbulence(v, samples=6000).series(seed=1) for v in (speed, neighbour))
    phases = [np.angle(np.fft.rfft(s, axis=0)[1:-1]) for s in (first, second)]
    between = np.corrcoef(np.cos(np.concatenate(phases, axis=1)).T)[:7, 7:]
    assert abs(between).max() < 4.5 / np.sqrt(2999)


def test_a_speed_names_its_stream_by_its_64_bits():
    assert speed_stream(1.0) == (0x3FF00000, 0)
    assert speed_stream(np.nextafter(1.0, 2.0)) == (0x3FF00000, 1)
    sweep = np.random.default_rng(0).uniform(4, 25, 2000).tolist()
    assert len({speed_stream(v) for v in sweep}) == len(sweep)


def test_series_are_pinned():
    # Recorded: streams are the same on every machine, the FFT rounds differently in the last digits only.
    assert uniform(1, (*speed_stream(8.0), 0, 0, 0), 2).tolist() == [0.23599030809822885, 0.5829769853424837]
    series = turbulence(8.0, samples=8, time_step=1.0, harmonics=1).series(seed=1)
    assert series[0] == pytest.approx([0.0029270405, -0.0790667157, -0.0439418494], rel=1e-6)
