"""Pitch varying in time: the kernel with a pitch of its own per lane, the series, and what takes it."""

from __future__ import annotations

import numpy as np
import pytest
from simulating import simulate_block

import fatigue_runner as fr
from fatigue_runner.campaign.plan import make_plan
from fatigue_runner.errors import InputError
from fatigue_runner.integrators import METHODS, method
from fatigue_runner.integrators.adams import LinearMultistep
from fatigue_runner.integrators.butcher import ButcherTableau
from fatigue_runner.turbine import load_turbine
from fatigue_runner.wind import ConstantWind, TurbulentWind

CLASSICAL = [n for n in METHODS if isinstance(method(n), ButcherTableau | LinearMultistep)]


def constant(degrees: float, duration: float = 10.0) -> fr.PitchSeries:
    return fr.PitchSeries(np.linspace(0, duration, 11), np.full(11, np.radians(degrees)))


def swinging(duration: float = 10.0) -> fr.PitchSeries:
    time = np.linspace(0, duration, 21)
    return fr.PitchSeries(time, np.radians(4.0 + 3.0 * np.sin(0.8 * time)))


@pytest.mark.parametrize("name", ["nrel5mw", "t2b1i1cg"])
@pytest.mark.parametrize("degrees", [-3.1, 0.0, 2.3, 10.75, 24.9])
def test_the_kernel_with_a_pitch_per_lane_is_that_of_a_fixed_pitch(name, degrees):
    model = load_turbine(name)
    x = model.operating_point(8.0)[:, None] + np.random.default_rng(1).normal(0, 0.1, (16, 20))
    pitch, signals = np.radians(degrees), np.tile([8.0, 0.1, 0.05], (20, 1))
    fixed, own = (model.rhs(x, *signals[0], pitch=p) for p in (pitch, np.full(20, pitch)))
    assert np.abs(own - fixed).max() <= 1e-12 * np.abs(fixed).max()
    fixed_loads, own_loads = (model.loads(x.T, signals, p) for p in (pitch, np.full(20, pitch)))
    for channel, values in fixed_loads.items():
        assert own_loads[channel] == pytest.approx(values, rel=1e-10, abs=1e-11 * np.abs(values).max())


def test_every_lane_has_its_own_pitch(turbine):
    x = np.repeat(turbine.operating_point(8.0)[:, None], 20, axis=1)
    angles = np.radians(np.linspace(-4, 29, 20))
    together = turbine.rhs(x, 8.0, pitch=angles)
    for lane in (0, 7, 19):
        alone = turbine.rhs(x[:, lane], 8.0, pitch=float(angles[lane]))
        assert together[:, lane] == pytest.approx(alone, rel=1e-11, abs=1e-12 * np.abs(alone).max())


@pytest.mark.parametrize("name", ["heun", "rk4", "tsit5", "abm4"])
def test_a_constant_series_is_a_fixed_pitch_to_rounding(turbine, name):
    start = turbine.operating_point(8.0, pitch=np.radians(2.3))[None]
    wind = [TurbulentWind(8.0, intensity=0.1, seed=1, duration=4.0)]
    fixed, series = (
        simulate_block(turbine, name, 0.01, wind, start, 4.0, 0.02, pitch=pitch)[0]
        for pitch in (np.radians(2.3), constant(2.3))
    )
    assert np.abs(series.state - fixed.state).max() < 1e-9
    for channel, values in fixed.loads.items():
        assert np.abs(series.loads[channel] - values).max() < 1e-9 * np.abs(values).max()


def test_rk4_keeps_its_order_in_a_smooth_pitch(turbine):
    start, wind = turbine.operating_point(8.0, pitch=swinging().at([0.0])[0])[None], [ConstantWind(8.0)]

    def run(steps, name="rk4"):
        return simulate_block(turbine, name, 4.0 / steps, wind, start, 4.0, 0.5, pitch=swinging())[0]

    reference = run(4000, "dop853")
    scale = np.ptp(reference.state, axis=0)
    errors = [np.sqrt(np.mean(((run(n).state - reference.state) / scale) ** 2)) for n in (320, 640)]
    # the series' third derivative jumps at its samples, where the steps end
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.3)


def test_loads_are_those_of_the_pitch_at_their_time(turbine):
    series = swinging()
    start = turbine.operating_point(8.0, pitch=series.at([0.0])[0])
    run = fr.simulate(turbine, 8.0, "rk4", 0.01, 5.0, initial=start, output_step=0.5, pitch=series)
    for i in (0, 4, 10):
        then = turbine.loads(run.state[i : i + 1], run.wind[i : i + 1], float(series.at([run.time[i]])[0]))
        for channel, values in run.loads.items():
            assert values[i] == pytest.approx(then[channel][0], rel=1e-9, abs=1e-3)


def test_pitching_to_feather_takes_the_thrust_away(turbine):
    series = fr.PitchSeries([0, 5, 10, 15, 20], np.radians([0, 0, 4, 10, 10]))
    run = fr.simulate(turbine, 8.0, "rk4", 0.02, 20.0, output_step=0.1, pitch=series)
    thrust = run.loads["rotor_thrust"]
    assert thrust[-1] < 0.4 * thrust[0]
    assert run.state[-1, 14] < run.state[0, 14]


@pytest.mark.slow(
    reason="compiles the loop of every family for a pitch per lane; the default loop does heun, rk4, tsit5 and abm4"
)
@pytest.mark.parametrize("name", CLASSICAL)
def test_every_classical_method_takes_a_series(turbine, name):
    start = turbine.operating_point(8.0, pitch=np.radians(4.0))[None]
    run, fine = (
        simulate_block(turbine, n, h, [ConstantWind(8.0)], start, 2.0, 0.5, pitch=swinging())[0]
        for n, h in ((name, 0.002), ("dop853", 0.01))
    )
    assert run.state[:, 14] == pytest.approx(fine.state[:, 14], rel=3e-3 if name == "euler" else 1e-5)


@pytest.mark.parametrize("name", sorted(set(METHODS) - set(CLASSICAL)))
def test_methods_made_for_one_pitch_refuse_a_series(turbine, name):
    with pytest.raises(
        InputError, match=f"{name} is made for one pitch; with a pitch that varies in time use"
    ):
        fr.simulate(turbine, 8.0, name, 0.01, 1.0, pitch=constant(0))


def test_a_corrector_refuses_a_series(turbine):
    with pytest.raises(InputError, match="corrector rk4-100ms is made for one pitch"):
        fr.simulate(turbine, 8.0, "rk4", 0.1, 1.0, pitch=constant(0), corrector="rk4-100ms")


@pytest.mark.parametrize(
    ("time", "angle", "message"),
    [
        ([0], [0], "at least two times and one angle for each"),
        ([0, 1], [0, 0.1, 0.2], "at least two times and one angle for each"),
        ([0, 1, 3], [0, 0, 0], "start at 0 s and rise in equal steps"),
        ([1, 2, 3], [0, 0, 0], "start at 0 s and rise in equal steps"),
        ([0, 1, 2], [0, np.nan, 0], "finite numbers"),
    ],
)
def test_a_series_that_is_none_is_refused(time, angle, message):
    with pytest.raises(InputError, match=message):
        fr.PitchSeries(time, angle)


def test_a_series_must_last_and_stay_in_the_tables(turbine):
    with pytest.raises(InputError, match="it ends at 10 s, the run at 12 s"):
        fr.simulate(turbine, 8.0, "rk4", 0.01, 12.0, pitch=constant(0))
    high = fr.PitchSeries([0, 1, 2, 3], np.radians([0, 20, 31, 20]))
    with pytest.raises(
        InputError, match=r"deg at 2(\.\d+)? s is outside the aerodynamic table \(-5 to 30 deg\)"
    ):
        fr.simulate(turbine, 8.0, "rk4", 0.01, 2.5, pitch=high)


CAMPAIGN = {
    "name": "pitching",
    "duration": 4,
    "pitch": {"time": [0, 1, 2, 3, 4], "angle": [0, 1, 3, 4, 4]},
    "wind": {"speeds": [8, 9]},
    "integrators": [{"method": "heun", "step": 0.01}],
    "reference": {"method": "rk7", "step": 0.005},
}


def test_a_campaign_runs_with_a_schedule(tmp_path, monkeypatch):
    monkeypatch.setattr("fatigue_runner.report.write_report", lambda folder: folder / "report.html")
    results = fr.run_campaign(CAMPAIGN, tmp_path / "out", workers=1)
    assert results.exit_code == 0
    rows = results.where(method="heun")
    assert len(rows) == 2 and all(row["nrmse_max"] < 0.05 for row in rows)
    assert rows[0]["pitch_deg"] is None  # it is no single number
    still = fr.run_campaign(CAMPAIGN | {"pitch": 0}, tmp_path / "still", workers=1)
    thrust = "mean_rotor_thrust"
    assert rows[0][thrust] < 0.95 * still.where(method="heun")[0][thrust]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"pitch": "2 deg"},
            "pitch: must be a number of degrees or a section with the keys time, angle; got '2 deg'",
        ),
        (
            {"pitch": {"time": [0, 1, 3], "angle": [0, 1, 2]}},
            "times must start at 0 s and rise in equal steps",
        ),
        ({"pitch": {"time": [0, 1], "angel": [0, 1]}}, "unknown key 'angel'"),
        ({"pitch": {"time": [0, 1], "angle": [0, 1]}}, "it ends at 1 s, the run at 4 s"),
        ({"pitch": {"time": [0, 4], "angle": [0, 40]}}, "40 deg at 4 s is outside the aerodynamic table"),
        ({"integrators": [{"method": "etdrk4", "step": 0.01}]}, "etdrk4 is made for one pitch"),
        (
            {"integrators": [{"method": "rk4", "step": 0.1, "corrector": "rk4-100ms"}]},
            "corrector rk4-100ms is made for one pitch",
        ),
    ],
)
def test_a_schedule_that_makes_no_sense_is_refused_in_one_sentence(change, message):
    with pytest.raises(InputError) as error:
        make_plan(CAMPAIGN | change)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("which", ["time", "angle"])
def test_a_masked_sample_of_a_pitch_series_is_refused(which):
    given = {"time": [0.0, 1.0, 2.0], "angle": [0.0, 0.1, 0.2]}
    given[which] = np.ma.array(given[which], mask=[False, True, False])
    with pytest.raises(InputError, match=f"pitch series: {which} is masked at index 1"):
        fr.PitchSeries(**given)


def test_a_masked_initial_state_is_refused():
    turbine = fr.load_turbine("nrel5mw")
    state = np.ma.array(turbine.operating_point(8.0))
    state[3] = np.ma.masked
    with pytest.raises(InputError, match="initial is masked at index 3"):
        fr.simulate(turbine, wind=fr.ConstantWind(8.0), method="rk4", step=0.05, duration=1.0, initial=state)
