"""Readers and projection against OpenFAST 5.0.0: what its InflowWind reads, and its fields projected elsewhere.

The data lie beside the checkout (`places.SHARED`) and are not part of it; without them these tests are skipped.
"""

from __future__ import annotations

import numpy as np
import pytest
from places import SHARED

from fatigue_runner.wind.fields import MannBox, UniformWind, harmonics_of, read_wind
from fatigue_runner.wind.profiles import PowerLaw, profile_amplitudes, profile_disc_fit

DATA = SHARED / "openfast_operation"
SMALL = DATA / "small_files"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason=f"OpenFAST's results are not at {DATA}")

POINTS = [(0, 0, 90), (-5, 0, 90), (0, 30, 90), (0, -30, 90), (0, 0, 130), (0, 0, 50), (-5, 44, 134)]
POINTS += [(-2.5, -20, 100), (3, 10, 70)]
# TurbSim's box is normalised (its .hawc names the factor) and InflowWind was given the mean profile and an XOffset
BOX = MannBox(10.0, 90.0, profile=PowerLaw(0.2), scale=1.834, upstream=72.5)


def wind_at_point(wind, time, x, y, z):
    """As OpenFAST interpolates: linear between the grid's points and times, the profile added afterwards."""
    if isinstance(wind, UniformWind):
        return wind.longitudinal(time, x, y, z)
    u = wind.u.astype(float)
    if wind.profile is not None:
        u = u - wind.mean_speed * wind.profile.factor(wind.z, wind.reference_height)
    j, k = np.searchsorted(wind.y, y, side="right") - 1, np.searchsorted(wind.z, z, side="right") - 1
    b = (y - wind.y[j]) / (wind.y[1] - wind.y[0])
    c = (z - wind.z[k]) / (wind.z[1] - wind.z[0])
    corners = u[:, j : j + 2, k : k + 2]
    series = np.einsum("tyz,y,z->t", corners, [1 - b, b], [1 - c, c])
    when = time + wind.delay(x)
    if wind.periodic:
        series, when = np.append(series, series[0]), when % wind.length
    found = np.interp(when, wind.time_step * np.arange(len(series)), series)
    if wind.profile is not None:
        found = found + wind.mean_speed * wind.profile.factor(np.array(z), wind.reference_height)
    return found


@pytest.mark.parametrize("point", range(9))
@pytest.mark.parametrize(("form", "box"), [("bts", None), ("wnd", None), ("hawc", BOX), ("hh", None)])
def test_every_format_is_read_to_the_last_digit_that_inflowwind_prints(form, box, point):
    wind = read_wind(SMALL / f"small.{form}", hub_height=90.0, rotor_diameter=1.0, box=box)
    table = np.loadtxt(SMALL / f"inflowwind_points_{form}.csv", delimiter=",", skiprows=2)
    found = wind_at_point(wind, table[:, 0], *POINTS[point])
    assert np.abs(found - table[:, 1 + 3 * point]).max() < 6e-5


def rotor(power):
    """Nodes of a weight (r/R)^power on the 5 MW."""
    x, w = np.polynomial.legendre.leggauss(24)
    radii = 31.5 * (1 + x)
    return 90.0, 63.0, radii, w * radii**power


@pytest.mark.parametrize("speed", ["08", "18"])
@pytest.mark.parametrize("weight", ["r07", "f2", "f3"])
def test_the_projection_of_a_turbsim_field_is_that_made_elsewhere(speed, weight):
    """OpenFAST's field at x = -5 m, projected by another program, with linear interpolation in time as OpenFAST's.

    The other's numbers are rounded to a half-precision digit (0.004 m/s at 8 m/s).
    """
    field = read_wind(DATA / f"ntmB_U{speed}_s1.bts", hub_height=90.0, rotor_diameter=126.0)
    disc = (90.0, 63.0, [0.7 * 63], [1.0]) if weight == "r07" else rotor(int(weight[1]))
    found = harmonics_of(field, *disc, 3, x=-5.0)
    modes = np.load(DATA / f"ntmB_U{speed}_s1_modes.npz")
    own = found.start + found.time_step * np.arange(len(found.amplitudes))
    run = float(modes["dt"]) * np.arange(len(modes["u0"]))
    names = [f"{weight}_{name}" for name in ("a0", "a1", "b1", "a2", "b2", "a3", "b3")]
    pairs = [(modes[name], found.amplitudes[:, i]) for i, name in enumerate(names)]
    pairs += [(modes["u0"], found.disc[:, 0])]
    pairs += [(63 * modes[name], found.disc[:, i]) for i, name in ((1, "gz"), (2, "gy"))]
    for expected, series in pairs:
        there = np.interp(run, own, series)
        assert np.sqrt(np.mean((there - expected) ** 2)) < 0.012 * expected.std()
        assert there.std() == pytest.approx(expected.std(), rel=4e-3)


@pytest.mark.parametrize("speed", [8.0, 18.0])
def test_the_mean_of_a_turbsim_field_is_its_power_law(speed):
    """No point has a mean of its own over the whole field, so the amplitudes' means are the profile's."""
    field = read_wind(DATA / f"ntmB_U{speed:02.0f}_s1.bts", hub_height=90.0, rotor_diameter=126.0)
    found = harmonics_of(field, *rotor(2), 3)
    expected = speed * profile_amplitudes(PowerLaw(0.2), *rotor(2)[0:1], *rotor(2)[2:], 3)
    assert found.amplitudes.mean(axis=0) == pytest.approx(expected, abs=0.004 * speed)
    fit = speed * profile_disc_fit(PowerLaw(0.2), 90.0, 63.0)
    assert found.disc.mean(axis=0) == pytest.approx(fit, abs=0.004 * speed)
