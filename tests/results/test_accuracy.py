"""Errors of a trajectory against its reference: closed forms, the paper's figure, constant states."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fatigue_runner.channels import STATE_NAMES
from fatigue_runner.errors import InputError
from fatigue_runner.results.accuracy import Accuracy, compare
from fatigue_runner.trajectory import Trajectory

N = 401


def trajectory(state, time=None):
    time = np.linspace(0.0, 20.0, len(state)) if time is None else time
    return Trajectory(time=time, state=np.asarray(state, dtype=float), wind=np.zeros((len(state), 3)))


def a_reference():
    """Two periods of a sine of amplitude k + 1 in state k, and growing azimuths."""
    t = np.linspace(0.0, 20.0, N)
    state = np.sin(2 * np.pi * t / 10.0)[:, None] * np.arange(1.0, 17.0)
    state[:, STATE_NAMES.index("rotor_azimuth")] = math.pi / 3 + 1.0 * t
    state[:, STATE_NAMES.index("generator_azimuth")] = 97 * (math.pi / 3 + 1.0 * t)
    return trajectory(state)


def with_error(reference, error):
    return trajectory(reference.state + error, reference.time)


def test_a_trajectory_has_no_error_against_itself():
    reference = a_reference()
    assert set(compare(reference, reference).to_dict().values()) == {0.0}


def test_nrmse_is_the_rms_error_over_the_range_of_the_reference_state():
    reference = a_reference()
    error = np.zeros((N, 16))
    error[:, 0] = 0.002 * (-1.0) ** np.arange(N)  # RMS 0.002 on a range of 2
    error[:, 3] = 0.08  # on a range of 8
    found = compare(with_error(reference, error), reference)
    assert found.nrmse["tower_fore_aft"] == pytest.approx(0.001, rel=1e-12)
    assert found.nrmse["blade2_flap"] == pytest.approx(0.01, rel=1e-12)
    assert found.nrmse_max == found.nrmse["blade2_flap"]
    assert found.nrmse_mean == pytest.approx(0.011 / 16, rel=1e-12)
    assert found.delta_e_range == pytest.approx((0.001**2 + 0.01**2) / 16, rel=1e-12)


def test_the_mean_over_the_states_is_rounded_once_in_every_python():
    # `sum` gives 0.9999999999999999 up to Python 3.11, and 1.0 from 3.12 on
    assert Accuracy(dict.fromkeys(STATE_NAMES[:10], 0.1), 0.0, 0.0).nrmse_mean == 0.1


def test_an_azimuth_is_measured_by_the_angle_it_turned():
    reference = a_reference()
    error = np.zeros((N, 16))
    error[:, STATE_NAMES.index("rotor_azimuth")] = 0.02  # rad; the rotor turned 20 rad
    assert compare(with_error(reference, error), reference).nrmse["rotor_azimuth"] == pytest.approx(0.001)


@pytest.mark.parametrize(("level", "tenth"), [(-4.0, 0.4), (-1e-18, 2e-19), (0.0, 1e-19)])
def test_delta_e_is_the_mean_squared_relative_error_of_the_paper(level, tenth):
    # arXiv:2504.05493: mean over states and time of ((x - x_ref) / (|x_ref| + 1e-18))²
    reference = trajectory(np.full((N, 16), level))
    error = np.zeros((N, 16))
    error[0, 0] = tenth
    assert compare(with_error(reference, error), reference).delta_e == pytest.approx(
        0.01 / (16 * N), rel=1e-12
    )


def test_a_zero_crossing_dominates_delta_e_and_leaves_delta_e_range_alone():
    reference = a_reference()  # every sine is exactly 0 at the start
    error = np.full((N, 16), 1e-6)
    found = compare(with_error(reference, error), reference)
    assert found.delta_e > (1e-6 / 1e-18) ** 2 / (16 * N) / 2
    assert found.delta_e_range < 1e-12


def test_delta_e_range_is_the_mean_square_of_the_nrmse():
    reference = a_reference()
    found = compare(with_error(reference, np.random.default_rng(0).normal(0.0, 1e-3, (N, 16))), reference)
    assert found.delta_e_range == pytest.approx(np.mean(np.square(list(found.nrmse.values()))), rel=1e-12)


@pytest.mark.parametrize(("level", "expected"), [(5.0, 0.002), (-5.0, 0.002), (0.0, math.inf)])
def test_a_constant_reference_state_is_measured_by_its_magnitude(level, expected):
    reference = a_reference()
    reference.state[:, 1] = level
    error = np.zeros((N, 16))
    error[:, 1] = 0.01
    found = compare(with_error(reference, error), reference)
    assert found.nrmse["tower_side_side"] == pytest.approx(expected)
    assert found.nrmse_max == found.nrmse["tower_side_side"]


def test_rounding_noise_on_a_constant_state_is_no_range_to_measure_by():
    reference = a_reference()
    reference.state[:, 1] = 5.0 + 1e-14 * np.arange(N)
    assert compare(with_error(reference, 1e-13), reference).nrmse["tower_side_side"] < 1e-13


def test_a_state_that_is_zero_in_both_has_no_error():
    reference = a_reference()
    reference.state[:, 1] = 0.0
    found = compare(with_error(reference, 0.0), reference)
    assert found.nrmse["tower_side_side"] == 0.0 and found.nrmse_max == 0.0 and found.delta_e == 0.0


@given(st.floats(1e-6, 1e3), st.floats(1e-3, 1e3))
def test_nrmse_is_proportional_to_the_error_and_free_of_the_unit(size, unit):
    reference = a_reference()
    error = np.random.default_rng(1).normal(0.0, 1.0, (N, 16))
    once = compare(with_error(reference, error), reference)
    scaled = trajectory(unit * reference.state, reference.time)
    times = compare(with_error(scaled, unit * size * error), scaled)
    for name in STATE_NAMES:
        assert times.nrmse[name] == pytest.approx(size * once.nrmse[name], rel=1e-6)


def test_the_columns_are_those_of_the_results_table():
    columns = list(compare(a_reference(), a_reference()).to_dict())
    assert columns[:4] == ["nrmse_max", "nrmse_mean", "delta_e", "delta_e_range"]
    assert columns[4:] == [f"nrmse_{name}" for name in STATE_NAMES]


def test_trajectories_of_unequal_length_or_times_are_refused():
    reference = a_reference()
    short = trajectory(reference.state[:201], reference.time[:201])
    with pytest.raises(InputError, match="201 samples to 10 s, its reference 401 to 20 s"):
        compare(short, reference)
    late = trajectory(reference.state, reference.time + 0.01)
    with pytest.raises(InputError, match=r"differ by up to 0\.01 s"):
        compare(late, reference)


def test_times_that_differ_by_rounding_are_the_same_times():
    reference = a_reference()
    summed = trajectory(reference.state, reference.time * (1 + 1e-15) + 1e-14)
    assert compare(summed, reference).nrmse_max == 0.0


def test_a_state_that_is_not_finite_is_refused_with_its_place():
    reference = a_reference()
    error = np.zeros((N, 16))
    error[7, 5] = np.nan
    with pytest.raises(InputError, match="the test's state edge is nan at sample 7"):
        compare(with_error(reference, error), reference)


def test_a_trajectory_with_other_states_is_refused():
    reference = a_reference()
    with pytest.raises(InputError, match=r"must be \(n, 16\) for n times, got \(401, 8\) and 401 times"):
        compare(trajectory(reference.state[:, :8], reference.time), reference)
