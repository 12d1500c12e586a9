"""The report's life: words first, its tables and figures; and what is said where it cannot be told."""

from __future__ import annotations

import json

import pytest
from report_example import CAMPAIGN, example_rows, write_run

from fatigue_runner.errors import InputError
from fatigue_runner.report.blocks import Figure, Table, Warnings
from fatigue_runner.report.page import render
from fatigue_runner.report.rundata import load_run
from fatigue_runner.report.sections import definitions, life, life_spectra
from fatigue_runner.results.records import to_line

LIFE = {"climate": "II", "bins": {"edges": [4.5, 5.5, 6.5, 7.5, 8.5, 9.5, 10.5]}}
DAMAGE = {"damage": [{"place": "tower_base", "curve": "dnv-d-air"}]}


def run_with(folder, lifetime=LIFE, **rows):
    table = example_rows(seeds=("1", "2", "3"), **rows)
    for row in table:
        for i, angle in enumerate((0, 90, 180, 270)):
            row[f"damage_tower_base_{angle:03d}"] = (
                "" if row["status"] != "done" else 1e-3 * row["wind_speed"] * (1 + i % 2)
            )
    campaign = CAMPAIGN | {"lifetime": lifetime, "fatigue": CAMPAIGN["fatigue"] | DAMAGE}
    return load_run(write_run(folder, table, campaign))


def test_the_life_is_told_in_words_before_any_figure(tmp_path):
    section = life.build(run_with(tmp_path))
    said = [block.text for block in section.blocks if block.kind == "paragraph"]
    assert said[0].startswith("Tower base: ") and "years" in said[0] and "at azimuth 90°" in said[0]
    assert any(text.startswith("Lifetime equivalent loads for 1e7 cycles") for text in said)
    assert any("Climate: IEC class II. The 6 bins from 4.5 to 10.5" in text for text in said)
    kinds = [block.kind for block in section.blocks]
    assert kinds.index("paragraph") < kinds.index("warnings") < kinds.index("table") < kinds.index("figure")


def test_its_tables_have_the_whole_life_and_mark_what_is_lost(tmp_path):
    section = life.build(run_with(tmp_path, diverging=True))
    places, loads, bins = (block for block in section.blocks if isinstance(block, Table))
    assert [row.cells[0] for row in places.rows] == ["tower base"]
    assert len(loads.rows) == 4 * 5
    assert bins.rows[-1].cells[0] == "sum" and len(bins.rows) == 7
    assert float(bins.rows[-1].cells[2]) == float(f"{load_run(tmp_path).life.covered:.4f}")
    doubts = next(block for block in section.blocks if isinstance(block, Warnings))
    assert any("heun 40 ms: 3 cases with a probability of" in item for item in doubts.items)
    assert sum(isinstance(block, Figure) for block in section.blocks) == 3


def test_the_definitions_name_climate_curve_and_years(tmp_path):
    items = dict(definitions.build(run_with(tmp_path)).blocks[0].items)
    assert "T = 20 years of 8760 h" in items["Lifetime DEL"]
    assert "curve dnv-d-air" in items["Damage of a section"]


def test_without_logs_the_spectra_say_so(tmp_path):
    section = life_spectra.build(run_with(tmp_path))
    assert "no readable logs" in section.blocks[-1].text


def test_a_life_that_cannot_be_told_says_why_and_one_not_asked_for_is_not_there(tmp_path):
    section = life.build(run_with(tmp_path, lifetime={"climate": "II", "bins": {"edges": [4, 11, 12]}}))
    assert "bin from 11 to 12 m/s has no wind" in section.blocks[0].text
    assert life.build(load_run(write_run(tmp_path / "none", example_rows()))) is None


def test_a_run_that_has_not_ended_says_so_and_shows_what_there_is(tmp_path):
    rows = example_rows(diverging=False)
    write_run(tmp_path, rows, CAMPAIGN)
    (tmp_path / "results.csv").unlink()
    lines = [to_line({"row": {k: None if v == "" else v for k, v in row.items()}}) for row in rows[:25]]
    (tmp_path / "cases.jsonl").write_bytes(b"".join([*lines, to_line({"row": {"case_id": "cut off"}})[:40]]))
    (tmp_path / "run.json").write_text(json.dumps({"campaign": CAMPAIGN, "cases": len(rows)}))
    run = load_run(tmp_path)
    page = render(run)
    assert f"The run is not finished: 25 of {len(rows)} cases are there" in page and "not yet" in page
    (tmp_path / "cases.jsonl").write_text("")
    with pytest.raises(InputError, match="has not finished a case yet"):
        load_run(tmp_path)
