"""Wind with azimuthal harmonics as sources and kernels have it: what each blade feels at its own azimuth."""

from __future__ import annotations

import re

import numpy as np
import pytest
from field_files import some_field, write_bts
from simulating import simulate_block

from fatigue_runner.channels import wind_channels
from fatigue_runner.errors import InputError
from fatigue_runner.integrators import Ensemble, Integrator, refuse_unresolved, simulate
from fatigue_runner.turbine import load_turbine
from fatigue_runner.turbine.aerodynamics import LOAD_NAMES, rotor_loads
from fatigue_runner.turbine.file import read_turbine_file
from fatigue_runner.turbine.lanes import evaluate
from fatigue_runner.turbine.table_builder import turbine_blade
from fatigue_runner.wind import ConstantWind, FullFieldWind, TurbulentWind
from fatigue_runner.wind.azimuth import wind_at
from fatigue_runner.wind.mean_shear import mean_signals
from fatigue_runner.wind.profiles import Logarithmic


@pytest.fixture(scope="module")
def turbine():
    return load_turbine("nrel5mw")


def folded(turbine, state, signals):
    """State derivatives under any wind signals (n, 3 or more)."""
    data, known = turbine.kernel_data(0.0, True), wind_channels(signals.shape[1])
    padded = np.zeros((data.model.layout.wind_size(known), len(signals)))
    padded[data.model.layout.wind_rows(known)] = signals.T
    return evaluate(data, state, padded)[0]


def test_without_amplitudes_the_kernel_with_harmonics_is_the_plain_one(turbine):
    x = np.repeat(turbine.operating_point(8.0)[:, None], 5, axis=1)
    x[6] = np.linspace(0, 6, 5)
    signals = np.tile([8.0, 0.1, -0.05, *[0.0] * 12], (5, 1))
    assert folded(turbine, x, signals) == pytest.approx(turbine.rhs(x, 8.0, 0.1, -0.05), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("harmonics", [2, 3, 4, 6, 7])
def test_the_three_blades_feel_the_harmonics_at_their_own_azimuths(turbine, harmonics):
    """Amplitudes that give three blades the same winds give the same accelerations, whatever their orders."""
    random = np.random.default_rng(harmonics)
    n = 11
    x = np.repeat(turbine.operating_point(8.0)[:, None], n, axis=1)
    x[6] = random.uniform(0, 20, n)
    x[7] = 97.0 * x[6]
    amplitudes = np.zeros((n, 1 + 2 * harmonics))
    amplitudes[:, 1:] = random.normal(0, 0.5, (n, 2 * harmonics))
    # three winds at three blades are a mean (an m = 3) and an m = 1 with these amplitudes
    psi = x[6][:, None] + np.arange(3) * 2 * np.pi / 3
    winds = np.array([wind_at(a, p) for a, p in zip(amplitudes, psi, strict=True)])
    mean = winds.mean(axis=1)
    c1, s1 = (2 / 3 * (winds * f(psi)).sum(axis=1) for f in (np.cos, np.sin))
    same = np.zeros((n, 7))
    same[:, 1], same[:, 2] = c1, s1
    same[:, 5], same[:, 6] = mean * np.cos(3 * x[6]), mean * np.sin(3 * x[6])

    def slopes(a):
        signals = np.concatenate([np.tile([8.0, 0.0, 0.0], (n, 1)), a[:, 1:]], axis=1)
        return folded(turbine, x, signals)

    assert slopes(amplitudes) == pytest.approx(slopes(same), rel=1e-9, abs=1e-9)
    assert np.abs(slopes(amplitudes)[10:13] - turbine.rhs(x, 8.0)[10:13]).max() > 0.1


def test_a_wind_that_rises_at_all_blades_raises_thrust_and_torque_by_their_tables(turbine):
    """c_3 cos 3 psi at psi = 0 lifts all three blades' winds: rho/6 A V X_w for each of them, along the tilted shaft."""
    x = np.repeat(turbine.operating_point(8.0)[None], 2, axis=0)
    x[:, 6] = 0.0
    signals = np.zeros((2, 9))
    signals[:, 0], signals[1, 7] = 8.0, 1e-3
    loads, p = turbine.loads(x, signals), turbine.parameters
    normal = 8.0 * p["cos_tilt"]
    ratio = x[0, 14] * turbine.rotor.radius / normal
    names = "thrust_w", "torque_w"
    table = turbine.tables.at_pitch(0.0, names)
    thrust, torque = (np.interp(ratio, turbine.tables.tip_speed_ratio, column) for column in table.T)
    of_all = 3 * p["q_area"] / 3 * normal * p["cos_tilt"] * p["cos_cone"]
    assert np.diff(loads["rotor_thrust"])[0] / 1e-3 == pytest.approx(of_all * thrust, rel=2e-3)
    assert torque > 0


def test_a_load_answers_to_a_harmonic_by_its_own_reach_and_over_a_swing_of_turbulence(turbine):
    """Blade elements say the same: strips that see 0.2 more and less wind, at a rotor speed that stays."""
    tables, blade = turbine.tables, turbine_blade(read_turbine_file("nrel5mw"))[0]
    place = int(np.argmin(abs(tables.tip_speed_ratio - 7.5)))
    ratio = tables.tip_speed_ratio[place]
    names = "thrust", "tangential", "torque", "bending", "flap"
    up, down = (
        f**2 * rotor_loads(blade, ratio / f, 0.0)[[LOAD_NAMES.index(name) for name in names]]
        for f in (1.2, 0.8)
    )
    secant = dict(zip(names, (up - down) / 0.4, strict=True))
    own = dict(zip(names, tables.at_pitch(0.0, [f"{name}_w" for name in names])[place], strict=True))
    for name, reach in (("thrust", 0.63), ("bending", 0.70), ("flap", 0.79)):
        assert own[name] == pytest.approx(secant[name] * reach / 0.71, rel=0.015)
    # these have the slope at the mean, which is steeper or flatter than the secant, and the flap moment's reach
    slope = tables.at_pitch(0.0, ["torque"])[:, 0]
    exact = 2 * slope - tables.tip_speed_ratio * np.gradient(slope, tables.tip_speed_ratio)
    assert own["torque"] == pytest.approx(exact[place], rel=5e-3)


def test_the_power_law_has_its_harmonics_and_the_same_blade_effective_slope(turbine):
    wind = ConstantWind(8.0, shear_exponent=0.2).on(turbine.rotor)
    signals = wind.at([0.0])[0]
    assert wind.harmonics == 6 and signals.shape == (15,)
    assert signals[0] == pytest.approx(8.0, rel=0.015) and signals[0] < 8.0  # the power law is concave
    assert signals[5] < 0 < signals[7]  # cos 2 psi lowers, cos 3 psi raises
    assert not signals[4::2].any()


def test_a_logarithmic_profile_has_its_own_harmonics(turbine):
    wind = ConstantWind(8.0, roughness_length=0.03).on(turbine.rotor)
    steady = mean_signals(Logarithmic(0.03), 8.0, turbine.rotor, 6)
    assert wind.at([0.0])[0] == pytest.approx(steady) and steady[5] < 0 < steady[7]
    # at the hub its slope is 1 / (h ln(h / z_0)): a power law of exponent 1 / ln(h / z_0), but more curved
    similar = (
        ConstantWind(8.0, shear_exponent=1 / np.log(turbine.hub_height / 0.03)).on(turbine.rotor).at([0.0])[0]
    )
    assert steady[1] == pytest.approx(similar[1], rel=0.03) and steady[5] < similar[5]
    linear = ConstantWind(8.0, roughness_length=0.03, harmonics=1).on(turbine.rotor).at([0.0])[0]
    assert linear[1] == pytest.approx(
        turbine.rotor.radius / turbine.hub_height / np.log(turbine.hub_height / 0.03), rel=1e-5
    )


def test_linear_shear_has_one_harmonic_and_says_so():
    assert ConstantWind(8.0, 0.1).harmonics == 1 and ConstantWind(8.0, 0.1).at([0.0]).shape == (1, 3)
    with pytest.raises(InputError, match="a linear shear has one harmonic, not 3; give shear_exponent"):
        ConstantWind(8.0, 0.1, harmonics=3)
    with pytest.raises(InputError, match="both vertical_shear and shear_exponent"):
        ConstantWind(8.0, 0.1, shear_exponent=0.2)
    with pytest.raises(InputError, match="both shear_exponent and roughness_length"):
        ConstantWind(8.0, shear_exponent=0.2, roughness_length=0.03)


@pytest.mark.parametrize("harmonics", [-1, 2.5, 99, True])
def test_an_impossible_number_of_harmonics_is_refused(harmonics):
    with pytest.raises(InputError, match="harmonics must be a whole number from 0 to 16"):
        TurbulentWind(8.0, 0.1, harmonics=harmonics)


def test_uniform_wind_has_no_shear_at_all():
    signals = TurbulentWind(8.0, 0.1, harmonics=0, duration=20.0).at(np.arange(20.0))
    assert not signals[:, 1:].any() and signals[:, 0].std() > 0


def test_winds_of_any_number_of_harmonics_run_side_by_side_with_the_bits_of_each_alone(turbine):
    winds = [
        TurbulentWind(8.0, 0.1, seed=1, duration=10.0, harmonics=m) for m in (1, 3, 6)
    ] + [ConstantWind(8.0, shear_exponent=0.2), ConstantWind(8.0)]  # fmt: skip
    start = np.repeat(turbine.operating_point(8.0)[None], len(winds), axis=0)
    for method, step in (("rk4", 0.05), ("etdabm3", 0.05)):
        together = simulate_block(turbine, method, step, winds, start, 5.0, 0.05)
        for wind, x, run in zip(winds, start, together, strict=True):
            (alone,) = simulate_block(turbine, method, step, [wind], x[None], 5.0, 0.05)
            assert np.array_equal(alone.state, run.state) and np.array_equal(
                alone.wind, run.wind, equal_nan=True
            )
            assert run.wind.shape[1] == wind.on(turbine.rotor).signals


def test_a_full_field_blows_as_its_projection_says(turbine, tmp_path):
    path = write_bts(
        tmp_path / "a.bts", some_field(300, 15, 15), spacing=(10.0, 10.0), mean=9.0, hub=90.0, time_step=0.1
    )
    wind = FullFieldWind(path, harmonics=3).on(turbine.rotor)
    assert wind.signals == 9 and wind.mean_speed == 9.0
    (run,) = simulate_block(turbine, "rk4", 0.05, [wind], turbine.operating_point(9.0)[None], 10.0, 0.1)
    assert run.diverged_at is None and run.wind.std(axis=0)[3:].min() > 0
    with pytest.raises(InputError, match="cannot be read"):
        FullFieldWind(tmp_path / "gone.bts").on(turbine.rotor).at([0.0])


def test_what_is_said_of_a_turbulence_s_strength_is_what_its_series_have(turbine):
    """Expected over seeds: the mean over the rotor, and a blade that turns through all azimuths."""
    winds = [TurbulentWind(8.0, 0.14, seed=s, harmonics=4).on(turbine.rotor) for s in range(24)]
    series = np.stack([wind.harmonic_series for wind in winds])
    rotor, point = series[..., 0].std(), winds[0].sigma
    blade = np.sqrt(series[..., 0].var() + (series[..., 1:].var(axis=(0, 1))).sum() / 2)
    told = [float(x) for x in re.findall(r"([\d.]+) m/s \(", winds[0].strength)]
    assert told[0] == round(point, 2) == 1.12
    assert told[1:] == [pytest.approx(rotor, rel=0.1), pytest.approx(blade, rel=0.05)]
    assert rotor < 0.7 * point and rotor < blade < point
    assert "azimuthal harmonics above 4" in winds[0].left_out
    assert "a turning blade" not in TurbulentWind(8.0, 0.14, harmonics=1).strength
    assert "beyond linear shears" in TurbulentWind(8.0, 0.14, harmonics=1).left_out


def test_a_full_field_says_how_strong_its_hub_point_is_and_not_its_mean_over_the_rotor(turbine, tmp_path):
    field = some_field(600, 15, 15)
    path = write_bts(tmp_path / "a.bts", field, spacing=(10.0, 10.0), mean=9.0, hub=90.0, time_step=0.1)
    wind = FullFieldWind(path, harmonics=3).on(turbine.rotor)
    point = 9.0 * wind.label["turbulence_intensity"]
    told = [float(x) for x in re.findall(r"([\d.]+) m/s \(", wind.strength)]
    assert told[0] == pytest.approx(point, abs=0.006)
    assert (
        told[1] == pytest.approx(wind.at(np.arange(500) * 0.1)[:, 0].std(), rel=0.05)
        and told[1] < 0.6 * point
    )


def test_a_step_with_fewer_than_two_steps_in_a_period_of_the_highest_harmonic_is_refused(turbine):
    """At 12.1 rpm the sixteenth harmonic comes by every 0.31 s."""
    state = turbine.operating_point(10.0)
    state[14] = 12.1 * np.pi / 30
    wind = TurbulentWind(12.0, 0.1, harmonics=16).on(turbine.rotor)
    longest = 60 / 12.1 / 16 / 2
    refuse_unresolved(turbine, wind, state, longest * 0.999)
    with pytest.raises(InputError) as told:
        refuse_unresolved(turbine, wind, state, 0.2)
    assert "16 azimuthal harmonics, but at 12.1 rpm a step of 200 ms has fewer than 2 steps" in str(
        told.value
    )
    assert "take at most 12 harmonics, or a step of at most 154 ms" in str(told.value)
    refuse_unresolved(turbine, TurbulentWind(12.0, 0.1, harmonics=12).on(turbine.rotor), state, 0.2)
    refuse_unresolved(turbine, TurbulentWind(12.0, 0.1, harmonics=1), state, 1.0)
    # a rotor at rest will turn with tip-speed ratio 7.5: 12 m/s are 13.7 rpm
    with pytest.raises(InputError, match=r"at 13\.7 rpm"):
        refuse_unresolved(turbine, wind, np.zeros(16), 0.2)


def test_whoever_simulates_refuses_such_a_step(turbine):
    wind = TurbulentWind(8.0, 0.1, harmonics=16, duration=10.0)
    ensemble = Ensemble(turbine, [ConstantWind(8.0), wind], np.stack([turbine.operating_point(8.0)] * 2), 4.0)
    with pytest.raises(InputError, match="take at most 7 harmonics, or a step of at most 205 ms"):
        simulate(ensemble, Integrator("etdrk4", 0.45))
