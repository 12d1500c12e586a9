"""The baseline controller: its laws, its steady operation beside OpenFAST's, and every method under it."""

from __future__ import annotations

import numpy as np
import pytest
from simulating import simulate_block

from fatigue_runner import simulate
from fatigue_runner.control import BASELINE
from fatigue_runner.errors import InputError
from fatigue_runner.integrators import METHODS
from fatigue_runner.turbine import load_turbine
from fatigue_runner.wind import ConstantWind, SeriesWind, TurbulentWind

RPM = np.pi / 30

# OpenFAST 5.0.0, NREL 5-MW on land, the same degrees of freedom, the report's DISCON, steady uniform wind: rotor speed [rpm],
# pitch [deg], generator torque [kN m], rotor-averaged root flap moment and tower-base fore-aft moment [kN m]
OPENFAST = {
    5.0: (7.49764, 0.0, 5.52861, 2958.88, 14259.0),
    8.0: (9.12701, 0.0, 20.0465, 5691.99, 33268.4),
    10.0: (11.3563, 0.0, 31.0355, 8391.72, 52014.6),
    13.0: (12.1, 6.29971, 43.0936, 7229.52, 45176.9),
}


@pytest.fixture(scope="module")
def turbine(nrel5mw):
    return nrel5mw.operated("controlled")


def commanded(turbine, speed, integral=0.0):
    """Pitch and torque at a filtered generator speed [rad/s]."""
    x = np.zeros(turbine.layout.size)
    x[-2:] = speed, integral
    return turbine.commanded(x)


# The laws


@pytest.mark.parametrize("integral", [5.0, 50.0, 200.0])
def test_the_pitch_solves_the_gain_schedule(turbine, integral):
    """theta (1 + theta / theta_K) = K_P e + K_I integral: NREL/TP-500-38060, eq. 7-21, with the gains of table 7-2."""
    speed = 1173.7 * RPM + 2.0
    theta = commanded(turbine, speed, integral)["pitch"]
    asked = 0.01882681 * 2.0 + 0.008068634 * integral
    assert theta * (1 + theta / np.radians(6.302336)) == pytest.approx(asked, abs=4e-6)


def test_below_rated_the_pitch_stays_fine_and_the_integral_does_not_run_away(turbine):
    speeds = np.linspace(60.0, 118.0, 30)
    assert all(0 <= commanded(turbine, w, -5.0)["pitch"] < np.radians(0.01) for w in speeds)
    x = turbine.operating_point(6.0)
    assert -6.0 < x[-1] < 0.0


def test_the_torque_has_the_report_s_regions(turbine):
    """1: none; 1.5: a line from 670 rpm to 871 rpm; 2: k w^2; 3: constant power, also below rated speed where the blades are pitched."""
    rising = [commanded(turbine, w)["generator_torque"] for w in np.linspace(50.0, 121.0, 200)]
    assert np.all(np.diff(rising) > -1.0)  # N m: what the rounded corners leave
    assert commanded(turbine, 60.0)["generator_torque"] == pytest.approx(0.0, abs=100.0)
    assert commanded(turbine, 80.0)["generator_torque"] == pytest.approx(922.0 * (80.0 - 70.16), rel=0.01)
    assert commanded(turbine, 105.0)["generator_torque"] == pytest.approx(2.332287 * 105.0**2, rel=0.005)
    assert commanded(turbine, 125.0, 50.0)["generator_torque"] == pytest.approx(5_296_610 / 125.0, rel=0.002)
    pitched = commanded(turbine, 115.0, 50.0)
    assert np.degrees(pitched["pitch"]) > 2
    assert pitched["generator_torque"] == pytest.approx(5_296_610 / 115.0, rel=0.005)
    assert commanded(turbine, 100.0, 60.0)["generator_torque"] < 47_402.91 + 1


def test_kernel_and_formulas_are_one(turbine):
    """The kernel's torque and rates are those of the submodel that it was printed from."""
    x = np.repeat(turbine.operating_point(14.0)[:, None], 7, axis=1)
    x[15:18] += np.random.default_rng(0).normal(0, [[2.0], [2.0], [5.0]], (3, 7))
    states = {name: x[i] for i, name in enumerate(turbine.layout.names)}
    rates = BASELINE.rates(states, turbine.control_parameters, np.sqrt)
    slopes = turbine.rhs(x, 14.0)
    for name, rate in rates.items():
        assert slopes[turbine.layout.row(name)] == pytest.approx(rate, rel=1e-10, abs=1e-10)
    loads = turbine.loads(x.T, np.tile([14.0, 0.0, 0.0], (7, 1)))
    assert loads["generator_torque"] == pytest.approx(turbine.commanded(x.T)["generator_torque"], rel=1e-10)


# Steady operation


@pytest.mark.parametrize("wind", OPENFAST)
def test_steady_operation_is_openfast_s(turbine, wind):
    speed, pitch, torque, flap, tower = OPENFAST[wind]
    x = np.array([turbine.operating_point(wind, azimuth=a) for a in np.arange(6) * np.pi / 3])
    found = turbine.commanded(x[0])
    assert x[0, 14] / RPM == pytest.approx(speed, rel=0.01)
    assert np.degrees(found["pitch"]) == pytest.approx(pitch, abs=0.2)
    assert found["generator_torque"] / 1e3 == pytest.approx(torque, rel=0.015)
    loads = turbine.loads(x, np.tile([wind, 0.0, 0.0], (6, 1)))
    assert loads["blade1_root_flapwise_moment"].mean() / 1e3 == pytest.approx(flap, rel=0.03)
    assert loads["tower_base_fore_aft_moment"].mean() / 1e3 == pytest.approx(tower, rel=0.03)


def test_an_operating_point_of_another_operation_is_asked_of_the_turbine_itself(nrel5mw, turbine):
    found = nrel5mw.operating_point(18.0, operation="controlled")
    np.testing.assert_array_equal(found, turbine.operating_point(18.0))
    assert len(nrel5mw.operating_point(8.0)) == nrel5mw.layout.size
    with pytest.raises(InputError, match="unknown operation 'control'"):
        nrel5mw.operating_point(18.0, operation="control")


@pytest.mark.parametrize("wind", [4.0, 8.0, 11.0, 12.0, 18.0, 25.0])
def test_a_run_that_starts_at_the_operating_point_stays_there(turbine, wind):
    run = simulate(
        turbine, wind=ConstantWind(wind), method="rk4", step=0.02, duration=60.0, operation="controlled"
    )
    assert run.diverged_at is None
    assert np.ptp(run.state[:, 14]) / RPM < 0.02
    assert np.ptp(np.degrees(run.pitch)) < 0.1


def test_a_gust_is_pitched_away_and_the_speed_comes_back(turbine):
    time = np.arange(0, 121, 1.0)
    gust = 18.0 + 3.0 * np.exp(-(((time - 40) / 5) ** 2))
    run = simulate(
        turbine, SeriesWind(1.0, gust), "dop853", 0.1, 120.0, turbine.operating_point(18.0), 0.1, operation="controlled"
    )  # fmt: skip
    rpm, pitch = run.state[:, 14] / RPM, np.degrees(run.pitch)
    assert 12.5 < rpm.max() < 13.8 and pitch.max() > 16.5
    assert rpm[-50:] == pytest.approx(12.1, abs=0.05)
    seen = {"pitch_rate", "pitch_rate_limited", "torque_region"}
    assert set(run.control) == {"filtered_generator_speed", "speed_error_integral"} | seen
    rate = np.degrees(run.control["pitch_rate"])
    assert rate == pytest.approx(np.gradient(pitch, run.time), abs=0.05) and np.abs(rate).max() < 8.0
    assert not run.control["pitch_rate_limited"].any() and set(run.control["torque_region"]) == {3.0}


# Every method and mode


SLOW = pytest.mark.slow(
    reason="each family's loop is compiled for the controlled model: ten seconds and more"
)
QUICK = ("rk4", "dop853")


@pytest.mark.parametrize("name", [n if n in QUICK else pytest.param(n, marks=SLOW) for n in METHODS])
def test_every_method_runs_in_operation(turbine, name):
    wind = TurbulentWind(16.0, 0.1, seed=1, duration=20.0)
    start = turbine.operating_point(16.0)[None]
    exact = simulate_block(turbine, "dop853", 0.01, [wind], start, 10.0, 0.1)[0]
    step = {"euler": 0.0005, "ab4": 0.005, "etdrk4": 0.05, "etdabm3": 0.05, "etdabm4": 0.05}.get(name, 0.01)
    run = simulate_block(turbine, name, step, [wind], start, 10.0, 0.1)[0]
    scale = np.ptp(exact.state, axis=0)
    error = np.sqrt(((run.state - exact.state) ** 2).mean(axis=0)) / scale
    assert error.max() < (0.05 if name == "euler" else 5e-3)


@pytest.mark.parametrize(
    ("name", "order"),
    [
        ("heun", 2), ("rk3", 3), ("rk4", 4), ("tsit5", 5), pytest.param("abm4", 4, marks=SLOW), pytest.param("etdrk4", 4, marks=SLOW),
    ],
)  # fmt: skip
def test_methods_keep_their_order_across_the_controller_s_regions(turbine, name, order):
    """From region 2 into 3 and back: no kink takes the order away."""
    time = np.arange(0, 31, 1.0)
    wind = SeriesWind(1.0, 11.4 + 1.0 * np.sin(2 * np.pi * time / 20))
    start = turbine.operating_point(11.4)[None]
    exact = simulate_block(turbine, "dop853", 0.005, [wind], start, 12.0, 12.0)[0].state[-1]
    steps = {"abm4": (0.005, 0.0025), "tsit5": (0.04, 0.02)}.get(name, (0.02, 0.01))
    errors = [
        np.abs(simulate_block(turbine, name, h, [wind], start, 12.0, 12.0)[0].state[-1] - exact)[[0, 2, 14, 16, 17]].max()
        for h in steps
    ]  # fmt: skip
    assert np.log2(errors[0] / errors[1]) > order - 0.5


# What is refused


def test_fixed_operation_is_the_turbine_as_it_was(nrel5mw, turbine):
    assert turbine.hash != nrel5mw.hash and turbine.operated("fixed").hash == nrel5mw.hash
    assert nrel5mw.operated("fixed") is nrel5mw and nrel5mw.layout.size == 16


def test_the_torque_law_alone_leaves_the_blades_at_fine_pitch(nrel5mw):
    x = nrel5mw.operated("torque-law").operating_point(8.0)
    assert nrel5mw.operated("torque-law").commanded(x)["pitch"] == 0.0


def test_wrong_operations_are_refused_in_one_sentence(nrel5mw):
    with pytest.raises(InputError, match="unknown operation 'controled'; did you mean 'controlled'"):
        nrel5mw.operated("controled")
    with pytest.raises(InputError, match="turbine t2b1i1cg has no `control` section"):
        load_turbine("t2b1i1cg").operated("controlled")
    with pytest.raises(InputError, match="makes the pitch itself"):
        simulate(nrel5mw, 14.0, duration=1.0, pitch=0.1, operation="controlled")


# Transients beside OpenFAST's: the same degrees of freedom, the report's DISCON, uniform wind


def extremes(turbine, start, time, wind, duration):
    """Largest and smallest rotor speed [rpm], pitch [deg] and loads [kN m], from 20 s on."""
    run = simulate(
        turbine, SeriesWind(time[1], wind), "dop853", 0.05, duration, turbine.operating_point(start), 0.05, operation="controlled"
    )  # fmt: skip
    told = {
        "speed": run.state[:, 14] / RPM,
        "pitch": np.degrees(run.pitch),
        "torque": run.loads["generator_torque"] / 1e3,
        "flap": run.loads["blade1_root_flapwise_moment"] / 1e3,
        "tower": run.loads["tower_base_fore_aft_moment"] / 1e3,
    }
    return {name: (values[400:].min(), values[400:].max()) for name, values in told.items()}


def check_extremes(found, openfast, share):
    """Each extreme within that share of the range that OpenFAST's value runs through."""
    for name, (low, high) in openfast.items():
        assert found[name] == pytest.approx((low, high), abs=share * (high - low)), name


def test_an_extreme_operating_gust_at_rated_wind_is_openfast_s(turbine):
    """12 - 1.85 sin(3 pi t / 10.5) (1 - cos(2 pi t / 10.5)) m/s, from 100 s on: the blades are pitched by ten degrees and back."""
    time = np.arange(0, 201, 0.05)
    gust = np.where((time >= 100) & (time <= 110.5), time - 100, 0.0)
    wind = 12 - 1.85 * np.sin(3 * np.pi * gust / 10.5) * (1 - np.cos(2 * np.pi * gust / 10.5))
    openfast = {
        "speed": (11.11, 13.58),
        "pitch": (0.0, 10.33),
        "torque": (30.40, 46.64),
        "flap": (957.4, 13114.8),
        "tower": (-13514.9, 104736.1),
    }
    check_extremes(extremes(turbine, 12.0, time, wind, 200.0), openfast, 0.03)


def test_steps_of_the_wind_above_rated_are_openfast_s(turbine):
    """17, 19, 18, 20 m/s, in 0.2 s each, a hundred seconds apart."""
    time = np.arange(0, 401, 0.05)
    wind = np.interp(time, [100, 100.2, 200, 200.2, 300, 300.2], [17.0, 19, 19, 18, 18, 20])
    openfast = {
        "speed": (11.69, 12.92),
        "pitch": (13.41, 17.74),
        "torque": (40.52, 44.51),
        "tower": (12740.6, 53186.8),
    }
    check_extremes(extremes(turbine, 17.0, time, wind, 400.0), openfast, 0.04)
