"""The report says which wind blew: its model, its strength at a point and over the rotor, what is left out, and notes on files."""

from __future__ import annotations

import json

import pytest
from report_example import CAMPAIGN, case_row, write_run

from fatigue_runner.report import rundata
from fatigue_runner.report.rundata import load_run
from fatigue_runner.report.sections.wind import MOST, build

WORDS = {
    "descriptions": ["IEC 61400-1 turbulence of class B"],
    "left_out": ["lateral and vertical turbulence; azimuthal harmonics above 6"],
    "notes": ["a.bts: points every 25 m hold azimuthal harmonics up to 5."],
}


def turbulent(speed, seed, rotor, **more):
    """Reference and one integrator in a wind whose rotor's mean has that intensity."""
    wind = {
        "turbulence_intensity": 0.2,
        "harmonics": 6,
        "shear_exponent": 0.2,
        "rotor_intensity": rotor,
    } | more
    return [
        case_row(speed, "rk7", 0.001, reference=True, seed=seed) | wind,
        case_row(speed, "rk4", 0.02, seed=seed) | wind,
    ]


def section(folder, rows, words=WORDS):
    write_run(folder, rows)
    if words is not None:
        (folder / "run.json").write_text(json.dumps({"facts": {}, "campaign": CAMPAIGN, "wind": words}))
    return build(load_run(folder))


def test_both_numbers_stand_beside_each_other_for_every_mean_speed(tmp_path):
    rows = [*turbulent(8, 1, 0.06), *turbulent(8, 2, 0.08), *turbulent(10, 1, 0.05)]
    said, table, notes = section(tmp_path / "run", rows).blocks
    assert [row.cells for row in table.rows] == [
        # root mean square over the seeds: sqrt((0.06^2 + 0.08^2) / 2) = 0.0707
        ["8", "2", "1.60 (20.0\u00a0%)", "0.57 (7.1\u00a0%)", "6", "α 0.2", "–"],
        ["10", "1", "2.00 (20.0\u00a0%)", "0.50 (5.0\u00a0%)", "6", "α 0.2", "–"],
    ]
    assert "that of a point at the hub" in table.caption
    assert said.text == (
        "IEC 61400-1 turbulence of class B. Each blade feels, at its own azimuth, 6 azimuthal harmonics of what differs over the rotor. "
        "Left out: lateral and vertical turbulence; azimuthal harmonics above 6."
    )
    assert notes.items == WORDS["notes"]


def test_a_diverged_case_takes_no_figure_from_its_wind(tmp_path):
    rows = turbulent(8, 1, 0.06)
    rows[0]["rotor_intensity"] = ""
    table = section(tmp_path / "run", rows).blocks[1]
    assert table.rows[0].cells[3] == "0.48 (6.0\u00a0%)"


def test_steady_linear_winds_have_no_table_and_no_harmonics(tmp_path):
    rows = [case_row(8, "rk4", 0.02) | {"harmonics": 1}]
    words = {"descriptions": ["steady wind, linear shears"], "left_out": [], "notes": []}
    (said,) = section(tmp_path / "run", rows, words).blocks
    assert said.text == "Steady wind, linear shears."


def test_a_random_sweep_of_hundreds_is_a_table_of_some(tmp_path):
    rows = [row for i in range(100) for row in turbulent(6 + 0.01 * i, 1, 0.06)]
    table = section(tmp_path / "run", rows).blocks[1]
    assert len(table.rows) == MOST and table.rows[0].cells[0] == "6" and table.rows[-1].cells[0] == "6.99"
    assert f"{MOST} of 100 rows" in table.caption


@pytest.mark.parametrize("words", [None, {}])
def test_a_folder_that_does_not_say_asks_a_log(tmp_path, monkeypatch, words):
    rows = turbulent(8, 1, 0.06)
    log = type("Log", (), {"run": {"wind_description": "a told wind", "wind_left_out": "much"}})()
    monkeypatch.setattr(rundata, "_read_log", lambda path: log)
    said = section(tmp_path / "run", rows, words).blocks[0]
    assert said.text.startswith("A told wind.") and said.text.endswith("Left out: much.")


def test_results_of_an_older_program_have_no_section(tmp_path):
    assert section(tmp_path / "run", [case_row(8, "rk4", 0.02)], None) is None
