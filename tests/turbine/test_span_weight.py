"""By which share each part of a blade feels the wind, against the rotor's loads as a whole."""

import numpy as np
import pytest

from fatigue_runner.errors import InputError
from fatigue_runner.turbine.aerodynamics import LOAD_NAMES, rotor_loads
from fatigue_runner.turbine.file import read_turbine_file
from fatigue_runner.turbine.span_weight import span_weight
from fatigue_runner.turbine.table_builder import turbine_blade

# Tip-speed ratio and pitch [deg] of the NREL 5 MW at 6, 8, 12, 18 and 24 m/s.
OPERATION = [(8.7, 0.0), (7.5, 0.0), (6.65, 3.41), (4.43, 14.79), (3.32, 21.95)]


@pytest.fixture(scope="module")
def blade():
    return turbine_blade(read_turbine_file("nrel5mw"))[0]


def mean_radius(weight):
    rho = np.linspace(0, 1, 40001)
    density = np.interp(rho, weight.radii, weight.density, left=0, right=0)
    return np.trapezoid(rho * density, rho)


@pytest.mark.parametrize(("tip_speed_ratio", "pitch_deg"), OPERATION)
@pytest.mark.parametrize("load", ["thrust", "torque"])
def test_a_linear_shear_acts_at_the_mean_radius_of_the_weight(blade, load, tip_speed_ratio, pitch_deg):
    # dL/d kappa of a wind V (1 + kappa r/R) over V dL/dV, from the loads of the whole blade. Small differences
    # here, those of the tables in the weight: stall makes the tolerance.
    pitch, row = np.radians(pitch_deg), LOAD_NAMES.index(load)

    def loads(wind, kappa=0.0):
        return wind**2 * rotor_loads(blade, tip_speed_ratio / wind, pitch, kappa)[row]

    shear = loads(1.0, 1e-4) - loads(1.0, -1e-4)
    uniform = loads(1 + 1e-4) - loads(1 - 1e-4)
    expected = shear / uniform * blade.rotor_radius / blade.tip_radius
    assert mean_radius(span_weight(blade, tip_speed_ratio, pitch, load)) == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize(("load", "radius"), [("flap_moment", 0.71), ("thrust", 0.63), ("torque", 0.67)])
def test_the_flap_moment_feels_the_wind_further_out_than_thrust_and_torque(blade, load, radius):
    weight = span_weight(blade, 7.5, 0.0, load)
    assert mean_radius(weight) == pytest.approx(radius, abs=0.005)
    assert np.trapezoid(weight.density, weight.radii) == pytest.approx(1.0, abs=1e-12)
    assert weight.radii[0] == pytest.approx(1.5 / 63) and weight.radii[-1] == 1.0


def test_the_weight_of_the_flap_moment_hardly_moves_with_the_operating_point(blade):
    means = [mean_radius(span_weight(blade, lam, np.radians(p))) for lam, p in OPERATION]
    assert max(means) - min(means) < 0.03


def test_an_unknown_load_and_a_stalled_rotor_are_refused(blade):
    with pytest.raises(InputError, match="unknown load 'trust'; did you mean 'thrust'"):
        span_weight(blade, 7.5, 0.0, "trust")
    with pytest.raises(InputError, match="pitch -5 deg the flap moment falls when the wind rises; take"):
        span_weight(blade, 3.0, np.radians(-5.0))
