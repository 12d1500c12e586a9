"""An extreme wind of the standard as a source: what the rotor gets of it, and what a campaign may say of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from simulating import simulate_block

from fatigue_runner.campaign.resolve import named_by, resolve
from fatigue_runner.campaign.spec import parse_campaign
from fatigue_runner.errors import InputError
from fatigue_runner.inputs.source import Source
from fatigue_runner.layout import ACROSS
from fatigue_runner.rotor import Rotor
from fatigue_runner.turbine import load_turbine
from fatigue_runner.wind import ConstantWind, GustWind
from fatigue_runner.wind.gust import CELL
from fatigue_runner.wind.gusts import EVENTS, Site, gust_signals

ROTOR = Rotor(63.0, 90.0)


def resolved(duration=60, **wind):
    data = {
        "name": "a", "duration": duration, "wind": {"type": "gust", "turbulence_class": "B", **wind},
        "integrators": [{"method": "rk4", "step": 0.1}],
    }  # fmt: skip
    source = Source("a.yaml", data, "x", Path())
    return resolve(named_by(parse_campaign(source), source)).winds


def straight(wind, time):
    """The signals without those across the nacelle's axis, which only a wind that turns has."""
    return wind.at(time)[:, [c not in ACROSS for c in wind.channels]]


@pytest.mark.parametrize("name", EVENTS)
def test_before_the_gust_the_wind_is_steady_and_after_it_holds_on(name):
    wind = GustWind(12.0, name, begin=5.0).on(ROTOR)
    steady = ConstantWind(12.0, shear_exponent=0.2).on(ROTOR).at([0.0])[0]
    assert straight(wind, [0.0, 4.999]) == pytest.approx(np.tile(steady, (2, 1)), rel=1e-12)
    end = 5.0 + EVENTS[name].duration
    assert wind.at([end, end + 100.0])[0] == pytest.approx(wind.at([end + 100.0])[0], rel=1e-12)
    if name[:3] in ("EOG", "EWS"):  # what comes goes
        assert wind.at([end])[0] == pytest.approx(steady, rel=1e-9)


@pytest.mark.parametrize("name", EVENTS)
def test_the_rotor_has_the_winds_of_the_formulas_between_the_cells_too(name):
    wind = GustWind(12.0, name, turbulence_class="B", begin=5.0, harmonics=3).on(ROTOR)
    assert EVENTS[name].duration / CELL == pytest.approx(round(EVENTS[name].duration / CELL))
    steady = ConstantWind(12.0, shear_exponent=0.2, harmonics=3).on(ROTOR).at([0.0])[0]
    time = np.linspace(5.0, 20.0, 777)
    added = gust_signals(EVENTS[name], Site(12.0, 90.0, 126.0, "B", 50.0), time, 5.0)
    along, found = np.cos(added.direction), wind.at(time)
    speed = along * (steady[0] + added.speed)
    assert found[:, 0] == pytest.approx(speed, abs=2e-5)
    # shears and harmonics keep their winds [m/s]
    assert found[:, 1] * speed == pytest.approx(along * (steady[0] * steady[1] + added.vertical), abs=5e-5)
    assert found[:, 2] * speed == pytest.approx(along * added.horizontal, abs=5e-5)
    assert straight(wind, time)[:, 3:] == pytest.approx(np.multiply.outer(along, steady[3:]), abs=1e-6)
    if wind._turn:
        across = -np.sin(added.direction) * (steady[0] + added.speed)
        assert found[:, 3] == pytest.approx(across, abs=2e-5) and not found[:, 4].any()


def test_signs_turn_shears_and_directions_round():
    def middle(name):
        return GustWind(12.0, name, begin=0.0).on(ROTOR).at([6.0])[0]

    assert middle("EWSV+")[1] > 0.2 > 0.0 > middle("EWSV-")[1]
    assert middle("EWSH+")[2] == pytest.approx(-middle("EWSH-")[2]) and middle("EWSH+")[2] > 0.1
    right, left = middle("EDC+"), middle("EDC-")
    assert (
        right[3] == pytest.approx(-left[3]) and right[3] < -3.0
    )  # positive: to the right of who looks downwind
    assert np.delete(right, 3) == pytest.approx(np.delete(left, 3))


@pytest.mark.parametrize("name", ["EDC+", "ECD-"])
def test_a_wind_that_turns_keeps_its_speed_over_the_disc(name):
    wind = GustWind(12.0, name, begin=1.0).on(ROTOR)
    assert [c.name for c in wind.channels[3:5]] == ["lateral_wind", "vertical_wind"]
    (before,), (after,) = wind.at([0.5]), wind.at([20.0])
    added = 15.0 if name == "ECD-" else 0.0
    assert np.hypot(after[0], after[3]) == pytest.approx(before[0] + added, rel=1e-9)
    turned = np.degrees(np.arctan2(-after[3], after[0]))
    assert turned == pytest.approx(-60.0 if name == "ECD-" else wind._turn)
    assert before[3] == 0.0 and not wind.at([20.0])[0, 4]


def test_a_gust_that_turns_the_wind_is_told_and_one_that_turns_it_away_is_refused():
    (note,) = GustWind(12.0, "ECD+").on(ROTOR).notes
    assert "turns the wind by 60 degrees; the nacelle does not follow" in note and "up to 30" in note
    assert GustWind(12.0, "EOG").on(ROTOR).notes == ()
    with pytest.raises(
        InputError, match=r"ECD- at 8 m/s turns the wind by 90 degrees, away from the rotor.*; take"
    ):
        GustWind(8.0, "ECD-")


def test_a_turbine_swings_when_the_gust_comes_and_not_before():
    turbine = load_turbine("nrel5mw")
    winds = [GustWind(8.0, name, begin=10.0).on(turbine.rotor) for name in ("EOG", "EWSV+", "EWSH-")]
    winds.append(ConstantWind(8.0, shear_exponent=0.2).on(turbine.rotor))
    start = np.repeat(turbine.operating_point(8.0, 0.14)[None], 4, axis=0)
    *gusts, calm = simulate_block(turbine, "rk4", 0.05, winds, start, 25.0, 0.05)
    flap = [run.loads["blade1_root_flapwise_moment"] for run in (*gusts, calm)]
    before = calm.time <= 10.0
    for load in flap[:-1]:
        assert load[before] == pytest.approx(flap[-1][before], rel=1e-9)
        assert np.ptp(load[~before]) > 1.5 * np.ptp(flap[-1][~before])


# In a campaign


def test_a_campaign_has_every_speed_with_every_gust():
    found = resolved(speeds=[10, 12], gusts=["EOG", "EWSV+", "ewsv-"], begin=20.5)
    assert [wind.named.id for wind in found] == [
        f"v{v}.00_{gust}" for v in (10, 12) for gust in ("eog", "ewsv-plus", "ewsv-minus")
    ]
    assert all(wind.source.begin == 20.5 and wind.source.turbulence_class == "B" for wind in found)
    assert found[1].source.label["gust"] == "EWSV+"


def test_notes_of_a_gust_reach_the_campaign():
    (wind,) = resolved(speeds=12, gusts="EDC-")
    assert "turns the wind by" in wind.notes[0]


@pytest.mark.parametrize(
    ("wind", "message"),
    [
        ({"gusts": "EWSV"}, "wind.gusts: 'EWSV' is not known; did you mean 'EWSV"),
        ({"gusts": []}, "wind.gusts: is an empty sweep"),
        ({"gusts": [3]}, "wind.gusts[0] must be text"),
        ({}, "wind: needs the key 'gusts'"),
        (
            {"gusts": "EOG", "begin": 55},
            "a.yaml:1: EOG lasts from 55 to 65.5 s, but the campaign runs 60 s; give an",
        ),
        (
            {"gusts": "EOG", "begin": 5.05},
            "a.yaml:1: gust wind: begin must be whole tenths of a second, got 5.05",
        ),
        ({"gusts": "EOG", "begin": -5}, "wind.begin must be at least 0"),
        (
            {"gusts": "EOG", "turbulence_class": "b+"},
            "wind.turbulence_class: 'b+' is not known; did you mean 'B'?",
        ),
        ({"gusts": "EOG", "wind_class": "iii"}, "wind.wind_class: 'iii' is not known; did you mean 'III'?"),
        ({"gusts": "EOG", "harmonics": -1}, "wind.harmonics must be at least 0"),
        ({"gusts": "EWSH+", "harmonics": 0}, "a shear has one harmonic or more"),
        ({"gusts": "ECD+", "speeds": 7}, "a.yaml:1: gust wind: ECD+ at 7 m/s turns the wind by 103 degrees"),
        ({"gusts": "EOG", "speeds": 0}, "speed"),
    ],
)
def test_what_a_campaign_says_wrong_of_a_gust_is_refused(wind, message):
    with pytest.raises(InputError) as caught:
        resolved(**({"speeds": 10} | wind))
    assert message in str(caught.value)
