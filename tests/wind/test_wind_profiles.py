"""Mean shear and tower influence by their azimuthal harmonics, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from fatigue_runner.errors import InputError
from fatigue_runner.wind.azimuth import wind_at
from fatigue_runner.wind.profiles import (
    Logarithmic,
    PowerLaw,
    Tower,
    profile_amplitudes,
    profile_disc_fit,
    tower_amplitudes,
    tower_deficit,
)

HUB = 90.0
RADII = np.linspace(3.0, 63.0, 11)
WEIGHT = RADII**2
SHARE = WEIGHT / WEIGHT.sum()


def binomial_amplitude(exponent, ratio, m, terms=60):
    """c_m of (1 + ratio cos psi)^exponent by the binomial series and the mean of cos^n psi cos(m psi)."""
    total, coefficient = 0.0, 1.0
    for n in range(terms):
        if n >= m and (n - m) % 2 == 0:
            total += coefficient * ratio**n * math.comb(n, (n - m) // 2) / 2**n * (1 if m == 0 else 2)
        coefficient *= (exponent - n) / (n + 1)
    return total


@pytest.mark.parametrize("exponent", [0.2, 0.14, -0.1, 0.5])
def test_a_power_law_has_the_harmonics_of_its_binomial_series(exponent):
    found = profile_amplitudes(PowerLaw(exponent), HUB, RADII, WEIGHT, 6)
    expected = [
        sum(g * binomial_amplitude(exponent, r / HUB, m) for r, g in zip(RADII, SHARE, strict=True))
        for m in range(7)
    ]
    assert found[[0, 1, 3, 5, 7, 9, 11]] == pytest.approx(expected, abs=1e-9)
    assert (found[2::2] == 0).all()


def test_a_logarithmic_profile_has_the_harmonics_of_its_fourier_series():
    """ln(1 + e cos psi) = ln((1 + q)/2) + sum of 2 (-1)^(m+1) b^m/m cos(m psi), q^2 = 1 - e^2, b = (1 - q)/e."""
    z0, radius = 0.03, 50.0
    e = radius / HUB
    q = math.sqrt(1 - e * e)
    scale = 1 / math.log(HUB / z0)
    expected = [1 + scale * math.log((1 + q) / 2)]
    expected += [scale * 2 * (-1) ** (m + 1) * ((1 - q) / e) ** m / m for m in range(1, 7)]
    found = profile_amplitudes(Logarithmic(z0), HUB, [radius], [1.0], 6)
    assert found[[0, 1, 3, 5, 7, 9, 11]] == pytest.approx(expected, abs=1e-12)


def test_an_exponent_of_one_is_a_linear_shear_and_of_zero_none():
    linear = profile_amplitudes(PowerLaw(1.0), HUB, RADII, WEIGHT, 3)
    assert linear == pytest.approx([1, SHARE @ RADII / HUB, 0, 0, 0, 0, 0], abs=1e-12)
    assert profile_amplitudes(PowerLaw(0.0), HUB, RADII, WEIGHT, 1) == pytest.approx([1, 0, 0], abs=1e-12)


def test_the_profile_holds_at_its_reference_height():
    at_hub = profile_amplitudes(PowerLaw(0.2), HUB, RADII, WEIGHT, 3)
    at_ten = profile_amplitudes(PowerLaw(0.2), HUB, RADII, WEIGHT, 3, reference_height=10.0)
    assert at_ten == pytest.approx(at_hub * 9.0**0.2)


def test_the_disc_fit_of_a_profile_is_its_least_squares_plane():
    axis = np.arange(-62.75, 63, 0.5)
    y, z = (g.ravel() for g in np.meshgrid(axis, axis))
    inside = y**2 + z**2 < 63.0**2
    planes = np.stack([np.ones(inside.sum()), z[inside] / 63, y[inside] / 63], axis=1)
    wind = ((HUB + z[inside]) / HUB) ** 0.2
    expected = np.linalg.lstsq(planes, wind, rcond=None)[0]
    assert profile_disc_fit(PowerLaw(0.2), HUB, 63.0) == pytest.approx(expected, abs=2e-4)
    assert profile_disc_fit(PowerLaw(1.0), HUB, 63.0) == pytest.approx([1, 0.7, 0], abs=1e-12)


# --- tower -------------------------------------------------------------------------------------------------------------

TOWER = Tower([0.0, 87.6], [6.0, 3.87])
TILT, CONE = np.radians([-5.0, -2.5])


def test_the_tower_deficit_is_the_flow_around_a_cylinder():
    """dw/dzeta = 1 - a^2/zeta^2 for a cylinder of radius a in a uniform stream."""
    tower = Tower([0.0, 100.0], [4.0, 4.0])
    rng = np.random.default_rng(5)
    x, y = rng.uniform(3, 30, 50) * rng.choice([-1, 1], 50), rng.uniform(-30, 30, 50)
    expected = -((2.0 / (x + 1j * y)) ** 2).real
    assert tower_deficit(tower, x, y, np.full(50, 40.0)) == pytest.approx(expected)


def test_the_tower_stops_the_wind_at_its_front_and_speeds_it_up_at_its_sides():
    x, y = np.array([-1.5001, 0.0]), np.array([0.0, 1.5001])
    tower = Tower([0.0, 100.0], [3.0, 3.0])
    assert tower_deficit(tower, x, y, np.array([40.0, 40.0])) == pytest.approx([-1, 1], abs=1e-3)


def test_there_is_no_tower_a_radius_above_its_top():
    heights = np.array([87.5, 88.0, 87.6 + 1.935, 95.0])
    found = tower_deficit(TOWER, np.full(4, -5.0), np.zeros(4), heights)
    assert found[0] < found[1] < 0 and found[2:] == pytest.approx([0, 0], abs=1e-12)


def test_many_harmonics_of_the_tower_add_up_to_the_deficit_along_the_blade():
    amplitudes = tower_amplitudes(TOWER, HUB, -5.0, RADII, WEIGHT, 45, tilt=TILT, cone=CONE)
    psi = np.radians(np.arange(0.0, 360.0, 7.0))
    expected = np.zeros(len(psi))
    for r, g in zip(RADII, SHARE, strict=True):
        for i, p in enumerate(psi):
            hub = np.array([0.0, -np.sin(p) * np.cos(CONE), np.cos(p) * np.cos(CONE)]) * r
            hub[0] = r * np.sin(CONE)  # along the shaft, downwind
            c, s = np.cos(TILT), np.sin(TILT)
            x, z = c * hub[0] - s * hub[2], s * hub[0] + c * hub[2]
            expected[i] += g * tower_deficit(TOWER, np.array(x - 5.0), np.array(hub[1]), np.array(HUB + z))
    assert wind_at(amplitudes, psi) == pytest.approx(expected, abs=1e-3)
    assert wind_at(amplitudes, np.array([np.pi]))[0] < -0.04
    assert (amplitudes[2::2] == 0).all()


def test_fewer_harmonics_are_the_first_of_more():
    few = tower_amplitudes(TOWER, HUB, -5.0, RADII, WEIGHT, 3, tilt=TILT, cone=CONE)
    many = tower_amplitudes(TOWER, HUB, -5.0, RADII, WEIGHT, 12, tilt=TILT, cone=CONE)
    assert many[:7] == pytest.approx(few, abs=1e-15)


def test_tilt_and_cone_keep_the_blade_clear_of_the_tower():
    clear = tower_amplitudes(TOWER, HUB, -5.0, RADII, WEIGHT, 20, tilt=TILT, cone=CONE)
    close = tower_amplitudes(TOWER, HUB, -5.0, RADII, WEIGHT, 20)
    assert wind_at(close, np.array([np.pi])) < 2 * wind_at(clear, np.array([np.pi]))


def test_the_deficit_scales_with_the_wind_at_the_tower():
    lower = Tower([0.0, 40.0], [6.0, 6.0])  # only the blade that hangs down passes it
    uniform = tower_amplitudes(lower, HUB, -5.0, [60.0], [1.0], 30)
    sheared = tower_amplitudes(lower, HUB, -5.0, [60.0], [1.0], 30, profile=PowerLaw(0.2))
    ratio = wind_at(sheared, np.array([np.pi])) / wind_at(uniform, np.array([np.pi]))
    assert ratio == pytest.approx((30 / HUB) ** 0.2, rel=0.01)


# --- what is refused ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "complaint"),
    [
        (lambda: PowerLaw(2.0), "shear exponent must be a number at least -1 and at most 1"),
        (lambda: Logarithmic(0.0), "roughness length must be a number above 0 m"),
        (lambda: Logarithmic(95.0).factor(np.ones(1), HUB), "does not lie above the roughness length"),
        (lambda: profile_amplitudes(PowerLaw(0.2), 60.0, RADII, WEIGHT, 3), "reaches into the ground"),
        (lambda: profile_disc_fit(PowerLaw(0.2), 60.0, 63.0), "reaches into the ground"),
        (lambda: Tower([0.0], [6.0]), "at least two heights"),
        (lambda: Tower([0.0, 0.0], [6.0, 4.0]), "heights must rise"),
        (lambda: Tower([0.0, 80.0], [6.0, 0.0]), "diameters must be positive"),
        (lambda: tower_amplitudes(TOWER, HUB, -1.0, RADII, WEIGHT, 3), "the blade meets the tower at height"),
    ],
)
def test_what_cannot_be_is_refused(make, complaint):
    with pytest.raises(InputError, match=complaint):
        make()
