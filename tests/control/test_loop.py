"""The speed loop: gains from its design, its poles, the pitch actuator, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fatigue_runner import simulate
from fatigue_runner.control.tuning import Drive, tuned
from fatigue_runner.errors import InputError
from fatigue_runner.turbine import load_turbine
from fatigue_runner.turbine.envelope import check_wind
from fatigue_runner.turbine.file import read_turbine_file
from fatigue_runner.turbine.loop import check_loop, poles, speed_mode, winds_above_rated
from fatigue_runner.turbine.table_builder import turbine_blade
from fatigue_runner.wind import SeriesWind

# NREL/TP-500-38060, section 7.2: gains at zero pitch [s], [-] and pitch of twice the sensitivity [deg], made for 0.6 rad/s and 0.7
REPORT = {"proportional_gain": 0.01882681, "integral_gain": 0.008068634, "gain_schedule_pitch_deg": 6.302336}
# table 7-1: wind [m/s], pitch [deg], sensitivity dP/dtheta [MW/rad], the wake frozen
TABLE_7_1 = (
    (12.0, 3.83, -43.73),
    (13.0, 6.60, -51.66),
    (14.0, 8.70, -61.29),
    (15.0, 10.45, -66.46),
    (25.0, 23.47, -125.3),
)


@pytest.fixture(scope="module")
def turbine(nrel5mw):
    return nrel5mw.operated("controlled")


def changed(turbine, **control):
    """The turbine with other keys in its `control` section."""
    return replace(turbine.operated("fixed"), control=turbine.control | control).operated("controlled")


# Gains


def test_the_formulas_of_the_report_give_its_gains():
    """Rigid drivetrain 43 784 725 kg m2, dP/dtheta = -25.52 MW/rad (1 + theta / 6.302336 deg), 0.6 rad/s, 0.7."""
    pitch = np.radians([0.0, 5.0, 10.0, 20.0])
    drive = Drive(43_784_725.0, 12.1 * np.pi / 30, 97.0)
    found = tuned(pitch, 25.52e6 * (1 + pitch / np.radians(6.302336)), drive, 0.6, 0.7)
    assert found.proportional == pytest.approx(REPORT["proportional_gain"], rel=5e-4)
    assert found.integral == pytest.approx(REPORT["integral_gain"], rel=5e-4)
    assert np.degrees(found.schedule) == pytest.approx(6.302336, rel=1e-6)


def test_with_the_wake_frozen_the_power_answers_to_pitch_as_in_the_report(nrel5mw):
    wind, pitch, slope = np.array(TABLE_7_1).T
    blade = turbine_blade(read_turbine_file("nrel5mw"))[0]
    straight = replace(
        nrel5mw.rigid, parameters=nrel5mw.parameters | {"cos_tilt": 1.0}
    )  # table 7-1 has wind along the shaft
    found = -straight.frozen_sensitivity(blade, wind, 12.1 * np.pi / 30, np.radians(pitch)) / 1e6
    assert found == pytest.approx(slope, rel=0.06)
    assert found[:2] == pytest.approx(slope[:2], rel=0.01)


@pytest.fixture(scope="module")
def by_design(tmp_path_factory):
    def made(tuning):
        path = tmp_path_factory.mktemp("tuned") / "tuned.yaml"
        path.write_text(f"name: tuned\nbase: nrel5mw\ncontrol:\n  tuning: {tuning}\n")
        return load_turbine(str(path)).operated("controlled")

    return made


def test_gains_of_the_design_are_near_the_report_s(by_design):
    """8 % lower at fine pitch and a schedule 14 % slower: between, from 5 to 25 deg, where the blades work, they differ by 3 %."""
    own = by_design("{natural_frequency: 0.6, damping_ratio: 0.7}").control
    off = {name: own[name] / value - 1 for name, value in REPORT.items()}
    assert off == pytest.approx(
        {"proportional_gain": -0.08, "integral_gain": -0.08, "gain_schedule_pitch_deg": 0.14}, abs=0.01
    )
    pitch = np.array([5.0, 10.0, 15.0, 20.0, 25.0])
    scheduled = [c["proportional_gain"] / (1 + pitch / c["gain_schedule_pitch_deg"]) for c in (own, REPORT)]
    assert scheduled[0] == pytest.approx(scheduled[1], rel=0.03)


def test_a_design_with_the_wake_in_equilibrium_is_what_the_turbine_does(by_design):
    """As the model's wake is, too. What is left is the lag of the filter, the tower, and the line through the sensitivities."""
    made = by_design("{natural_frequency: 0.4, damping_ratio: 0.7, wake: equilibrium}")
    check_loop(made)
    found = speed_mode(made, 18.0)
    assert found.frequency == pytest.approx(0.4, rel=0.2) and found.damping == pytest.approx(0.7, abs=0.1)


# Poles


def test_the_report_s_gains_are_stable_and_damp_less_near_rated_wind_where_the_wake_answers(turbine):
    check_loop(turbine)
    assert winds_above_rated(turbine)[0] < 12.5 and winds_above_rated(turbine)[-1] == 25.0
    damping = [speed_mode(turbine, wind).damping for wind in (12.0, 14.0, 18.0, 22.0)]
    assert np.all(np.diff(damping) > 0) and 0.1 < damping[0] < 0.25 and damping[-1] > 0.6


# OpenFAST 5.0.0 under the report's DISCON: frequency [rad/s] and damping ratio of the rotor speed's decay after steps of
# the wind to 18, 19 and 20 m/s, a damped sine fitted from 2 s after the step
OPENFAST_DECAY = {18.0: (0.468, 0.521), 19.0: (0.522, 0.617), 20.0: (0.540, 0.687)}


@pytest.mark.parametrize("wind", OPENFAST_DECAY)
def test_speed_and_pitch_die_out_as_openfasts(turbine, wind):
    found = speed_mode(turbine, wind)
    assert found.frequency == pytest.approx(OPENFAST_DECAY[wind][0], rel=0.07)
    assert found.damping == pytest.approx(OPENFAST_DECAY[wind][1], abs=0.04)


def test_poles_are_those_of_a_run(turbine):
    """A small push dies out with the mode's frequency and damping."""
    mode = speed_mode(turbine, 14.0)
    start = turbine.operating_point(14.0)
    start[14:16] *= 1.01
    run = simulate(turbine, 14.0, "rk4", 0.05, 60.0, start, operation="controlled")
    speed = run.state[:, 14] - run.state[-1, 14]
    crossings = run.time[1:][np.diff(np.sign(speed)) != 0]
    half = np.diff(crossings[:3]).mean()
    assert np.pi / half == pytest.approx(mode.frequency * np.sqrt(1 - mode.damping**2), rel=0.1)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"proportional_gain": 0.1}, r"unstable at 12.1 m/s: a pole at 0.0\d+ ± 1.35i \(0.22 Hz\) 1/s; in `control`, change prop"),
        ({"integral_gain": 0.08}, r"integral_gain \(0.08\) or have them made by `tuning`"),
        ({"gain_schedule_pitch_deg": 1e6}, "unstable at 20.2 m/s"),
        ({"actuator": {"natural_frequency": 1.0, "damping_ratio": 0.7}}, "take a faster `actuator`"),
    ],
)  # fmt: skip
def test_an_unstable_loop_is_refused_with_its_poles(turbine, change, message):
    with pytest.raises(InputError, match=message):
        check_loop(changed(turbine, **change))


# The actuator


def test_an_actuator_adds_its_states_and_takes_damping(turbine):
    fast = changed(turbine, actuator={"natural_frequency": 12.0, "damping_ratio": 0.7})
    slow = changed(turbine, actuator={"natural_frequency": 3.0, "damping_ratio": 0.7})
    assert fast.layout.names[-2:] == ("pitch_actuator_angle", "pitch_actuator_rate")
    assert fast.hash != turbine.hash and fast.operated("torque-law").layout.size == turbine.layout.size
    damping = [speed_mode(t, 18.0).damping for t in (turbine, fast, slow)]
    assert damping[0] > damping[1] > damping[2] > 0.3
    own = poles(fast, 18.0)
    assert np.abs(own - 12.0 * (-0.7 + 1j * np.sqrt(1 - 0.7**2))).min() < 1.5
    steady = fast.operating_point(18.0)
    assert fast.commanded(steady)["pitch"] == pytest.approx(
        turbine.commanded(turbine.operating_point(18.0))["pitch"], rel=1e-6
    )


@pytest.mark.slow(reason="compiles the loop for one more set of equations")
def test_behind_an_actuator_the_blades_follow_the_command(turbine):
    acted = changed(turbine, actuator={"natural_frequency": 12.0, "damping_ratio": 0.7})
    time = np.arange(0, 61, 1.0)
    wind = SeriesWind(1.0, 16.0 + 2.0 * np.exp(-(((time - 20) / 5) ** 2)))
    from fatigue_runner.integrators import Ensemble, Integrator
    from fatigue_runner.integrators import simulate as run

    start = acted.operating_point(16.0)[None]
    found = run(Ensemble(acted, [wind], start, 60.0, 0.05), Integrator("rk4", 0.025))[0]
    command, angle, rate = (
        found.control[n] for n in ("pitch_command", "pitch_actuator_angle", "pitch_actuator_rate")
    )
    assert np.array_equal(found.pitch, angle)
    assert found.control["pitch_rate"] == pytest.approx(rate, abs=1e-12)
    late = np.argmax(np.correlate(angle - angle.mean(), command - command.mean(), "full")) - (len(angle) - 1)
    assert 0.05 <= 0.05 * late <= 0.25  # s; 2 zeta / omega = 0.12


# What a turbine is not made for


def test_the_pitch_rate_limit_is_watched(turbine):
    """From 14 to 34 m/s within two seconds: more than 8 deg/s, which is counted and does not act."""
    time = np.arange(0, 41, 0.5)
    wind = SeriesWind(0.5, 14.0 + 20.0 / (1 + np.exp(-(time - 20) / 0.3)))
    run = simulate(turbine, wind, "rk4", 0.02, 40.0, turbine.operating_point(14.0), operation="controlled")
    rate = np.degrees(run.control["pitch_rate"])
    assert rate.max() > 8.0
    assert np.array_equal(run.control["pitch_rate_limited"] > 0, np.abs(rate) > 8.0)
    assert rate[1:-1] == pytest.approx(np.gradient(np.degrees(run.pitch), run.time)[1:-1], abs=0.2)


def test_winds_outside_of_cut_in_and_cut_out_are_told(turbine):
    assert check_wind(turbine, 12.0) == "" and check_wind(turbine.operated("fixed"), 30.0) == ""
    assert "above the cut-out wind of nrel5mw (25 m/s): no shutdown is simulated" in check_wind(turbine, 27.0)
    assert "below the cut-in wind of nrel5mw (3 m/s): no standstill is simulated" in check_wind(turbine, 2.5)


def test_tables_that_end_below_the_needed_pitch_are_refused(turbine):
    inside = turbine.tables.pitch <= np.radians(10.01)
    tables = replace(
        turbine.tables, pitch=turbine.tables.pitch[inside], coefficients={n: c[:, inside] for n, c in turbine.tables.coefficients.items()}
    )  # fmt: skip
    short = replace(turbine.operated("fixed"), tables=tables).operated("controlled")
    with pytest.raises(
        InputError,
        match=r"tables end at 10 deg pitch, below what 18 m/s needs; make tables with more .* winds up to 14.8",
    ):
        simulate(short, 18.0, duration=1.0, operation="controlled")
    assert check_wind(short, 13.0) == ""
