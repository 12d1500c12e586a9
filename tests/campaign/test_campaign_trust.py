"""A campaign says how far its reference can be trusted, in its folder, its report and every log."""

from __future__ import annotations

import json

import pytest

from fatigue_runner import run_campaign
from fatigue_runner.campaign import trust
from fatigue_runner.campaign.resolve import named_by, resolve
from fatigue_runner.campaign.spec import read_campaign
from fatigue_runner.logbook import read_log

CAMPAIGN = {
    "name": "trust",
    "duration": 6,
    "output_rate": 50,
    "discard": 1,
    "wind": {"type": "turbulent", "speeds": [7, 9], "intensity": 0.1, "seeds": [1], "harmonics": 1},
    "integrators": [{"method": "rk4", "step": 0.05}],
    "reference": {"method": "rk7", "step": 0.01},
    "workers": 1,
}


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    return run_campaign(CAMPAIGN, tmp_path_factory.mktemp("trust") / "run")


def resolved(campaign):
    return resolve(named_by(*read_campaign(campaign)))


def test_a_fine_reference_agrees_with_another_method_and_another_step(results):
    facts = json.loads((results.out / "run.json").read_text())["facts"]
    assert float(facts["reference_nrmse"]) < 1e-6 and float(facts["reference_del_error"]) < 1e-6
    for part in ("rk7 at 20 ms", "dop853 at 10 ms", "6 s of 2 of the winds"):
        assert part in facts["reference_agreement"]


def test_the_report_and_every_log_say_so(results):
    said = json.loads((results.out / "run.json").read_text())["facts"]["reference_agreement"]
    assert f"how far it can be trusted: {said}" in (results.out / "report.html").read_text()
    for path in (results.out / "logs").glob("*.mcap"):
        assert read_log(path).run["reference_agreement"] == said


def test_a_coarse_reference_is_a_limit_of_the_result(tmp_path):
    coarse = {**CAMPAIGN, "reference": {"method": "rk4", "step": 0.1}, "name": "coarse"}
    out = run_campaign(coarse, tmp_path / "run").out
    assert float(json.loads((out / "run.json").read_text())["facts"]["reference_nrmse"]) > 1e-4
    assert "may be the reference's own" in (out / "report.html").read_text().replace("&#39;", "'")


def test_the_bound_is_above_the_references_own_error():
    """Against RK7 at a tenth of the step, on the same winds."""
    facts = trust.reference_facts(resolved({**CAMPAIGN, "reference": {"method": "rk4", "step": 0.02}}), {})
    block = trust._Block(resolved(CAMPAIGN), 6.0)
    pairs = zip(block.run("rk4", 0.02), block.run("rk7", 0.002), strict=True)
    own = max(trust._distance(a, b)[0] for a, b in pairs)
    assert own < float(facts["reference_nrmse"]) < 100 * own


def test_a_run_that_goes_on_keeps_what_is_known(monkeypatch):
    known = resolved(CAMPAIGN)
    monkeypatch.setattr(trust, "_measure", lambda resolved: {"reference_agreement": "measured anew"})
    earlier = {"campaign": known.campaign.model_dump(), "facts": {"reference_agreement": "known"}}
    assert trust.reference_facts(known, earlier) == {"reference_agreement": "known"}
    other = resolved({**CAMPAIGN, "reference": {"method": "rk7", "step": 0.005}})
    assert trust.reference_facts(other, earlier) == {"reference_agreement": "measured anew"}


def test_without_a_reference_there_is_nothing_to_say():
    assert trust.reference_facts(resolved({**CAMPAIGN, "reference": None}), {}) == {}
