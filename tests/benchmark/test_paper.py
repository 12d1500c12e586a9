"""The paper's figures: drawn from measurements of every integrator on the same unseen winds."""

from __future__ import annotations

import json

import numpy as np
import pytest

from fatigue_runner.benchmark.pages import paper as page
from fatigue_runner.benchmark.pages.paper_figures import draw
from fatigue_runner.benchmark.study import paper
from fatigue_runner.corrector import Corrector, Guard
from fatigue_runner.corrector.binding import Binding
from fatigue_runner.corrector.maps import RawNetwork
from fatigue_runner.turbine import load_turbine

CAMPAIGN = {
    "name": "tiny",
    "turbine": "t2b1i1cg",
    "duration": 0.2,
    "output_rate": 100,
    "initial": "paper-spinning",
    "wind": {"type": "constant", "speeds": [6.0, 8.0, 12.0]},
}


@pytest.fixture(scope="module")
def measured():
    turbine = load_turbine("t2b1i1cg")
    guard = Guard(0.0, "max", 1.0, 1.0, (1e-6,) * 16, (0.0,) * 16)
    # a network that gives nothing, and a guard that trusts nothing
    network = RawNetwork((np.zeros((16, 18)),))
    idle = [
        Corrector("idle", "mlp", Binding.to(turbine, "heun", step), network, guard) for step in (0.01, 0.005)
    ]
    return paper.measure(CAMPAIGN, idle, paper.BOXED)


def outcome(measured, label, step):
    return next(o for o in measured["outcomes"] if (o.label, o.step) == (label, step))


def test_every_integrator_meets_every_wind_at_every_step(measured):
    found = {(o.label, o.step) for o in measured["outcomes"]}
    assert found == {
        (name, step)
        for step in paper.BOXED
        for name in (*paper.CLASSICAL, *(f"heun + network, {m}" for m in ("enhanced", "hybrid")))
    }
    assert all(len(o.delta_e_range) == 3 for o in measured["outcomes"])


def test_a_network_of_zeros_is_heun_and_its_hybrid_without_trust_is_rk3(measured):
    for step in paper.BOXED:
        enhanced, hybrid = (outcome(measured, f"heun + network, {m}", step) for m in ("enhanced", "hybrid"))
        np.testing.assert_allclose(
            enhanced.delta_e_range, outcome(measured, "heun", step).delta_e_range, rtol=1e-6
        )
        np.testing.assert_allclose(
            hybrid.delta_e_range, outcome(measured, "rk3", step).delta_e_range, rtol=1e-6
        )
        assert hybrid.accepted == [0.0] * 3
        assert hybrid.evaluations == outcome(measured, "rk3", step).evaluations
        assert paper.at_equal_cost(measured, hybrid) == pytest.approx(
            np.median(hybrid.delta_e_range), rel=1e-6
        )


def test_what_costs_less_than_rk3_at_its_largest_step_is_not_compared_beyond_the_curve(measured):
    assert paper.at_equal_cost(measured, outcome(measured, "heun", 0.01)) is None


def test_an_integrator_is_counted_worse_than_rk3_wind_by_wind(measured):
    enhanced = outcome(measured, "heun + network, enhanced", 0.01)
    assert paper.worse_than_rk3(measured, enhanced) == (3, pytest.approx(_largest_ratio(measured)))
    assert paper.worse_than_rk3(measured, outcome(measured, "heun", 0.01)) is None
    assert "| 3 (at most" in page.section(measured)


def _largest_ratio(measured):
    a, b = (np.array(outcome(measured, name, 0.01).delta_e_range) for name in ("heun", "rk3"))
    return np.sqrt((a / b).max())


def test_evaluations_are_stages_over_the_step(measured):
    assert outcome(measured, "heun", 0.01).evaluations == pytest.approx(200, rel=0.03)
    assert outcome(measured, "heun-richardson", 0.005).evaluations == pytest.approx(1000, rel=0.03)


def test_a_tables_rows_are_of_the_chosen_winds(measured):
    row = paper.rows(measured, [False, False, True])[0]
    value = measured["outcomes"][0].delta_e_range[2]
    assert row["delta_e_range"] == {"low": value, "median": value, "high": value, "worst": value}


def test_the_page_says_which_of_the_papers_claims_hold(measured, tmp_path):
    # a network of zeros is Heun, dearer than RK3 at its error; its hybrid is RK3, so nowhere worse
    claims = paper.claims(measured, measured)
    hybrid = [t for t in claims if "hybrid" in t.asked]
    assert [t.reached for t in hybrid] == [True] * len(paper.BOXED) and "0 of 3 winds" in hybrid[0].found
    written = page.write(measured, measured, tmp_path).read_text(encoding="utf-8")
    assert all(str(t) in written for t in claims)
    assert all(
        (tmp_path / "images" / name).is_file() for name in ("paper-boxes.png", "paper-work-precision.png")
    )


def test_the_figures_are_drawn_and_the_measurements_are_plain_json(measured, tmp_path):
    paths = draw(measured, measured, tmp_path)
    assert [p.name for p in paths] == [
        "paper-work-precision.png",
        "paper-boxes.png",
        "paper-boxes-compiled.png",
        "paper-boxes-delta-e.png",
    ]
    assert all(p.read_bytes()[:4] == b"\x89PNG" for p in paths)
    again = json.loads(json.dumps(paper.to_json(measured)))
    assert again["outcomes"][0]["delta_e_range"] == measured["outcomes"][0].delta_e_range
