"""The tower in the blades' way: potential flow as harmonics of any wind, in campaigns where they ask for it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from simulating import simulate_block

from fatigue_runner.campaign.resolve import named_by, resolve
from fatigue_runner.campaign.spec import parse_campaign
from fatigue_runner.errors import InputError
from fatigue_runner.inputs.source import Source
from fatigue_runner.rotor import Rotor
from fatigue_runner.turbine import load_turbine
from fatigue_runner.turbine.file import read_turbine_file
from fatigue_runner.wind import ConstantWind, StepWind, TowerInfluence, TurbulentWind
from fatigue_runner.wind.azimuth import wind_at
from fatigue_runner.wind.mean_shear import radial_rule
from fatigue_runner.wind.profiles import Tower, tower_deficit


@pytest.fixture(scope="module")
def turbine():
    return load_turbine("nrel5mw")


def blade_wind(wind, azimuth, time=0.0):
    """What the harmonics make of a wind at a blade [m/s], the disc's wind with it."""
    signals = wind.at([time])[0]
    return signals[0] + wind_at(np.concatenate([[0.0], signals[3:]]), azimuth)


def test_a_blade_in_front_of_the_tower_has_less_wind_and_one_beside_it_more(turbine):
    wind = TowerInfluence(ConstantWind(8.0), order=16).on(turbine.rotor)
    azimuth = np.radians(np.arange(0.0, 360.0, 5.0))
    felt = blade_wind(wind, azimuth)
    assert felt.argmin() == np.abs(azimuth - np.pi).argmin()
    assert 0.02 < 1 - felt.min() / 8.0 < 0.06
    assert felt[np.abs(azimuth - np.radians(150)).argmin()] > 8.0
    assert felt[np.abs(azimuth) < 1] == pytest.approx(8.0, rel=2e-3)


def test_with_harmonics_enough_it_is_the_flow_around_the_cylinder_averaged_along_the_blade(turbine):
    rotor = turbine.rotor
    wind = TowerInfluence(ConstantWind(8.0), order=16).on(rotor)
    radii, shares, _ = radial_rule(rotor)
    azimuth = np.radians([0.0, 90.0, 140.0, 180.0, 220.0])
    out, axial = np.multiply.outer(np.cos(azimuth), radii), radii * np.tan(rotor.cone)
    x = rotor.apex + axial * np.cos(rotor.tilt) - out * np.sin(rotor.tilt)
    z = rotor.hub_height + out * np.cos(rotor.tilt) + axial * np.sin(rotor.tilt)
    y = -np.multiply.outer(np.sin(azimuth), radii)
    flow = 8.0 * (1 + tower_deficit(Tower((0.0, 87.6), (6.0, 3.87)), x, y, z) @ shares)
    deepest = 8.0 - flow.min()
    assert blade_wind(wind, azimuth) == pytest.approx(flow, abs=0.1 * deepest)


@pytest.mark.parametrize(
    "inner",
    [
        TurbulentWind(9.0, 0.12, seed=3, duration=30.0),
        TurbulentWind(9.0, 0.12, seed=3, duration=30.0, harmonics=1),
        StepWind([0.0, 2.0], [[8.0, 0.1, 0.0], [10.0, 0.2, 0.1]]),
    ],
)
def test_any_wind_keeps_what_it_is_and_gets_a_share_of_its_disc_wind(turbine, inner):
    plain, wind = inner.on(turbine.rotor), TowerInfluence(inner).on(turbine.rotor)
    time = np.arange(0.0, 10.0, 0.37)
    before, after = plain.at(time), wind.at(time)
    assert wind.harmonics == 6 and after.shape[1] == 15
    assert after[:, 0] == pytest.approx(before[:, 0], rel=0.01)
    assert after[:, 0] * after[:, 1] == pytest.approx(before[:, 0] * before[:, 1])
    own = np.zeros_like(after[:, 3:])
    own[:, : before.shape[1] - 3] = before[:, 3:]
    shares = (after[:, 3:] - own) / before[:, :1]
    assert shares == pytest.approx(np.tile(shares[0], (len(time), 1)), abs=1e-12)
    # deepest at the bottom: odd cosines up, even ones down, no sines
    assert (shares[0, 0::2] * (-1.0) ** np.arange(6) > 0).all() and not shares[0, 1::2].any()


def test_three_blades_that_pass_the_tower_shake_it(turbine):
    steady = ConstantWind(8.0)
    winds = [steady, TowerInfluence(steady)]
    start = np.repeat(turbine.operating_point(8.0)[None], 2, axis=0)
    quiet, shaken = simulate_block(turbine, "rk4", 0.05, winds, start, 30.0, 0.05)
    late = quiet.time > 20.0
    swing = [np.ptp(run.loads["tower_base_fore_aft_moment"][late]) for run in (quiet, shaken)]
    assert swing[1] > 3 * swing[0]


def test_what_cannot_be_is_refused(turbine):
    without = replace(turbine.rotor, tower=())
    with pytest.raises(InputError, match=r"the turbine's file has no tower diameters; add `diameters`"):
        TowerInfluence(ConstantWind(8.0)).on(without)
    with pytest.raises(InputError, match="2 harmonics or more, got 1"):
        TowerInfluence(ConstantWind(8.0), order=1)
    with pytest.raises(InputError, match=r"the blade meets the tower at height .* m; check overhang"):
        TowerInfluence(ConstantWind(8.0)).on(replace(turbine.rotor, apex=-1.0, tilt=0.0))
    with pytest.raises(InputError, match=r"blows on no turbine yet; give it to a run"):
        TowerInfluence(ConstantWind(8.0)).at([0.0])


# In a campaign


def resolved(folder: Path, turbine="nrel5mw", **wind):
    data = {
        "name": "a", "duration": 20, "turbine": turbine, "wind": {"speeds": 8, **wind},
        "integrators": [{"method": "rk4", "step": 0.1}],
    }  # fmt: skip
    source = Source("a.yaml", data, "x", folder)
    return resolve(named_by(parse_campaign(source), source))


def thicker(folder: Path, rows: str) -> str:
    (folder / "t.yaml").write_text(f"base: nrel5mw\nname: thick\ntower:\n  diameters: {rows}\n")
    return "t.yaml"


def test_a_campaign_says_so_and_its_cases_too(tmp_path):
    (plain,), (wind,) = resolved(tmp_path).winds, resolved(tmp_path, tower_influence=True).winds
    assert plain.named.id == "v08.00" and wind.named.id == "v08.00_tower"
    assert isinstance(wind.source, TowerInfluence) and wind.source.label["tower_influence"] is True
    assert wind.source.label["wind_source"] == "constant" and wind.source.label["harmonics"] == 6
    assert "potential flow" in wind.source.description


def test_the_towers_size_counts_where_it_blows_and_only_there(tmp_path):
    """Not for the turbine's hash, with which correctors are bound, but for the wind's."""
    turbine = thicker(tmp_path, "[[0, 7.0], [87.6, 4.0]]")
    thin, thick = (resolved(tmp_path, t, tower_influence=True) for t in ("nrel5mw", turbine))
    assert thin.turbine.hash == thick.turbine.hash
    assert thin.winds[0].named.identity != thick.winds[0].named.identity
    calm = [resolved(tmp_path, t).winds[0].named.identity for t in ("nrel5mw", turbine)]
    assert calm[0] == calm[1]


def test_wrong_diameters_are_told_with_their_line(tmp_path):
    for rows, message in (
        ("[[0, 6.0], [0, 4.0]]", "t.yaml:4: tower.diameters: heights must rise from row to row"),
        (
            "[[0, 6.0], [87.6, -4.0]]",
            "t.yaml:4: tower.diameters: row 2 must be a height and a positive diameter",
        ),
        ("[[0, 6.0]]", "t.yaml:4: tower.diameters must hold at least 2"),
    ):
        thicker(tmp_path, rows)
        with pytest.raises(InputError) as told:
            read_turbine_file(str(tmp_path / "t.yaml"))
        assert message in str(told.value)


def test_a_turbine_without_diameters_is_refused_with_the_campaigns_line(tmp_path):
    import yaml

    data = read_turbine_file("nrel5mw")
    del data["tower"]["diameters"]
    (tmp_path / "bare.yaml").write_text(yaml.safe_dump(data))
    with pytest.raises(InputError, match=r"a.yaml:1: the turbine's file has no tower diameters; add"):
        resolved(tmp_path, "bare.yaml", tower_influence=True)
    with pytest.raises(InputError, match="tower_influence must be true or false"):
        resolved(tmp_path, tower_influence="yes")


def test_a_rotor_that_nobody_described_has_no_tower():
    assert Rotor(63.0, 90.0).tower == ()
