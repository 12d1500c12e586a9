"""The report shows how a turbine operated, and where along its beams the loads wear."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from report_example import CAMPAIGN, ExampleLog, example_rows, write_run

from fatigue_runner.channels import STATE_NAMES, sections
from fatigue_runner.report import rundata
from fatigue_runner.report.rundata import load_run
from fatigue_runner.report.sections import beam_sections, histories, operation

CURVE = {
    "wind_speed": [5.0, 10.0], "rotor_speed": [0.7, 1.2], "blade_pitch": [0.0, 0.1], "generator_power": [5e5, 4e6],
    "rotor_thrust": [2e5, 6e5],
}  # fmt: skip


@pytest.fixture
def no_logs(monkeypatch):
    monkeypatch.setattr(rundata, "_read_log", lambda path: None)


def operated(row):
    figures = {"mean": 1.0, "std": 0.1, "min": 0.7, "max": 1.3}
    size = {
        "rotor_speed": 0.12 * row["wind_speed"],
        "blade_pitch": 0.1,
        "generator_power": 4e6,
        "rotor_thrust": 5e5,
    }
    return row | {f"{f}_{name}": x * value for name, value in size.items() for f, x in figures.items()}


def run_of(folder, rows, campaign, curve=None):
    write_run(folder, rows, campaign)
    if curve is not None:
        stored = {"campaign": campaign, "facts": {}, "wind": {}, "operating_curve": curve}
        (folder / "run.json").write_text(json.dumps(stored))
    return load_run(folder)


@pytest.mark.parametrize("curve", [None, CURVE])
def test_operation_stands_over_wind_with_its_scatter(tmp_path, no_logs, curve):
    rows = [operated(row) for row in example_rows(diverging=False)]
    section = operation.build(run_of(tmp_path, rows, CAMPAIGN | {"operation": "controlled"}, curve))
    figure, table = section.blocks
    assert "<svg" in figure.svg and ("The line is the operation in steady" in figure.caption) == (
        curve is not None
    )
    assert [column.head for column in table.columns][2::2] == [
        "Rotor speed", "Blade pitch", "Generator power", "Rotor thrust"
    ]  # fmt: skip
    # of the reference alone; 0.12 rad/s for every m/s, in rpm
    assert table.rows[0].cells[:3] == ["5", "1", f"{0.6 * 30 / math.pi:.2f}"]


def test_a_fixed_pitch_has_no_operation_to_show(tmp_path, no_logs):
    rows = [operated(row) for row in example_rows(diverging=False)]
    assert operation.build(run_of(tmp_path, rows, CAMPAIGN | {"operation": "fixed"})) is None
    bare = example_rows(diverging=False)
    assert operation.build(run_of(tmp_path, bare, CAMPAIGN | {"operation": "controlled"})) is None


def test_logs_of_a_few_channels_cost_no_page(tmp_path, monkeypatch):
    """The histories need a state that such logs do not hold."""
    log = ExampleLog(np.arange(100.0), np.full((100, len(STATE_NAMES)), np.nan), {})
    monkeypatch.setattr(rundata, "_read_log", lambda path: log)
    write_run(tmp_path, example_rows(diverging=False), CAMPAIGN)
    section = histories.build(load_run(tmp_path))
    assert section.blocks[0].text == "Not drawn: the run folder has no readable logs of the tower's motion."


def test_sections_stand_over_height_radius_and_direction(tmp_path, no_logs):
    channels = sections([0.0, 40.0], [1.5, 30.0], 12)
    rows = [
        row
        | {
            f"del_{c.name}_m{m}": row["wind_speed"] * (i + 1) * 1e4
            for i, c in enumerate(channels)
            for m in (4, 10)
        }
        for row in example_rows(speeds=(6, 8), diverging=False)
    ]
    run = run_of(tmp_path, rows, CAMPAIGN)
    figure, table = beam_sections.build(run).blocks
    assert "Power mean of the short-term DELs" in figure.caption and "by rk7 1 ms" in figure.caption
    assert len(table.rows) == 4 + 4 + 12
    expected = ((6.0**4 + 8.0**4) / 2) ** 0.25 * 10.0  # kN m
    assert table.rows[0].cells == ["tower fore-aft moment", "0", "4", f"{expected:,.4g}"]
    assert table.rows[-1].cells[:3] == ["blade 1 root moment", "165", "10"]
    # the verdict rests on base and root alone
    assert {channel for channel, _, _ in run.columns}.isdisjoint(c.name for c in channels)
    assert beam_sections.build(run_of(tmp_path / "b", example_rows(), CAMPAIGN)) is None
