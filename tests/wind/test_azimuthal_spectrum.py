"""Spectra of the blade-effective azimuthal harmonics: brute force, closed-form limits, radial weights."""

import numpy as np
import pytest

from fatigue_runner.errors import InputError
from fatigue_runner.layout import MOST_HARMONICS
from fatigue_runner.wind import rotor_modes
from fatigue_runner.wind.azimuthal_spectrum import (
    LARGEST_DECAY,
    LEAST_DECAY,
    admittances,
    pair_weights,
)
from fatigue_runner.wind.radial_weight import DISC, RadialWeight
from fatigue_runner.wind.spectrum import exponential_coherence, isotropic_coherence

# The NREL 5 MW's, roughly: nothing at the hub, most at 0.9 R, nothing at the tip.
BLADE = RadialWeight((0.02, 0.2, 0.5, 0.75, 0.9, 0.96, 1.0), (0.0, 0.11, 1.0, 1.95, 2.25, 1.9, 0.0))
SQUARE = RadialWeight(tuple(np.linspace(0, 1, 41)), tuple(np.linspace(0, 1, 41) ** 2))
WEIGHTS = [BLADE, SQUARE]


def admittance(decay, weight=BLADE, harmonics=6, coherence=exponential_coherence):
    return admittances(np.array([decay]), weight, harmonics, coherence)[:, 0]


# The radial weight


def test_a_weight_is_normalised_whatever_its_scale():
    assert RadialWeight((0.0, 0.5, 1.0), (0, 7, 0)) == RadialWeight((0.0, 0.5, 1.0), (0, 1, 0))
    rho = np.linspace(0, 1, 20001)
    assert np.trapezoid(BLADE.at(rho), rho) == pytest.approx(1.0, abs=1e-6)


def test_the_rule_of_a_weight_integrates_polynomials():
    rho, shares = SQUARE.rule(3)
    assert shares.sum() == pytest.approx(1.0, abs=1e-14)
    assert shares @ rho == pytest.approx(SQUARE.mean_radius, abs=1e-14)
    assert SQUARE.mean_radius == pytest.approx(0.75, abs=3e-4)  # int 3 rho^3, but for the chords
    assert DISC.mean_radius == pytest.approx(2 / 3, abs=1e-14)


@pytest.mark.parametrize(
    ("radii", "density", "message"),
    [
        ((0.0, 1.0), (1.0,), "one density per radius"),
        ((0.5,), (1.0,), "one density per radius"),
        ((0.0, 0.7, 0.6), (1, 1, 1), "must rise"),
        ((0.0, 63.0), (1, 1), "1 or less, as r/R"),
        ((-0.1, 1.0), (1, 1), "must rise from 0"),
        ((0.0, float("nan"), 1.0), (1, 1, 1), "must rise"),
        ((0.0, 1.0), (1.0, float("nan")), "must be positive"),
        ((0.0, 1.0), (1.0, -1.0), "must be positive"),
        ((0.0, 1.0), (-1.0, -2.0), "must be positive"),
    ],
)
def test_a_weight_without_sense_is_refused(radii, density, message):
    with pytest.raises(InputError, match=message):
        RadialWeight(radii, density)


# H_m


def amplitude_rows(weight, orders, radii, angles):
    """Rows that make amplitudes of values at points on circles, the points, by a quadrature of their own."""
    x, w = np.polynomial.legendre.leggauss(radii)
    low, high = weight.radii[0], weight.radii[-1]
    rho = (low + high) / 2 + (high - low) / 2 * x
    share = w * weight.at(rho)
    share /= share.sum()
    psi = (np.arange(angles) + 0.5) * 2 * np.pi / angles
    rows = []
    for m, wave in orders:
        rows.append(np.outer(share, (1 if m == 0 else 2) * wave(m * psi) / angles).ravel())
    return np.array(rows), np.outer(rho, np.exp(1j * psi)).ravel()


@pytest.mark.parametrize("decay", [0.3, 1.0, 4.0])
@pytest.mark.parametrize("weight", WEIGHTS)
def test_the_spectral_matrix_is_diagonal_and_equals_the_sum_over_all_pairs_of_points(weight, decay):
    orders = [(0, np.cos)] + [(m, wave) for m in (1, 2, 3, 6) for wave in (np.cos, np.sin)]
    rows, point = amplitude_rows(weight, orders, radii=30, angles=60)
    matrix = rows @ np.exp(-decay * abs(point[:, None] - point)) @ rows.T
    expected = admittance(decay, weight)[[m for m, _ in orders]]
    # exp(-a s) has a kink of size a at distance zero, which limits the brute force.
    assert np.diag(matrix) == pytest.approx(expected, abs=1.5e-4 * decay)
    assert matrix - np.diag(np.diag(matrix)) == pytest.approx(np.zeros_like(matrix), abs=1e-12)


@pytest.mark.parametrize("weight", [*WEIGHTS, DISC])
@pytest.mark.parametrize("coherence", [exponential_coherence, isotropic_coherence])
def test_slow_eddies_reach_all_of_the_disc_alike(weight, coherence):
    shares = admittance(1e-7, weight, coherence=coherence)
    assert shares[0] == pytest.approx(1.0, abs=1e-5)
    assert np.all((shares[1:] > 0) & (shares[1:] < 1e-6))


@pytest.mark.parametrize("weight", WEIGHTS)
def test_eddies_much_smaller_than_the_disc_are_white_in_azimuth(weight):
    # Each point is correlated over an area of 2 pi / a^2: H -> 2 pi / a^2 int h^2 dA, h = g / (2 pi rho).
    rho = np.linspace(weight.radii[0] + 1e-9, 1, 100001)
    square = np.trapezoid(weight.at(rho) ** 2 / (2 * np.pi * rho), rho)
    for decay, rel in ((300.0, 2e-2), (1e5, 1e-4)):
        expected = 2 * np.pi * square / decay**2 * np.array([1, 2, 2, 2, 2, 2, 2])
        assert admittance(decay, weight) == pytest.approx(expected, rel=rel)


@pytest.mark.parametrize("decay", [0.3, 1.0, 4.0])
def test_all_harmonics_together_have_the_energy_of_a_blade_at_rest(decay):
    # w at one azimuth is the g-weighted mean along a line, of which no harmonic is left out.
    rho, share = BLADE.rule(12)
    line = share @ np.exp(-decay * abs(rho[:, None] - rho)) @ share
    shares = admittance(decay, harmonics=16)
    left_out = line - np.cumsum(shares)
    assert np.all(np.diff(left_out) < 0) and left_out[-1] > 0
    # Averaged over the radius, H_m falls as 1/m^3: the rest is about m/2 times the last share.
    assert left_out[-1] == pytest.approx(16 / 2 * shares[-1], rel=0.1)


def test_the_disc_mean_is_that_of_the_modes_of_the_disc():
    decay = np.geomspace(0.1, 1e3, 30)
    expected = rotor_modes.admittance(0, decay)
    assert admittances(decay, DISC, 0, exponential_coherence)[0] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("coherence", [exponential_coherence, isotropic_coherence])
def test_the_table_gives_back_the_integral(coherence):
    s, weights = pair_weights(BLADE, 6)
    decay = np.geomspace(1.1 * LEAST_DECAY, 0.9 * LARGEST_DECAY, 57)
    integral = weights @ coherence(np.multiply.outer(s, decay))
    assert admittances(decay, BLADE, 6, coherence) == pytest.approx(integral, rel=2e-6)


@pytest.mark.parametrize("end", [LEAST_DECAY, LARGEST_DECAY])
def test_the_table_goes_on_smoothly_beyond_its_ends(end):
    values = np.log(
        admittances(end * np.exp([-0.02, -0.01, 0.0, 0.01, 0.02]), BLADE, 3, exponential_coherence)
    )
    assert abs(np.diff(values, 2)).max() < 1e-4


def test_fewer_harmonics_are_the_first_of_more():
    decay = np.geomspace(0.1, 100, 9)
    few, many = (admittances(decay, BLADE, m, exponential_coherence) for m in (2, MOST_HARMONICS))
    assert many[:3] == pytest.approx(few, rel=1e-12)


@pytest.mark.parametrize("harmonics", [-1, MOST_HARMONICS + 1])
def test_a_number_of_harmonics_that_the_quadrature_cannot_do_is_refused(harmonics):
    with pytest.raises(InputError, match=f"0 to {MOST_HARMONICS} azimuthal harmonics, got {harmonics}"):
        admittance(1.0, harmonics=harmonics)
