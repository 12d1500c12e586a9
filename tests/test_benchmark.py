"""The work-precision benchmark: fair to every method, honest about what diverges, and its answers are those of its points."""

from __future__ import annotations

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from fatigue_runner.benchmark import adaptive, answers, page, text, work_precision
from fatigue_runner.benchmark.cases import BUILT_IN, load_cases
from fatigue_runner.benchmark.work_precision import Point
from fatigue_runner.integrators import METHODS

SMALL = {
    "name": "small",
    "duration": 8,
    "output_rate": 50,
    "wind": {"type": "turbulent", "speeds": [7, 9], "intensity": 0.1, "seeds": [9001]},
}
CHOSEN = [("heun", 0.01), ("heun", 0.2), ("rk4", 0.05), ("etdrk4", 0.1)]


@pytest.fixture(scope="module")
def cases():
    return load_cases(SMALL)


@pytest.fixture(scope="module")
def result(cases):
    return work_precision.measure(cases, repeats=2, chosen=CHOSEN)


def point(method, step, cost, error, **others):
    return Point(
        "x", method, step, cost, {"median": cost * 1e-6}, nrmse_max=error, del_error_max=error, **others
    )


def test_no_registered_method_is_left_out(cases):
    assert {name for name, _ in work_precision.integrators(cases)} == set(METHODS)


def test_what_a_campaign_lists_runs_beside_the_ladder():
    cases = load_cases({**SMALL, "integrators": [{"method": "rk4", "step": 0.0123}]})
    assert ("rk4", 0.0123) in work_precision.integrators(cases)


def test_every_method_is_shown_beyond_its_stability_limit(cases):
    from fatigue_runner.integrators import stability_limit

    for name in METHODS:
        limit = stability_limit(cases.turbine, name)
        steps = [step for other, step in work_precision.integrators(cases) if other == name]
        assert max(steps) > limit or limit >= max(work_precision.LADDER)


def test_built_in_winds_are_ones_that_nothing_is_trained_on():
    assert {wind["wind"]["type"] for wind in BUILT_IN} == {"turbulent", "constant"}
    assert all(seed >= 9000 for wind in BUILT_IN for seed in wind["wind"].get("seeds", []))


def test_an_unstable_combination_says_when_it_diverged_and_has_no_errors(result):
    lost = next(p for p in result["points"] if p.step == 0.2)
    assert lost.diverged == 2 and 0 < lost.diverged_at < 8
    assert lost.nrmse_max is None and lost.del_error_max is None and not lost.wall
    assert "diverged, first at" in "\n".join(text.cases({**result, "adaptive": []}))


def test_costs_and_errors_of_the_others_are_complete(result):
    fine = [p for p in result["points"] if not p.diverged]
    assert [p.method for p in fine] == ["heun", "rk4", "etdrk4"]
    for p in fine:
        assert 0 < p.wall["low"] <= p.wall["median"] <= p.wall["high"]
        assert 0 < p.nrmse_max <= p.nrmse_worst and set(p.nrmse.values()) >= {p.nrmse_max}
        assert p.del_error_max == max(p.del_error.values())
        assert len(p.delta_e) == len(p.delta_e_range) == 2
    # the initial slope is one evaluation more
    assert fine[0].evaluations_per_second == pytest.approx(200 + 1 / 8)


def test_the_reference_is_measured_against_another_method_and_step(result):
    checks = result["reference"]["agreement"]
    assert {c["method"] for c in checks} == {"dop853", "rk7"} and len({c["step"] for c in checks}) == 2
    # its own error is far below the errors that are shown
    smallest = min(p.nrmse_max for p in result["points"] if not p.diverged)
    assert max(c["nrmse_worst"] for c in checks) < 0.01 * smallest


def test_the_front_holds_the_points_that_none_beats_and_none_that_diverged():
    points = [
        point("a", 0.1, 10, 1e-2),
        point("b", 0.1, 20, 2e-2),
        point("c", 0.1, 30, 1e-3),
        point("d", 0.1, 30, 2e-3),
        point("e", 0.1, 5, 1e-6, diverged=1),
        point("f", 0.1, 1, 0.5),
    ]
    assert [p.method for p in answers.front(points, answers.wall, answers.nrmse)] == ["a", "c"]


def test_the_cheapest_method_is_named_with_the_next_one():
    points = [point("a", 0.1, 10, 5e-3), point("a", 0.05, 20, 5e-4), point("b", 0.1, 30, 1e-9)]
    said = answers.sentences(points)
    assert said[0].startswith("NRMSE 1e-02: a 100 ms is cheapest") and "b 100 ms" in said[0]
    assert said[1].startswith("NRMSE 1e-03: a 50 ms") and "1.50 times" in said[1]
    assert answers.sentences(points[:1])[3] == "NRMSE 1e-05: no method on the ladder reaches it."


def test_adaptive_methods_come_closer_with_their_tolerance(cases, monkeypatch):
    monkeypatch.setattr(adaptive, "TOLERANCES", (1e-3, 1e-6))
    reference = work_precision.make_reference(cases, *work_precision.REFERENCE)
    points = adaptive.measure(cases, reference, count=1)
    for loose, tight in (points[:2], points[2:]):
        assert tight.nrmse_max < 0.1 * loose.nrmse_max
        assert tight.evaluations_per_second > loose.evaluations_per_second


def test_the_page_holds_the_answers_and_its_figures(result, cases, tmp_path):
    part = {**result, "adaptive": []}
    whole = {"machine": page.machine.describe(), "load_average": 0.0, "repeats": 2, "cases": [part]}
    written = page.write(whole, tmp_path, tmp_path / "images").read_text(encoding="utf-8")
    for sentence in answers.sentences(result["points"]):
        assert sentence in written
    for line in written.splitlines():
        if line.startswith("!["):
            assert (tmp_path / line.split("(")[1].rstrip(")")).stat().st_size > 5000


def test_json_holds_every_point_with_plain_values(monkeypatch, tmp_path, result):
    from fatigue_runner.benchmark.commands import app

    whole = {"machine": {}, "load_average": 0.0, "repeats": 2, "cases": [{**result, "adaptive": []}]}
    monkeypatch.setattr(page, "measure", lambda *arguments: whole)
    file = tmp_path / "figures.json"
    done = CliRunner().invoke(app, ["work-precision", "--json", str(file)])
    assert done.exit_code == 0 and "Pareto front" in done.output
    points = json.loads(file.read_text())["cases"][0]["points"]
    assert [p["method"] for p in points] == [m for m, _ in CHOSEN]
    assert points[0]["delta_t"] == points[0]["wall"]["median"] and points[1]["delta_t"] is None


def test_operations_are_counted_without_the_index_arithmetic():
    from fatigue_runner.benchmark.kernel import operations

    # counted by hand: about 1,150 packed instructions, most of them fused, and 24 cubics
    assert 1500 < operations() < 2500


@pytest.mark.slow
def test_the_kernel_benchmark_finds_packed_code_faster_than_scalar_code():
    from fatigue_runner.benchmark import kernel

    found = kernel.measure(repeats=3)
    assert all(r["ratio"] > 1.5 for r in found["cases"] if r["cases"] >= 16)
    assert 0.01 < found["share_of_peak"] < 1.0
    assert np.isfinite([s["over_kernel"] for s in found["whole_steps"]]).all()
