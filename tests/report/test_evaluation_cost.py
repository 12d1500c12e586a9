"""The report tells the paper's cost where a campaign timed the evaluations, and only there."""

from __future__ import annotations

import json

import pytest
from report_example import CAMPAIGN, example_rows, write_run

from fatigue_runner.report import rundata
from fatigue_runner.report.rundata import load_run
from fatigue_runner.report.sections import evaluation_cost
from fatigue_runner.results.evaluation_cost import delta_t

TIMES = {"f": {"single": 8e-7, "lane": 5e-8}, "net": {"single": 1.6e-5, "lane": 1e-6}}


def corrected(row):
    if row["method"] != "rk3":
        return row | {"delta_e": 1e-3, "delta_e_range": 1e-9, "acceptance_rate": ""}
    return row | {
        "method": "heun", "corrector": "net", "mode": "hybrid", "acceptance_rate": 0.995 if row["wind_speed"] < 8 else 0.5,
        "delta_e": 1e-4, "delta_e_range": 1e-11,
    }  # fmt: skip


@pytest.fixture
def build(tmp_path, monkeypatch):
    monkeypatch.setattr(rundata, "_read_log", lambda path: None)

    def built(times):
        write_run(tmp_path, [corrected(row) for row in example_rows(diverging=False)], CAMPAIGN)
        stored = {"campaign": CAMPAIGN, "facts": {}, "wind": {}, "operating_curve": {}}
        (tmp_path / "run.json").write_text(
            json.dumps(stored | ({"evaluation_times": times} if times else {}))
        )
        return evaluation_cost.build(load_run(tmp_path))

    return built


def test_without_times_there_is_no_such_section(build):
    assert build(None) is None


def test_delta_t_stands_beside_the_measured_time_for_every_integrator(build):
    _, times, table, boxes, acceptance = build(TIMES).blocks
    assert [row.cells for row in times.rows] == [
        ["f", "800", "50", "–"],
        ["N of net", "16,000", "1,000", "20"],
    ]
    cells = {row.cells[0]: row.cells for row in table.rows}
    own = cells["heun 10 ms + net, hybrid"]
    assert own[1] == "300" and own[2] == f"{delta_t(300, 0.01, 8e-7, 1.6e-5) * 1e6:,.0f}"
    assert own[3] == f"{delta_t(300, 0.01, 5e-8, 1e-6) * 1e6:.0f}"
    assert own[-2] == f"{(3 * 99.5 + 3 * 50) / 6:.1f} %" and cells["heun 10 ms"][-2] == "–"
    assert "<svg" in boxes.svg and "<svg" in acceptance.svg


def test_a_corrector_that_was_not_timed_has_no_delta_t(build):
    _, _, table, *_ = build({"f": TIMES["f"]}).blocks
    cells = {row.cells[0]: row.cells for row in table.rows}
    assert cells["heun 10 ms + net, hybrid"][2] == "–" and cells["heun 10 ms"][2] != "–"
