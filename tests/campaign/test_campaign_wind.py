"""Campaigns in winds with azimuthal harmonics, on the real turbine: logs that hold them are evaluated to the same bits."""

from __future__ import annotations

import json

import numpy as np
import pytest
from field_files import some_field, write_bts

from fatigue_runner.campaign import run_campaign
from fatigue_runner.campaign.plan import make_plan
from fatigue_runner.errors import InputError
from fatigue_runner.logbook import read_log
from fatigue_runner.report.rundata import load_run
from fatigue_runner.turbine import load_turbine
from fatigue_runner.wind import TurbulentWind

TURBULENT = {
    "name": "harmonics",
    "duration": 6,
    "workers": 1,
    "wind": {"type": "turbulent", "speeds": [8, 11], "intensity": 0.14, "harmonics": 6},
    "integrators": [{"method": "rk4", "step": 0.05}],
    "reference": {"method": "rk7", "step": 0.02},
    "fatigue": {"wohler_exponents": [4]},
    "log": {"precision": "float64"},
}
AGAIN = TURBULENT | {"discard": 1, "fatigue": {"wohler_exponents": [4, 10]}}


@pytest.fixture(autouse=True)
def no_report(monkeypatch):
    monkeypatch.setattr("fatigue_runner.report.write_report", lambda folder: folder / "report.html")


def figures(results) -> list[dict]:
    return [{name: value for name, value in row.items() if name != "wall_time"} for row in results]


def test_logs_with_harmonics_are_evaluated_again_to_the_bits_of_a_fresh_run(tmp_path, monkeypatch):
    run_campaign(TURBULENT, tmp_path / "resumed")
    fresh = run_campaign(AGAIN, tmp_path / "fresh")
    with monkeypatch.context() as patch:
        patch.setattr(
            "fatigue_runner.campaign.block.simulate", lambda *_: pytest.fail("the logs hold it all")
        )
        resumed = run_campaign(AGAIN, tmp_path / "resumed")
    assert resumed.simulated == 4 and figures(resumed) == figures(fresh)
    for case_id in fresh.column("case_id"):
        ours, theirs = (read_log(tmp_path / run / "logs" / f"{case_id}.mcap") for run in ("resumed", "fresh"))
        assert ours.wind.shape == (301, 15) and ours.wind.tobytes() == theirs.wind.tobytes()
        assert ours.state.tobytes() == theirs.state.tobytes()
    (first,) = fresh.where(method="rk4", wind_speed=8.0)
    log = read_log(tmp_path / "fresh" / "logs" / f"{first['case_id']}.mcap")
    wind = TurbulentWind(8.0, 0.14, seed=first["seed"], duration=6.0).on(load_turbine("nrel5mw").rotor)
    np.testing.assert_allclose(log.wind, wind.at(log.time), rtol=1e-12, atol=1e-12)


def test_table_and_log_say_how_strong_the_wind_is_at_a_point_and_over_the_rotor(tmp_path):
    results = run_campaign(
        TURBULENT | {"wind": TURBULENT["wind"] | {"shear_exponent": 0.1}}, tmp_path / "out"
    )
    for row in results:
        assert (row["turbulence_intensity"], row["harmonics"], row["shear_exponent"]) == (0.14, 6, 0.1)
        log = read_log(tmp_path / "out" / "logs" / f"{row['case_id']}.mcap")
        assert row["rotor_intensity"] == pytest.approx(log.wind[:, 0].std() / log.wind[:, 0].mean(), rel=1e-6)
        assert row["rotor_intensity"] < 0.1
        assert log.run["harmonics"] == "6" and float(log.result["rotor_intensity"]) == row["rotor_intensity"]
        assert log.run["wind_description"].startswith("IEC 61400-1 turbulence, Kaimal spectrum")
        assert "m/s (14.0\u00a0% of the mean) at a point" in log.run["wind_strength"]
        assert log.run["wind_left_out"] == "lateral and vertical turbulence; azimuthal harmonics above 6"


def test_a_wind_from_a_file_is_in_the_table_by_the_file_s_name_and_notes_are_told_once(tmp_path):
    field = write_bts(
        tmp_path / "coarse.bts",
        some_field(300, 7, 7),
        spacing=(25.0, 25.0),
        mean=9.0,
        hub=90.0,
        time_step=0.1,
    )
    wind = {"type": "full-field", "files": [str(field)], "harmonics": 6}
    campaign = TURBULENT | {"wind": wind, "reference": None}
    _, note = make_plan(campaign).notes  # the first: a fixed pitch has no controller
    assert "coarse.bts: points every 25 m hold azimuthal harmonics up to 5 on this rotor" in note
    (row,) = run_campaign(campaign, tmp_path / "out")
    assert row["wind_file"] == "coarse.bts" and row["wind_source"] == "full-field" and row["seed"] is None
    log = read_log(tmp_path / "out" / "logs" / f"{row['case_id']}.mcap")
    assert log.run["wind_notes"] == note and log.run["wind_file"] == "coarse.bts"


def test_two_gusts_at_one_speed_are_two_winds_in_the_table_and_the_report(tmp_path):
    wind = {"type": "gust", "speeds": 8, "gusts": ["EOG", "EWSV+"], "turbulence_class": "A", "begin": 0}
    run_campaign(TURBULENT | {"wind": wind, "duration": 13, "output_rate": 20}, tmp_path / "out")
    run = load_run(tmp_path / "out")
    assert [wind.rows[0]["gust"] for wind in run.winds] == ["EOG", "EWSV+"]
    assert [len(wind.rows) for wind in run.winds] == [2, 2]


def test_a_channel_that_the_wind_does_not_have_is_refused_with_its_line_before_anything_runs(tmp_path):
    file = tmp_path / "campaign.yaml"
    file.write_text(json.dumps(TURBULENT | {"log": {"channels": ["wind_speed", "wind_cos_7"]}}, indent=1))
    with pytest.raises(
        InputError, match=r"yaml:\d+: 'wind_cos_7' cannot be logged, the wind has 6 azimuthal"
    ):
        make_plan(file)
    make_plan(TURBULENT | {"log": {"channels": ["wind_cos_6"]}})
