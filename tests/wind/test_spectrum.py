"""The standard's extreme turbulence and the von Karman spectrum with the coherence that belongs to it."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import j0

from fatigue_runner.errors import InputError
from fatigue_runner.fatigue.climate import IEC_REFERENCE_SPEED
from fatigue_runner.wind import spectrum


@pytest.mark.parametrize(
    ("turbulence", "wind", "mean", "sigma"),
    [
        # By hand, IEC 61400-1:2005 (19): c I_ref (0.072 (V_ave/c + 3) (V/c - 4) + 10), c = 2 m/s.
        ("A", "I", 8.0, 2 * 0.16 * 10),
        ("A", "I", 10.0, 2 * 0.16 * (0.072 * 8 * 1 + 10)),
        ("B", "II", 24.0, 2 * 0.14 * (0.072 * 7.25 * 8 + 10)),
        ("C", "III", 4.0, 2 * 0.12 * (0.072 * 6.75 * -2 + 10)),
        ("A+", "I", 25.0, 2 * 0.18 * (0.072 * 8 * 8.5 + 10)),
    ],
)
def test_extreme_turbulence_follows_equation_19(turbulence, wind, mean, sigma):
    assert spectrum.extreme_turbulence_sigma(turbulence, wind, mean) == pytest.approx(sigma, rel=1e-12)


def test_extreme_turbulence_exceeds_normal_turbulence_most_in_low_wind():
    excess = [
        spectrum.extreme_turbulence_sigma("B", "I", v) / spectrum.normal_turbulence_sigma("B", v)
        for v in (4.0, 8.0, 12.0, 18.0, 24.0)
    ]
    assert excess == sorted(excess, reverse=True) and excess[-1] > 1.2


def test_wind_classes_have_the_reference_speeds_of_the_lifetime_climates():
    assert {c.name: c.reference_speed for c in spectrum.WIND_CLASSES.values()} == IEC_REFERENCE_SPEED
    assert spectrum.wind_class("II").average_speed == pytest.approx(8.5)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: spectrum.wind_class("ii"), "unknown wind class 'ii'; did you mean 'II'"),
        (lambda: spectrum.wind_class(1), "unknown wind class 1"),
        (lambda: spectrum.turbulence_spectrum("von Karman"), "did you mean 'von-karman'"),
        (lambda: spectrum.turbulence_spectrum(None), "known: kaimal, von-karman"),
    ],
)
def test_an_unknown_name_is_refused_with_the_nearest(call, message):
    with pytest.raises(InputError, match=message):
        call()


@pytest.mark.parametrize("model", spectrum.SPECTRA.values(), ids=lambda model: model.name)
@pytest.mark.parametrize("height", [90.0, 40.0])
def test_both_spectra_have_the_inertial_subrange_that_the_standard_demands(model, height):
    # IEC 61400-1:2005 (6): 0.05 sigma^2 (Lambda_1/V)^(-2/3) f^(-5/3).
    f, scale = 50.0, model.length_scale(height)
    level = model.variance(f * 0.999, f * 1.001, 10.0, scale) / (2e-3 * f)
    expected = 0.05 * (spectrum.turbulence_scale(height) / 10.0) ** (-2 / 3) * f ** (-5 / 3)
    assert level == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(("low", "high"), [(0.0, 1e-3), (1e-3, 2e-3), (0.05, 0.06), (0.5, 2.0)])
def test_the_von_karman_variance_is_the_integral_of_its_spectrum(low, high):
    def density(f):
        reduced = f * 147.0 / 8.0  # f S / sigma^2 = 4 n / (1 + 71 n^2)^(5/6)
        return 4 * 147.0 / 8.0 / (1 + 71 * reduced**2) ** (5 / 6)

    expected = quad(density, low, high, epsabs=0, epsrel=1e-11)[0]
    assert spectrum.von_karman_variance(low, high, 8.0, 147.0) == pytest.approx(expected, rel=1e-9)


def test_all_of_the_von_karman_spectrum_is_nearly_sigma_squared():
    assert spectrum.von_karman_variance(0.0, 1e9, 8.0, 147.0) == pytest.approx(0.9985, abs=1e-4)


@pytest.mark.parametrize("x", [0.05, 0.4, 1.0, 2.0, 3.4, 6.0])
def test_the_isotropic_coherence_follows_from_the_energy_spectrum(x):
    # Phi_11 = E(k) (k^2 - k_1^2) / (4 pi k^4) with E ~ k^4 / (b_0^2 + k^2)^(17/6): over the plane across the wind,
    # coh(r b) = int t^3 J_0(r b t) (1 + t^2)^(-17/6) dt / int t^3 (1 + t^2)^(-17/6) dt, b^2 = b_0^2 + k_1^2.
    def part(t, wave):
        return t**3 * (1 + t**2) ** (-17 / 6) * wave(x * t)

    zeros = np.pi * (np.arange(0, 4000) + 0.75) / x  # near those of J_0, between which the sign alternates
    pieces = [quad(part, low, high, args=(j0,))[0] for low, high in zip([0, *zeros], zeros, strict=False)]
    sums = np.cumsum(pieces)
    whole = quad(part, 0, np.inf, args=(np.ones_like,))[0]
    assert (sums[-1] + sums[-2]) / 2 / whole == pytest.approx(
        float(spectrum.isotropic_coherence(x)), abs=1e-5
    )


def test_the_isotropic_coherence_is_one_at_no_distance_and_negative_far_away():
    x = np.linspace(0, 20, 4001)
    coherence = spectrum.isotropic_coherence(x)
    assert coherence[0] == pytest.approx(1.0, abs=1e-12)
    assert x[np.argmax(coherence < 0)] == pytest.approx(2.27, abs=0.01)
    assert coherence.min() == pytest.approx(-0.0371, abs=1e-4)
    assert np.all(np.isfinite(spectrum.isotropic_coherence(np.array([0.0, 1e3, 1e6]))))
