"""The benchmark of a campaign adds up, and says what it measured."""

from __future__ import annotations

import json
import time

from typer.testing import CliRunner

from fatigue_runner import stopwatch
from fatigue_runner.benchmark.speed import campaign
from fatigue_runner.cli import app


def test_stages_count_without_those_inside_of_them():
    ticks = iter([0.0, 1.0, 3.0, 4.0, 10.0, 20.0])
    with stopwatch.counting(lambda: next(ticks)):
        with stopwatch.stage("outer"), stopwatch.stage("inner"):
            pass
        with stopwatch.stage("outer"):
            pass
    assert stopwatch.taken(("outer", "inner", "other")) == {"outer": 2.0 + 10.0, "inner": 2.0, "other": 0.0}
    assert stopwatch.taken(("outer",)) == {"outer": 0.0}
    assert stopwatch.clock is time.perf_counter


def test_every_stage_of_a_small_campaign_is_told(tmp_path):
    result = CliRunner().invoke(
        app,
        ["benchmark", "campaign", "--duration", "20", "--seeds", "1", "--repeats", "1", "--json", str(tmp_path / "f.json")],
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    figures = json.loads((tmp_path / "f.json").read_text())
    assert [(s["logged"], s["workers"], s["cases"]) for s in figures["situations"]] == [
        (logged, workers, 20) for logged in (False, True) for workers in (1, 2)
    ]
    for s in figures["situations"]:
        assert all(value > 0 for name, value in s["stages"].items() if name != "logging")
        assert (s["stages"]["logging"] > 0) == (s["log_bytes_per_case"] > 0) == s["logged"]
        # one thread's time on a processor is no longer than the clock's
        assert sum(s["stages"].values()) <= s["core"] * 1.05
        assert 0 < sum(s["fixed"].values()) < s["whole"]
    assert all(name in result.output for name in (*campaign.STAGES, *campaign.FIXED))
