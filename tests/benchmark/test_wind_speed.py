"""The benchmark of the wind measures what it says, and its targets are judged from its figures."""

from __future__ import annotations

import sys

import numpy as np
from places import ROOT

from fatigue_runner.benchmark.speed import wind
from fatigue_runner.turbine import load_turbine
from fatigue_runner.wind import FullFieldWind

sys.path.insert(0, str(ROOT / "tools"))
import targets


def test_the_field_that_is_measured_is_a_field_of_the_stated_size(tmp_path):
    wind.write_field(tmp_path / "field.bts")
    blowing = FullFieldWind(tmp_path / "field.bts").on(load_turbine("nrel5mw").rotor)
    assert blowing.length > wind.SECONDS and blowing.mean_speed == wind.MEAN
    assert blowing.at(np.arange(0.0, 10.0))[:, 3:].std() > 0


def figures(series, field, ratios):
    rows = [
        {"harmonics": m, "series_seconds": series, "field_seconds": field, "ratio": ratio}
        for m, ratio in ratios.items()
    ]
    return {"series": 66, "harmonics": rows}


def test_targets_of_the_wind_are_judged():
    good = targets.judged(figures(2.9, 0.9, {1: 1.0, 3: 1.2, 6: 1.3}))
    assert len(good) == 4 and all(claim.reached for claim in good)
    bad = targets.judged(figures(3.1, 1.1, {1: 1.0, 3: 1.3, 6: 1.5}))
    assert not any(claim.reached for claim in bad)
