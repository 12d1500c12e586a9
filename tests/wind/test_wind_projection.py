"""The projection of a field on blade-effective azimuthal harmonics, against fields whose harmonics are known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from field_files import write_bts

from fatigue_runner.errors import InputError
from fatigue_runner.wind.azimuth import fourier_rows, radial_shares, wind_at
from fatigue_runner.wind.fields import (
    WindField,
    harmonics_of,
    harmonics_of_uniform,
)
from fatigue_runner.wind.fields.turbsim import read_turbsim
from fatigue_runner.wind.fields.uniform import read_uniform
from fatigue_runner.wind.profiles import PowerLaw

HUB, RADIUS = 90.0, 60.0
RADII = np.linspace(5.0, 60.0, 12)
WEIGHT = RADII**2
ROTOR = HUB, RADIUS, RADII, WEIGHT


def field(of, *, points=61, nt=30, periodic=False, mean=10.0, time_step=0.5, upstream=0.0, profile=None):
    """A field on 140 m x 140 m with u = mean + of(t, y, z), y and z from the hub."""
    axis = np.linspace(-70.0, 70.0, points)
    t = time_step * np.arange(nt)[:, None, None]
    u = mean + of(t, axis[None, :, None], axis[None, None, :]) * np.ones((nt, points, points))
    common = {"mean_speed": mean, "reference_height": HUB, "periodic": periodic, "upstream": upstream}
    return WindField(
        time_step, axis, axis + HUB, u.astype(np.float32), source=Path("x.bts"), profile=profile, **common
    )


def mean_radius(power=1):
    return (WEIGHT @ RADII**power) / WEIGHT.sum()


def test_linear_shears_are_the_first_harmonic_with_the_signs_of_the_equations():
    """v (1 + kappa_v z/R + kappa_h y/R) = v (1 + kappa_v rho cos psi - kappa_h rho sin psi)."""
    kv, kh = 0.14, -0.06
    found = harmonics_of(field(lambda t, y, z: 10 * (kv * z + kh * y) / RADIUS), *ROTOR, 3)
    expected = [10, 10 * kv * mean_radius() / RADIUS, -10 * kh * mean_radius() / RADIUS, 0, 0, 0, 0]
    assert found.amplitudes == pytest.approx(np.tile(expected, (30, 1)), abs=1e-5)
    assert found.disc == pytest.approx(np.tile([10, 10 * kv, 10 * kh], (30, 1)), abs=1e-4)


def test_a_blade_to_the_left_looking_downwind_sees_the_wind_on_the_left():
    found = harmonics_of(field(lambda t, y, z: 0.01 * y), *ROTOR, 1)
    at_left, at_right = wind_at(found.amplitudes[0], np.radians([270.0, 90.0]))  # y = -r sin(psi)
    assert at_left == pytest.approx(10 + 0.01 * mean_radius(), abs=1e-4)
    assert at_right == pytest.approx(10 - 0.01 * mean_radius(), abs=1e-4)


@pytest.mark.parametrize("m", [2, 3, 4])
def test_a_harmonic_field_has_its_own_amplitudes_only(m):
    """u = Re (a - i b) (z + i y')^m / R^m with y' = -y is rho^m (a cos m psi + b sin m psi)."""
    a, b = 0.7, -0.4

    def of(t, y, z):
        return ((a - 1j * b) * ((z - 1j * y) / RADIUS) ** m).real

    found = harmonics_of(field(of, points=141), *ROTOR, 6).amplitudes[0]
    share = mean_radius(m) / RADIUS**m
    expected = np.zeros(13)
    expected[[0, 2 * m - 1, 2 * m]] = 10, a * share, b * share
    assert found == pytest.approx(expected, abs=5e-4)


def test_the_amplitudes_are_the_fourier_analysis_of_the_interpolated_field():
    """A rough field, sampled point by point as OpenFAST interpolates it: no matrix, no shared code."""
    rng = np.random.default_rng(3)
    rough = rng.normal(0, 1, (15, 15))
    axis = np.linspace(-70.0, 70.0, 15)
    rough_field = field(lambda t, y, z: rough * np.cos(2 * np.pi * t), points=15)  # 1, -1, 1, -1, ...
    psi = 2 * np.pi * (np.arange(3600) + 0.5) / 3600
    around = np.zeros(3600)
    for r, g in zip(RADII, WEIGHT / WEIGHT.sum(), strict=True):
        y, z = -r * np.sin(psi), r * np.cos(psi)
        j, k = np.searchsorted(axis, y) - 1, np.searchsorted(axis, z) - 1
        b, c = (y - axis[j]) / 10.0, (z - axis[k]) / 10.0
        upper = rough[j, k + 1] * (1 - b) + rough[j + 1, k + 1] * b
        around += g * ((rough[j, k] * (1 - b) + rough[j + 1, k] * b) * (1 - c) + upper * c)
    expected = [around.mean()] + [
        2 * (around * wave(m * psi)).mean() for m in range(1, 7) for wave in (np.cos, np.sin)
    ]
    found = harmonics_of(rough_field, *ROTOR, 6).amplitudes[0] - [10, *[0] * 12]
    assert found == pytest.approx(expected, abs=1e-3)


def test_the_disc_fit_is_the_least_squares_plane_over_the_area():
    def of(t, y, z):
        return np.sin(y / 31.0 + 0.3) + np.cos(z / 23.0) * y / 60.0 + (z / 50.0) ** 3

    axis = (np.arange(-300, 300) + 0.5) * 0.2
    y, z = (g.ravel() for g in np.meshgrid(axis, axis, indexing="ij"))
    inside = y**2 + z**2 < RADIUS**2
    y, z = y[inside], z[inside]
    planes = np.stack([np.ones_like(y), z / RADIUS, y / RADIUS], axis=1)
    expected = np.linalg.lstsq(planes, of(0.0, y, z), rcond=None)[0] + [10, 0, 0]
    found = harmonics_of(field(of, points=281), *ROTOR, 0).disc[0]
    assert found == pytest.approx(expected, abs=2e-3)


def test_no_harmonics_leave_the_mean_along_the_blade():
    found = harmonics_of(field(lambda t, y, z: (z / 60.0) ** 2), *ROTOR, 0)
    assert found.amplitudes.shape == (30, 1)
    assert found.amplitudes[0, 0] == pytest.approx(10 + mean_radius(2) / RADIUS**2 / 2, abs=2e-3)


def test_the_scale_of_the_weights_does_not_matter():
    rough = field(lambda t, y, z: np.sin(y / 20.0) * np.cos(z / 15.0 + t))
    once = harmonics_of(rough, HUB, RADIUS, RADII, WEIGHT, 3).amplitudes
    again = harmonics_of(rough, HUB, RADIUS, RADII, 1e6 * WEIGHT, 3).amplitudes
    assert again == pytest.approx(once)


# --- time --------------------------------------------------------------------------------------------------------------


def test_the_rotor_sees_the_field_when_it_arrives_as_in_openfast(tmp_path):
    """Field time t + (W/2 - x) / U for a field that is not periodic: TurbSim's of 60 m width, x = -5 m."""
    t = 0.25 * np.arange(200)
    u = 9.0 + np.sin(0.7 * t)[:, None, None] * np.ones((200, 7, 7))
    read = read_turbsim(write_bts(tmp_path / "a.bts", u, spacing=(10.0, 10.0)))
    found = harmonics_of(read, 50.0, 25.0, [20.0], [1.0], 1, x=-5.0)
    assert found.start == pytest.approx(-35 / 9)
    amplitudes, disc, _ = found.sampled(40.0)
    run = 0.25 * np.arange(161)
    assert amplitudes[:, 0] == pytest.approx(9 + np.sin(0.7 * (run + 35 / 9)), abs=1e-3)
    assert disc[:, 0] == pytest.approx(amplitudes[:, 0], abs=1e-4)


def test_a_run_longer_than_the_field_is_refused():
    found = harmonics_of(field(lambda t, y, z: 0.0, upstream=70.0), *ROTOR, 1, x=-5.0)
    assert found.end == pytest.approx(29 * 0.5 - 7.5)
    found.sampled(7.0)
    with pytest.raises(
        InputError, match=r"x\.bts: the field passes the rotor from -7.5 to 7 s of the run, which"
    ):
        found.sampled(7.1)


def test_a_plane_that_the_field_has_not_reached_at_the_start_is_refused():
    found = harmonics_of(field(lambda t, y, z: 0.0, upstream=0.0), *ROTOR, 1, x=5.0)
    with pytest.raises(InputError, match=r"passes the rotor from 0\.5 to 15 s of the run"):
        found.sampled(2.0)


def test_a_periodic_field_goes_round_but_lasts_one_period():
    omega = 2 * np.pi / 15.0
    wave = field(lambda t, y, z: np.sin(omega * t), periodic=True)
    found = harmonics_of(wave, *ROTOR, 1, x=-20.0)
    assert found.end == 15.0
    run = 0.5 * np.arange(31)
    assert found.sampled(15.0)[0][:, 0] == pytest.approx(10 + np.sin(omega * (run + 2.0)), abs=2e-4)
    with pytest.raises(InputError, match="make the field longer"):
        found.sampled(15.2)


@pytest.mark.parametrize("periodic", [True, False])
def test_a_leaning_rotor_meets_a_gust_at_the_bottom_first(periodic):
    """An upwind rotor tilted by -5 degrees: the top is (z - hub) tan 5 deg farther downwind and as much later."""
    omega, tilt = 2 * np.pi / 15.0, np.radians(-5.0)
    wave = field(lambda t, y, z: np.sin(omega * t), periodic=periodic, time_step=0.05, nt=300)
    found = harmonics_of(wave, HUB, RADIUS, [50.0], [1.0], 2, tilt=tilt)
    values = found.sampled(10.0)[0] if found.start <= 0 else found.amplitudes
    run = 0.05 * np.arange(len(values)) + max(found.start, 0.0)
    psi = np.radians(np.arange(0, 360, 30.0))
    arrival = 50.0 * np.cos(psi) * np.tan(tilt) / 10.0
    expected = 10 + np.sin(omega * (run[:, None] + arrival))
    inner = slice(5, -5)
    assert wind_at(values, psi)[inner] == pytest.approx(expected[inner], abs=2e-3)


# --- mean profiles that go on between the grid's heights -------------------------------------------------------------------


def test_a_profile_goes_on_between_coarse_heights_where_the_reader_adds_it_there():
    profile = PowerLaw(0.2)

    def of(t, y, z):
        return 10 * (profile.factor(z + HUB, HUB) - 1)

    exact = harmonics_of(field(of, points=281), *ROTOR, 4).amplitudes[0]
    coarse = harmonics_of(field(of, points=6, profile=profile), *ROTOR, 4)
    linear = harmonics_of(field(of, points=6), *ROTOR, 4).amplitudes[0]
    assert coarse.amplitudes[0] == pytest.approx(exact, abs=2e-4)
    assert np.abs(linear - exact).max() > 5e-3


def test_harmonics_finer_than_the_grid_are_told():
    coarse = field(lambda t, y, z: 0.0, points=5)
    assert harmonics_of(coarse, *ROTOR, 3).notes == ()
    (note,) = harmonics_of(coarse, *ROTOR, 6).notes
    assert "points every 35 m hold azimuthal harmonics up to 4" in note


# --- uniform wind ------------------------------------------------------------------------------------------------------

UNIFORM = """0.0 8.0 -10 0.3 0.10 0.20 -0.05 0.0 2.0
1.0 10.0 20 0.3 -0.1 0.10 0.02 1.0 -3.0
2.0 11.0 20 0.3 0.1 0.30 0.05 0.0 1.0
3.0 9.0 20 0.0 0.1 0.30 0.05 0.0 1.0
"""


def test_uniform_wind_has_the_amplitudes_of_its_points(tmp_path):
    path = tmp_path / "a.hh"
    path.write_text(UNIFORM)
    wind = read_uniform(path, 88.0, 126.0)
    found = harmonics_of_uniform(wind, *ROTOR, 4, duration=5.0, x=-5.0, time_step=0.25)
    assert found.amplitudes.shape == (21, 9) and found.end == 5.0
    time, psi = 0.25 * np.arange(21), 2 * np.pi * np.arange(24) / 24
    around = np.zeros((21, 24))
    for r, g in zip(RADII, WEIGHT / WEIGHT.sum(), strict=True):
        for i, p in enumerate(psi):
            around[:, i] += g * wind.longitudinal(time, -5.0, -r * np.sin(p), HUB + r * np.cos(p))
    basis = fourier_rows(psi, 4).T
    expected = np.linalg.lstsq(basis, around.T, rcond=None)[0].T
    assert found.amplitudes == pytest.approx(expected, abs=1e-4)


def test_the_disc_fit_of_uniform_wind_is_its_mean_and_slopes(tmp_path):
    path = tmp_path / "a.hh"
    path.write_text("0 10 0 0 0.1 0 0.2 0.5\n1 10 0 0 0.1 0 0.2 0.5\n")
    found = harmonics_of_uniform(read_uniform(path, HUB, 2 * RADIUS), *ROTOR, 1, duration=1.0)
    assert found.disc == pytest.approx(np.tile([10.5, 1.0, 0.5], (len(found.disc), 1)))


def test_an_exponent_that_changes_at_every_line_costs_no_accuracy(tmp_path):
    path = tmp_path / "a.hh"
    exponents = 0.2 + 0.15 * np.sin(np.arange(60.0))
    path.write_text("\n".join(f"{i} 10 0 0 0 {e:.9f} 0 0" for i, e in enumerate(exponents)))
    wind = read_uniform(path, HUB, 126.0)
    found = harmonics_of_uniform(wind, *ROTOR, 3, duration=59.0, time_step=1.0)
    for i in (0, 17, 42):
        one = replace(wind, time=np.zeros(1), values=wind.values[i : i + 1])
        alone = harmonics_of_uniform(one, *ROTOR, 3, duration=1.0)
        assert found.amplitudes[i] == pytest.approx(alone.amplitudes[0], abs=1e-7)


def test_lines_at_uneven_times_are_sampled_finely(tmp_path):
    path = tmp_path / "a.hh"
    path.write_text("0 10 0 0 0 0 0 0\n50 10 0 0 0 0 0 0\n50.1 12 0 0 0 0 0 0\n")
    found = harmonics_of_uniform(read_uniform(path, HUB, 126.0), *ROTOR, 1, duration=60.0)
    assert found.time_step == 0.05
    assert found.amplitudes[[1000, 1001, 1002, 1200], 0] == pytest.approx([10, 11, 12, 12])


# --- what is refused ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rotor", "complaint"),
    [
        ((90.0, 75.0), "but the rotor needs 15 to 165 m and 75 m to each side; make the field wider"),
        ((100.5, 60.0), "but the rotor needs 40.5 to 160.5 m"),
        ((92.0, 60.0), "made for a hub at 90 m, but the turbine's is at 92 m"),
    ],
)
def test_a_field_that_does_not_fit_the_rotor_is_refused(rotor, complaint):
    with pytest.raises(InputError, match=complaint):
        harmonics_of(field(lambda t, y, z: 0.0), *rotor, [10.0], [1.0], 1)


@pytest.mark.parametrize("harmonics", [-1, 46, 2.5, True, "three"])
def test_a_senseless_number_of_harmonics_is_refused(harmonics):
    with pytest.raises(InputError, match="harmonics must be a whole number from 0 to 45"):
        harmonics_of(field(lambda t, y, z: 0.0), *ROTOR, harmonics)


@pytest.mark.parametrize(
    ("radii", "weight", "complaint"),
    [
        ([1.0, 2.0], [1.0], "one weight per radius"),
        ([1.0, 61.0], [1.0, 1.0], "radius 1 is 61 m, but the rotor reaches from 0 to 60 m"),
        ([1.0, np.nan], [1.0, 1.0], "radius 1 is nan m"),
        ([1.0, 2.0], [1.0, -1.0], "add up to 0"),
        ([1.0, 2.0], [1.0, np.nan], "add up to nan"),
    ],
)
def test_senseless_weights_are_refused(radii, weight, complaint):
    with pytest.raises(InputError, match=complaint):
        radial_shares(radii, weight, 60.0)
