"""Turbulent wind: the standard's numbers, closed-form limits, and a full field projected on the disc."""

import pickle

import numpy as np
import pytest
from full_field import FullField, cross_spectra
from hypothesis import given, settings
from hypothesis import strategies as st

from fatigue_runner.errors import InputError
from fatigue_runner.wind import TurbulentWind, rotor_modes, spectrum
from fatigue_runner.wind.disc_turbulence import modal_variances
from fatigue_runner.wind.streams import uniform
from fatigue_runner.wind.turbulence import AMPLITUDES

R, H = 63.0, 90.0


def wind(mean=10.0, **options):
    return TurbulentWind(mean, **({"intensity": 0.14, "duration": 120.0, "harmonics": 1} | options))


# The standard


@pytest.mark.parametrize(("name", "intensity"), [("A+", 0.18), ("A", 0.16), ("B", 0.14), ("C", 0.12)])
def test_normal_turbulence_follows_the_class(name, intensity):
    # IEC 61400-1, 6.3.1.3 and table 1: sigma_1 = I_ref (0.75 V_hub + b), b = 5.6 m/s.
    assert TurbulentWind(12.0, turbulence_class=name).sigma == pytest.approx(intensity * 14.6)


def test_class_a_at_15_m_per_s_has_18_percent():
    # IEC 61400-1: I_ref 0.16 is the expected value at 15 m/s; its 90 % quantile is the older editions' 18 %.
    assert TurbulentWind(15.0, turbulence_class="A").sigma / 15.0 == pytest.approx(0.18, abs=5e-4)


@pytest.mark.parametrize(("height", "scale"), [(90.0, 340.2), (60.0, 340.2), (30.0, 170.1)])
def test_length_scale_is_340_m_from_60_m_up_and_proportional_to_height_below(height, scale):
    assert spectrum.length_scale(height) == pytest.approx(scale)


def test_the_point_spectrum_integrates_to_sigma_squared():
    assert spectrum.kaimal_variance(0.0, 1e9, 10.0, 340.2) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("frequency", [1e-3, 0.02, 0.3, 2.0])
def test_the_variance_of_a_narrow_band_is_the_kaimal_spectrum(frequency):
    reduced = frequency * 340.2 / 8.0  # f S / sigma^2 = 4 n / (1 + 6 n)^(5/3), IEC 61400-1:2005 (B.14)
    expected = 4 * reduced / (1 + 6 * reduced) ** (5 / 3) / frequency
    band = spectrum.kaimal_variance(frequency * 0.9999, frequency * 1.0001, 8.0, 340.2)
    assert band / (2e-4 * frequency) == pytest.approx(expected, rel=1e-6)


def test_the_inertial_subrange_has_the_level_that_the_standard_demands():
    f, low, high = 50.0, 49.99, 50.01  # IEC 61400-1:2005 (6): 0.05 sigma^2 (Lambda_1/V)^(-2/3) f^(-5/3)
    level = spectrum.kaimal_variance(low, high, 10.0, 340.2) / (high - low)
    assert level == pytest.approx(0.05 * (42.0 / 10.0) ** (-2 / 3) * f ** (-5 / 3), rel=0.005)


def test_coherence_decays_as_the_standard_says():
    f, r, v, scale = 0.1, 40.0, 8.0, 340.2  # IEC 61400-1:2005 (B.16)
    expected = np.exp(-12 * np.sqrt((f * r / v) ** 2 + (0.12 * r / scale) ** 2))
    assert np.exp(-spectrum.coherence_decay(f, v, scale) * r) == pytest.approx(expected)


# The projection on the disc


def brute_force_matrix(decay, orders, radii=24, angles=48):
    """Spectral matrix of the modes over the point's, from all pairs of points of a polar quadrature."""
    x, w = np.polynomial.legendre.leggauss(radii)
    rho = np.repeat((1 + x) / 2, angles)
    psi = np.tile(np.arange(angles) * 2 * np.pi / angles, radii)
    area = np.repeat(w / 2, angles) * rho * 2 * np.pi / angles
    waves = zip(orders, (np.cos, np.cos, np.sin), strict=True)
    shapes = np.array([rho**n * wave(n * psi) for n, wave in waves])
    fit = shapes * area / ((shapes**2 * area).sum(axis=1)[:, None])
    point = rho * np.exp(1j * psi)
    return fit @ np.exp(-decay * abs(point[:, None] - point)) @ fit.T


@pytest.mark.parametrize("decay", [0.0, 0.3, 1.0, 4.0])
@pytest.mark.parametrize("order", [1, 2, 3])
def test_the_spectral_matrix_is_diagonal_and_equals_the_sum_over_all_pairs_of_points(decay, order):
    matrix = brute_force_matrix(decay, (0, order, order))
    expected = [rotor_modes.admittance(n, np.array([decay]))[0] for n in (0, order, order)]
    # exp(-a s) has a kink of size a at distance zero, which limits the brute force.
    assert np.diag(matrix) == pytest.approx(expected, abs=3e-4 * decay + 1e-12)
    assert matrix - np.diag(np.diag(matrix)) == pytest.approx(np.zeros((3, 3)), abs=1e-12)


def test_full_coherence_gives_the_point_spectrum_and_no_shear():
    assert rotor_modes.admittance(0, np.zeros(1)) == pytest.approx(1.0, abs=1e-13)
    for n in (1, 2, 5):
        assert rotor_modes.admittance(n, np.zeros(1)) == pytest.approx(0.0, abs=1e-13)


def test_the_disc_mean_has_the_known_rotor_effective_spectrum():
    from scipy.special import iv, modstruve  # D. Schlipf, dissertation, Univ. Stuttgart 2016, 5.2.2

    a = np.array([0.1, 0.5, 1.0, 3.0])
    bracket = modstruve(1, 2 * a) - iv(1, 2 * a) - 2 / np.pi
    bracket += a * (-2 * modstruve(-2, 2 * a) + 2 * iv(2, 2 * a) + 1)
    assert rotor_modes.admittance(0, a) == pytest.approx(2 / a**3 * bracket, rel=1e-9)


@pytest.mark.parametrize("n", [0, 1, 2, 3])
def test_eddies_much_smaller_than_the_disc_average_out_as_independent_patches(n):
    # Each point is correlated over an area of 2 pi / a^2: H_n -> 2 pi / (a^2 * integral of phi^2).
    norm = np.pi if n == 0 else np.pi / (2 * n + 2)
    for a in (1e3, 1e4):
        expected = 2 * np.pi / (norm * a**2)
        assert rotor_modes.admittance(n, np.array([a])) == pytest.approx(expected, rel=4 * (n + 1) / a)


def test_the_distance_of_two_points_of_a_disc_has_its_classic_density():
    s, weights = rotor_modes.pair_weights(0)
    assert weights.sum() == pytest.approx(1.0, abs=1e-13)
    # Mean distance 128 / (45 pi), mean square distance 1 (Solomon, Geometric Probability, 1978, chapter 2).
    assert weights @ s == pytest.approx(128 / (45 * np.pi), abs=1e-12)
    assert weights @ s**2 == pytest.approx(1.0, abs=1e-12)


def test_long_series_are_projected_in_pieces_without_a_seam():
    decay = np.linspace(0.1, 50.0, 2 * rotor_modes.CHUNK + 3)
    pieces = rotor_modes.admittance(1, decay)
    assert len(pieces) == len(decay)
    assert pieces[rotor_modes.CHUNK] == rotor_modes.admittance(1, decay[rotor_modes.CHUNK :][:1])[0]


def test_at_very_low_frequency_the_disc_still_averages():
    # Coherence tends to exp(-12 * 0.12 r / L_c), not to 1: d R -> 1.44 R / L_c.
    slow = modal_variances(10.0, R, H, 4, 1e6, False) / modal_variances(10.0, 1e-9, H, 4, 1e6, False)[0]
    expected = np.diag(brute_force_matrix(1.44 * R / 340.2, (0, 1, 1)))
    assert slow[:, 0] == pytest.approx(expected, abs=1e-4)


# The series


@pytest.mark.parametrize("seed", [0, 1, 2**40])
def test_random_phases_have_exactly_the_variance_of_the_spectrum(seed):
    source = wind(amplitudes="random-phase", seed=seed)
    expected = source.sigma**2 * modal_variances(10.0, R, H, source.samples, 0.2, False).sum(axis=1)
    assert source.modal_series.var(axis=0) == pytest.approx(expected, rel=1e-12)
    assert source.modal_series.mean(axis=0) == pytest.approx(np.zeros(3), abs=1e-12)


def test_a_point_has_the_variance_that_lies_between_its_first_and_last_frequency():
    source = wind(rotor_radius=1e-6, amplitudes="random-phase", shear_exponent=0.0, duration=600.0)
    low, high = 0.5 / 600, 2.5 - 0.5 / 600
    n_low, n_high = low * 34.02, high * 34.02  # f L / V
    resolved = (1 + 6 * n_low) ** (-2 / 3) - (1 + 6 * n_high) ** (-2 / 3)
    assert source.modal_series[:, 0].var() == pytest.approx(1.4**2 * resolved, rel=1e-6)
    assert resolved == pytest.approx(0.885, abs=5e-4)
    assert abs(source.modal_series[:, 1:]).max() < 1e-2


def test_a_rotor_the_size_of_a_point_sees_the_kaimal_spectrum():
    source = wind(rotor_radius=1e-9, amplitudes="random-phase")
    harmonic = np.abs(np.fft.rfft(source.modal_series[:, 0])[1:-1]) / source.samples
    frequency = np.arange(1, source.samples // 2) / 120.0
    reduced = frequency * 34.02
    kaimal = 1.4**2 / frequency * 4 * reduced / (1 + 6 * reduced) ** (5 / 3)
    smooth = frequency > 0.05  # below, the spectrum bends within a bin
    assert (2 * harmonic**2 * 120.0)[smooth] == pytest.approx(kaimal[smooth], rel=0.01)


def test_scaled_turbulence_has_sigma_1_at_a_point():
    source = wind(rotor_radius=1e-6, amplitudes="random-phase", scaled=True)
    assert source.modal_series[:, 0].std() == pytest.approx(1.4, rel=1e-6)


def test_the_disc_mean_varies_less_than_a_point():
    point = modal_variances(10.0, 1e-6, H, 3000, 0.2, False)[0].sum()
    disc = modal_variances(10.0, R, H, 3000, 0.2, False)[0].sum()
    assert np.sqrt(disc) == pytest.approx(0.618, abs=5e-4)
    assert disc < 0.5 * point


def test_the_signals_give_back_the_fitted_field():
    source = wind(seed=5)
    v, kappa_v, kappa_h = source.at(np.arange(source.samples) * 0.2).T
    a_0, a_z, a_y = source.modal_series.T
    top, side = 10.0 * (1 + 0.2 * R / H) + a_0 + a_z, 10.0 + a_0 + a_y
    assert v * (1 + kappa_v) == pytest.approx(top, rel=1e-12)
    assert v * (1 + kappa_h) == pytest.approx(side, rel=1e-12)


def test_without_turbulence_there_is_the_mean_wind_with_its_shear():
    signals = wind(intensity=0.0).at(np.linspace(0, 120, 50))
    assert signals == pytest.approx(np.tile([10.0, 0.2 * 63 / 90, 0.0], (50, 1)), abs=1e-12)


def test_a_finer_time_step_adds_higher_harmonics_to_the_same_series():
    coarse, fine = wind(time_step=0.4, seed=9), wind(time_step=0.1, seed=9)
    low = np.fft.rfft(coarse.modal_series, axis=0, norm="forward")[:-1]
    assert np.fft.rfft(fine.modal_series, axis=0, norm="forward")[: len(low)] == pytest.approx(low, abs=1e-12)


def test_gaussian_amplitudes_scatter_the_variance_around_that_of_the_spectrum():
    runs = [wind(seed=s, time_step=1.0).modal_series.var(axis=0) for s in range(400)]
    expected = 1.4**2 * modal_variances(10.0, R, H, 120, 1.0, False)
    assert np.mean(runs, axis=0) == pytest.approx(expected.sum(axis=1), rel=0.1)
    # Independent harmonics with exponentially distributed power: var(sum) = sum of squared means.
    assert np.std(runs, axis=0) == pytest.approx(np.sqrt((expected**2).sum(axis=1)), rel=0.15)


def test_gaussian_and_random_phase_winds_of_a_seed_share_their_phases():
    spectra = [np.fft.rfft(wind(seed=3, amplitudes=a).modal_series, axis=0)[1:-1] for a in AMPLITUDES]
    assert np.angle(spectra[0] / spectra[1]) == pytest.approx(np.zeros_like(spectra[0], float), abs=1e-6)


# The seed


def test_the_same_seed_gives_the_same_bits_and_another_seed_does_not():
    assert np.array_equal(wind(seed=4).cells(100.0)[1], wind(seed=4).cells(100.0)[1])
    assert np.array_equal(
        wind(seed=4).cells(100.0)[1], pickle.loads(pickle.dumps(wind(seed=4))).cells(100.0)[1]
    )
    correlation = np.corrcoef(wind(seed=4).modal_series.T, wind(seed=5).modal_series.T)
    assert abs(correlation[:3, 3:]).max() < 0.6


def test_signals_and_mean_wind_speeds_of_one_seed_have_streams_of_their_own():
    phases = [
        np.angle(np.fft.rfft(wind(mean, seed=1, duration=600.0).modal_series, axis=0)[1:-1]).T
        for mean in (10.0, 12.0)
    ]
    correlation = np.corrcoef(np.concatenate(phases))
    assert abs(correlation - np.eye(6)).max() < 4 / np.sqrt(1499)


def test_random_numbers_are_pinned_bit_by_bit():
    # Recorded; PCG64's raw words are the same on every machine.
    expected = [0.6324940930145561, 0.39114178535280386, 0.46418747558600704]
    assert uniform(1, (0, 10000, 0), 3).tolist() == expected


def test_a_small_series_is_pinned():
    # Recorded from this implementation; the FFT may round differently elsewhere.
    series = TurbulentWind(8.0, intensity=0.14, seed=1, duration=10.0, time_step=1.0, harmonics=1)
    expected = [
        [8.026674235432296, 0.1518780586358541, 0.006784748287758334],
        [7.92216632168123, 0.12288072042684352, -0.016916525661966438],
        [8.02636500386314, 0.13536658234305227, 0.004071886568801601],
        [8.023873577127024, 0.14832766813169487, 0.011493582066276254],
    ]
    assert series.at(np.arange(0, 10, 3)) == pytest.approx(np.array(expected), rel=1e-9)


@settings(max_examples=30, deadline=None)
@given(st.floats(3.0, 30.0), st.floats(0.0, 0.2), st.integers(0, 2**70), st.floats(20.0, 60.0))
def test_every_series_is_periodic_smooth_and_as_long_as_asked(mean, intensity, seed, duration):
    source = TurbulentWind(mean, intensity=intensity, seed=seed, duration=duration, harmonics=1)
    h, c = source.cells(source.length)
    assert len(c) * h == pytest.approx(source.length) and duration <= source.length * (1 + 1e-9)
    assert source.length < duration + 2 * h
    following = np.roll(c, -1, axis=0)
    value = ((c[:, 3] * h + c[:, 2]) * h + c[:, 1]) * h + c[:, 0]
    slope = (3 * c[:, 3] * h + 2 * c[:, 2]) * h + c[:, 1]
    curvature = 6 * c[:, 3] * h + 2 * c[:, 2]
    assert value == pytest.approx(following[:, 0], abs=1e-10)
    assert slope == pytest.approx(following[:, 1], abs=1e-9)
    assert curvature == pytest.approx(2 * following[:, 2], abs=1e-8)
    assert source.lowest_speed[0] > 0


# What is refused


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"mean": -8.0, "intensity": 0.1}, "mean must be a number above 0 m/s"),
        ({"mean": float("nan"), "intensity": 0.1}, "mean must be"),
        ({"mean": 8.0}, "neither of intensity and turbulence_class"),
        ({"mean": 8.0, "intensity": 0.1, "turbulence_class": "A"}, "both of intensity and turbulence_class"),
        ({"mean": 8.0, "intensity": 14}, "0.14 for 14 %"),
        ({"mean": 8.0, "intensity": -0.1}, "intensity must be"),
        ({"mean": 8.0, "turbulence_class": "b"}, "did you mean 'B'"),
        ({"mean": 8.0, "turbulence_class": 5}, "known: A"),
        ({"mean": 8.0, "intensity": 0.1, "duration": 0.0}, "duration must be a number above 0 s"),
        ({"mean": 8.0, "intensity": 0.1, "duration": 0.5}, "less than four time steps"),
        ({"mean": 8.0, "intensity": 0.1, "time_step": 0.0}, "time_step must be"),
        ({"mean": 8.0, "intensity": 0.1, "seed": -1}, "seed must be a whole number"),
        ({"mean": 8.0, "intensity": 0.1, "seed": 1.5}, "seed must be a whole number"),
        ({"mean": 8.0, "intensity": 0.1, "amplitudes": "gausian"}, "did you mean 'gaussian'"),
        ({"mean": 8.0, "intensity": 0.1, "scaled": "no"}, "scaled must be true or false"),
        ({"mean": 8.0, "intensity": 0.1, "rotor_radius": "large"}, "rotor_radius must be"),
    ],
)
def test_a_wrong_parameter_is_refused_with_its_name(parameters, message):
    with pytest.raises(InputError, match=message):
        TurbulentWind(**parameters)


def test_turbulence_that_would_stop_the_wind_is_refused_with_the_time_and_a_way_out():
    source = wind(3.0, intensity=0.9, duration=600.0, seed=2)
    with pytest.raises(InputError, match=r"falls to -\d+\.\d\d m/s at \d+\.\d s.*another seed"):
        source.cells(60.0)


def test_a_run_longer_than_the_series_is_refused():
    with pytest.raises(InputError, match="is 120 s long but the run needs 130 s"):
        wind().cells(130.0)
    assert len(wind().cells(120.0)[1]) == 600


# Against a full field


def test_the_full_field_has_on_average_the_spectra_of_the_projected_signals():
    # No noise: the expected spectral matrix of a grid of points, against the integral over the disc.
    field = FullField(10.0, 1.4, across=21)
    variances = 1.4**2 * modal_variances(10.0, R, H, 600, 1.0, False)
    for k in (3, 12, 30, 48):
        matrix = field.expected_matrix(k / 600) / 600
        # A point stands for its square with the coherence at its centre: more so the smaller the eddies.
        assert np.diag(matrix) == pytest.approx(variances[:, k - 1], rel=0.01 + 4e-4 * k)
        assert abs(matrix - np.diag(np.diag(matrix))).max() < 1e-10


def ensembles(mean, across, runs):
    """Signals of the full field's fit and of the projection, (runs, 600, 3) each, one sample a second."""
    shear = 0.2 * R / H
    field = FullField(mean, 0.14 * mean, across=across)
    fitted = field.parameters(field.simulate(runs, 0, onto=field.fit), shear)
    time = np.arange(600.0)
    projected = [
        TurbulentWind(mean, intensity=0.14, seed=s, time_step=1.0, harmonics=1).at(time) for s in range(runs)
    ]
    return fitted, np.array(projected)


def compare_ensembles(fitted, projected, tolerance):
    """Variances, banded auto- and cross-spectra of both agree within the sampling error, as a share."""
    assert fitted.mean(axis=(0, 1)) == pytest.approx(projected.mean(axis=(0, 1)), rel=0.01, abs=3e-3)
    variance = [signals.var(axis=1).mean(axis=0) for signals in (fitted, projected)]
    assert variance[0] == pytest.approx(variance[1], rel=tolerance)
    edges = [1e-3, 0.01, 0.02, 0.04, 0.08]  # higher up, the grid's points are too far apart
    bands = zip(cross_spectra(fitted, 600.0, edges), cross_spectra(projected, 600.0, edges), strict=True)
    for field_matrix, disc_matrix in bands:
        power = np.diag(disc_matrix).real
        assert np.diag(field_matrix).real == pytest.approx(power, rel=1.5 * tolerance)
        coherency = (field_matrix - disc_matrix) / np.sqrt(np.outer(power, power))
        assert abs(coherency - np.diag(np.diag(coherency))).max() < tolerance


def test_a_full_field_fitted_by_a_plane_has_the_variances_and_spectra_of_the_signals():
    fitted, projected = ensembles(10.0, across=11, runs=100)
    compare_ensembles(fitted, projected, tolerance=0.12)


def test_gusts_lower_the_shear_in_both():
    # v and kappa_v = G_v / v are correlated through the mean shear: about -kappa sigma_v / V.
    for signals in ensembles(10.0, across=9, runs=300):
        v, kappa = signals[..., 0] - signals[..., 0].mean(), signals[..., 1] - signals[..., 1].mean()
        slope = (v * kappa).mean() / (v**2).mean()
        assert slope == pytest.approx(-0.14 / 10.0, rel=0.25)


@pytest.mark.slow(reason="fits 500 full fields of ten minutes at each of three speeds")
@pytest.mark.parametrize("mean", [6.0, 10.0, 18.0])
def test_a_fine_full_field_confirms_the_signals_closely(mean):
    fitted, projected = ensembles(mean, across=23, runs=500)
    compare_ensembles(fitted, projected, tolerance=0.06)


def test_the_ten_minute_variance_scatters_like_that_of_a_full_field():
    fitted, projected = ensembles(10.0, across=13, runs=300)
    field, disc = (s.var(axis=1).std(axis=0) / s.var(axis=1).mean(axis=0) for s in (fitted, projected))
    assert field[1:] == pytest.approx(disc[1:], rel=0.2)  # shears: the same
    assert 0.6 < field[0] / disc[0] < 1.0  # v: more, since no point of the disc has a fixed amplitude


def test_speeds_that_are_nearly_equal_have_turbulence_of_their_own():
    """One seed at 8.0001 and 8.0002 m/s once was one turbulence twice."""
    for harmonics in (1, 6):
        one, other = (
            TurbulentWind(v, intensity=0.14, seed=1, duration=60.0, harmonics=harmonics).at(np.arange(60.0))[
                :, 0
            ]
            for v in (8.0001, 8.0002)
        )
        assert abs(np.corrcoef(one, other)[0, 1]) < 0.9
