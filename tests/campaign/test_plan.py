"""The way from a campaign file to its cases goes through every room once: read, resolve, check, cases."""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import pytest
from campaign_world import build_world, write_campaign

import fatigue_runner
from fatigue_runner.campaign import integration
from fatigue_runner.campaign.plan import make_plan, read_plan

PACKAGE = f"{Path(fatigue_runner.__file__).parent}/"


def entries(function) -> Counter:
    """How many calling lines of other files lead into each file of the package."""
    lines: set[tuple[str, int, str]] = set()

    def called(frame, event, argument):
        file = frame.f_code.co_filename
        caller = frame.f_back.f_code.co_filename if frame.f_back else ""
        if event == "call" and caller != file and file.startswith(PACKAGE) and caller.startswith(PACKAGE):
            lines.add((caller, frame.f_back.f_lineno, file.removeprefix(PACKAGE)))

    sys.setprofile(called)
    try:
        function()
    finally:
        sys.setprofile(None)
    return Counter(file for _, _, file in lines)


def test_a_plan_enters_each_step_once_and_is_read_without_what_is_made(monkeypatch, tmp_path):
    build_world(monkeypatch)
    campaign = write_campaign(tmp_path)
    make_plan(campaign)  # what is imported on the way is no stay
    rooms = ("cases", "resolve", "check")

    def entered(function):
        found = entries(function)
        return [found[f"campaign/{name}.py"] for name in rooms]

    assert entered(lambda: read_plan(campaign)) == [1, 1, 0]
    assert entered(lambda: make_plan(campaign)) == [1, 2, 1]  # named, then made


def test_a_corrector_is_read_once_for_all_its_integrators(monkeypatch):
    from fatigue_runner import corrector

    read = []
    load = corrector.load
    monkeypatch.setattr(corrector, "load", lambda path: read.append(path) or load(path))
    integration.load_corrector.cache_clear()
    modes = [
        {"method": "rk4", "step": 0.1, "corrector": "rk4-100ms", "mode": m} for m in ("hybrid", "enhanced")
    ]
    plan = make_plan(
        {"name": "a", "duration": 4, "wind": {"speeds": [8, 9]}, "integrators": modes, "reference": None}
    )
    assert len(read) == 1
    (one, two) = plan.named.integrations
    assert one.build().corrector is two.build().corrector


@pytest.mark.parametrize("index", [0, 1])
def test_an_integrator_is_made_as_its_section_says(index):
    plan = make_plan(
        {
            "name": "a",
            "duration": 4,
            "wind": {"speeds": 8},
            "integrators": [{"method": "rk4", "step": 0.1, "corrector": "rk4-100ms"}],
            "reference": {"method": "rk7", "step": 0.01},
        }
    )
    found = plan.named.integrations[index]
    built = found.build()
    assert (built.id, built.method, built.step) == (found.id, found.method, found.step)
    assert found.is_reference == (index == 0)
