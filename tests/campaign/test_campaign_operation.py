"""A campaign of a turbine that operates: from YAML to loads under the controller, logged and resumed."""

from __future__ import annotations

import numpy as np
import pytest

from fatigue_runner import run_campaign, simulate
from fatigue_runner.campaign.evaluate import discarded
from fatigue_runner.campaign.plan import make_plan
from fatigue_runner.campaign.resolve import resolve
from fatigue_runner.errors import InputError
from fatigue_runner.logbook import read_log
from fatigue_runner.wind import ConstantWind

CAMPAIGN = {
    "name": "operation",
    "duration": 8,
    "discard": 2,
    "operation": "controlled",
    "wind": {"type": "turbulent", "speeds": [8, 18], "intensity": 0.1},
    "integrators": [{"method": "rk4", "step": 0.05}],
    "reference": {"method": "dop853", "step": 0.05},
    "workers": 1,
}


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return run_campaign(CAMPAIGN, tmp_path_factory.mktemp("operation") / "run")


def test_cases_run_above_rated_under_the_controller(results):
    assert {row["status"] for row in results} == {"done"}
    assert {row["operation"] for row in results} == {"controlled"} and results.rows[0]["pitch_deg"] is None
    errors = [row["nrmse_max"] for row in results if not row["is_reference"]]
    assert max(errors) < 0.01


def test_logs_hold_the_controller_s_states(results):
    log = read_log(results.out / "logs" / f"{results.rows[-1]['case_id']}.mcap")
    names = [channel.name for channel in log.states]
    assert names[-2:] == ["filtered_generator_speed", "speed_error_integral"] and log.state.shape[1] == 18
    assert log.state[:, 16] == pytest.approx(122.9, rel=0.1)


def test_pitch_power_and_the_controller_s_signals_are_in_logs_and_results(results):
    row = results.rows[-1]
    log = read_log(results.out / "logs" / f"{row['case_id']}.mcap")
    assert {"pitch_rate", "pitch_rate_limited", "torque_region", "filtered_generator_speed"} <= set(
        log.control
    )
    assert np.array_equal(log.pitch, log.loads["blade_pitch"]) and np.degrees(log.pitch).mean() > 10
    kept = log.time >= 2.0 - 1e-9
    assert row["mean_generator_power"] == pytest.approx(5.0e6, rel=0.02)
    assert row["std_blade_pitch"] == pytest.approx(np.std(log.pitch[kept]))
    assert row["std_rotor_speed"] == pytest.approx(np.std(log.state[kept, 14]))
    assert row["pitch_rate_max"] == pytest.approx(np.abs(log.control["pitch_rate"][kept]).max())
    assert row["pitch_rate_limited_time"] == 0.0
    errors = [r["nrmse_speed_error_integral"] for r in results if not r["is_reference"]]
    assert len(errors) == 2 and max(errors) < 0.01


def test_a_pitch_beyond_its_limit_is_told():
    from fatigue_runner.results.operation import pitch_rate_sentences

    quiet = {"pitch_rate_limited_time": 0.0, "pitch_rate_max": 0.01, "wind_speed": 12.0}
    beyond = {"pitch_rate_limited_time": 1.5, "pitch_rate_max": 0.1745329, "wind_speed": 24.0}
    assert pitch_rate_sentences([quiet]) == []
    (sentence,) = pitch_rate_sentences([quiet, beyond])
    assert (
        "In 1 of 2 cases" in sentence
        and "up to 10 deg/s, for up to 1.5 s, at mean winds from 24 to 24 m/s" in sentence
    )


def test_winds_outside_of_cut_in_and_cut_out_run_and_are_told():
    notes = make_plan({**CAMPAIGN, "wind": {"speeds": [10, 26]}}).notes
    assert [note for note in notes if "26 m/s is above the cut-out wind of nrel5mw (25 m/s)" in note]
    assert not any("10 m/s is" in note for note in notes)


def test_a_second_run_keeps_what_is_finished(results):
    again = run_campaign(CAMPAIGN, results.out)
    load = "del_tower_base_fore_aft_moment_m4"
    assert again.simulated == 0 and np.array_equal(again.column(load), results.column(load))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"operation": "controled"}, "operation: 'controled' is not known; did you mean 'controlled'"),
        ({"pitch": 2.0}, "pitch: operation 'controlled' makes the pitch itself; remove `pitch`"),
        ({"turbine": "t2b1i1cg"}, "turbine t2b1i1cg has no `control` section"),
    ],
)
def test_operations_that_cannot_be_are_refused_in_one_sentence(change, message):
    with pytest.raises(InputError, match=message):
        make_plan({**CAMPAIGN, **change})


def test_what_is_discarded_is_discarded_of_every_series(nrel5mw):
    run = simulate(nrel5mw, ConstantWind(16.0), "rk4", 0.05, 4.0, operation="controlled")
    kept = discarded(run, 1.0)
    lengths = {len(kept.time), len(kept.state), len(kept.wind), len(kept.pitch)}
    lengths |= {len(series) for series in (*kept.loads.values(), *kept.control.values())}
    assert lengths == {61} and set(kept.control) == set(run.control)


@pytest.mark.parametrize("initial", ["paper-spinning", [0.0] * 6 + [1.0, 97.0] + [0.0] * 6 + [1.2, 116.4]])
def test_a_controller_begins_as_if_a_given_start_had_been_so_for_long(initial):
    wind = resolve(make_plan({**CAMPAIGN, "initial": initial}).named).winds[0]
    assert wind.initial.shape == (18,)
    assert wind.initial[15] > 0 and wind.initial[16] == wind.initial[15] and wind.initial[17] == 0
    if not isinstance(initial, str):
        assert list(wind.initial[:16]) == initial


FIXED = {
    "name": "fixed",
    "duration": 20,
    "integrators": [{"method": "rk4", "step": 0.02}],
    "reference": None,
    "workers": 1,
    "log": {"enabled": False},
}


def test_a_fixed_pitch_is_told_before_the_run_with_what_rated_is_and_which_winds_are_above():
    notes = make_plan({**FIXED, "wind": {"speeds": [8, 14]}}).notes
    assert notes[0].startswith("The pitch is fixed") and "rated is 12.1 rpm" in notes[0]
    assert "in some 11 m/s, and 1 of 2 winds are above" in notes[0]
    assert not any("The pitch is fixed" in note for note in make_plan(CAMPAIGN).notes)


def test_a_wind_that_nothing_holds_is_refused_with_the_controller_as_the_way_out():
    """It once advised a start of one's own, which led to 128 rpm and a verdict."""
    with pytest.raises(
        InputError, match=r"no steady rotation at 18 m/s.*rated 12\.1 rpm.*operation: controlled"
    ) as refused:
        make_plan({**FIXED, "wind": {"speeds": 18}})
    assert "initial" not in str(refused.value)


def test_tables_and_speeds_that_were_left_are_told_in_terminal_and_report(tmp_path, capsys):
    from rich.console import Console

    from fatigue_runner.cli import _print_outcome

    times = "".join(f"{i},{max(8 - i, 0.4)}\n" for i in range(21))
    (tmp_path / "calm.csv").write_text(f"time,wind_speed\n{times}")
    wind = {"type": "file", "files": str(tmp_path / "calm.csv")}
    results = run_campaign({**FIXED, "wind": wind}, tmp_path / "run")
    _print_outcome(results, Console(width=400))
    told = "1 of 1 cases left the range of the aerodynamic tables"
    assert told in capsys.readouterr().out
    page = (tmp_path / "run" / "report.html").read_text()
    assert told in page and "no controller limits the rotor&#39;s speed; rated is 12.1 rpm" in page
