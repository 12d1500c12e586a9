"""What the comments of the shipped campaigns say is so: numbers in words are compared with what the files mean."""

from __future__ import annotations

import re

import numpy as np
import pytest

from fatigue_runner import shipped
from fatigue_runner.campaign.spec import read_campaign
from fatigue_runner.fatigue.climate import iec_climate
from fatigue_runner.inputs.source import Place
from fatigue_runner.inputs.sweep import expand
from fatigue_runner.integrators import stability_limit
from fatigue_runner.turbine import load_turbine
from fatigue_runner.wind.section import Site
from fatigue_runner.wind.spectrum import normal_turbulence_sigma


def opened(name):
    """(campaign, its winds, its comments as one line)."""
    campaign, source = read_campaign(name)
    turbine = load_turbine(campaign.turbine)
    winds = list(campaign.wind.winds(Site(turbine.rotor, campaign.duration, Place(source, ("wind",)))))
    comments = " ".join(re.findall(r"#\s*(.*)", (shipped.campaigns() / f"{name}.yaml").read_text()))
    return campaign, winds, comments


def speeds_of(winds):
    return [wind.mean_speed for wind in winds]


def test_the_quickstart_says_where_heun_ends_and_what_it_simulates():
    campaign, winds, said = opened("quickstart")
    (limit,) = re.findall(r"unstable on this turbine from (\d+) ms on", said)
    assert stability_limit(load_turbine("nrel5mw"), "heun") == pytest.approx(int(limit) * 1e-3, rel=0.03)
    assert "reference of 8th order" in said and campaign.reference.method == "dop853"
    assert "three classical Runge-Kutta methods" in said
    assert {entry.method for entry in campaign.integrators} == {"heun", "rk3", "rk4"}
    assert "from cut-in to cut-out" in said and (min(speeds_of(winds)), max(speeds_of(winds))) == (4, 24)


@pytest.mark.parametrize(
    ("name", "seeds", "spacing", "seconds"), [("dlc12", 6, 2, 600), ("dlc12_quick", 2, 4, 60)]
)
def test_dlc12_says_bins_seeds_and_lengths(name, seeds, spacing, seconds):
    campaign, winds, said = opened(name)
    numbers = {2: "two", 6: "six"}
    assert f"{numbers[seeds]} seeds of {'ten minutes' if seconds == 600 else 'one minute'}" in said
    assert campaign.duration - campaign.discard == seconds
    speeds = speeds_of(winds)
    assert len(winds) == seeds * len(set(speeds)) and set(np.diff(sorted(set(speeds)))) == {spacing}
    assert campaign.lifetime.climate == "II"


def test_dlc12_names_the_site_of_its_class_and_its_turbulence():
    _, _, said = opened("dlc12")
    assert "Rayleigh, mean 8.5 m/s" in said
    assert iec_climate("II").mean_speed == pytest.approx(8.5, rel=1e-3)
    (speed, sigma) = re.findall(r"normal turbulence model, (\d+) m/s: sigma ([\d.]+) m/s", said)[0]
    assert normal_turbulence_sigma("B", float(speed)) == pytest.approx(float(sigma), abs=0.05)


def test_the_campaign_in_operation_has_as_many_winds_as_it_says():
    campaign, winds, said = opened("operation")
    assert "24 winds of five minutes" in said
    assert len(winds) == 24 and campaign.duration - campaign.discard == 300


def test_the_paper_s_campaigns_have_its_winds():
    campaign, winds, said = opened("paper_in_range")
    assert "200 steady winds in [5, 10] m/s" in said
    assert len(winds) == 200 and 5 <= min(speeds_of(winds)) < max(speeds_of(winds)) <= 10
    (cases,) = re.findall(r"(\d+) cases", said)
    integrators = 1 + sum(len(expand(entry.step)) for entry in campaign.integrators)
    assert int(cases) == len(winds) * integrators
    _, winds, said = opened("paper_out_of_range")
    assert "200 steady winds, three quarters of them in [5, 10] m/s and the rest up to 20 m/s" in said
    inside = [5 <= speed <= 10 for speed in speeds_of(winds)]
    assert (
        len(winds) == 200
        and np.mean(inside) == pytest.approx(0.75, abs=0.02)
        and 15 < max(speeds_of(winds)) <= 20
    )
