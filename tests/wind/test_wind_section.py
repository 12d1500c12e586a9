"""A wind source declares what a campaign may say of it, and takes its size from the turbine that it blows on."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from fatigue_runner.campaign.resolve import named_by, resolve
from fatigue_runner.campaign.spec import parse_campaign
from fatigue_runner.errors import InputError
from fatigue_runner.inputs.source import Place, Source
from fatigue_runner.inputs.sweep import Sweep, expand
from fatigue_runner.integrators import Ensemble
from fatigue_runner.naming import speed_id
from fatigue_runner.rotor import Rotor
from fatigue_runner.turbine import load_turbine
from fatigue_runner.wind import SOURCES, ConstantWind, TurbulentWind
from fatigue_runner.wind.mean_shear import mean_signals
from fatigue_runner.wind.profiles import Logarithmic
from fatigue_runner.wind.section import SECTIONS, Realisation, Site, WindSection
from fatigue_runner.wind.spectrum import (
    TURBULENCE_CLASSES,
    WIND_CLASSES,
    extreme_turbulence_sigma,
    normal_turbulence_sigma,
)

LARGE = Rotor(120.0, 150.0)


def parse(wind, folder=Path()):
    text = "x"  # places are told for sources that have a text
    data = {"name": "a", "duration": 20, "wind": wind, "integrators": [{"method": "rk4", "step": 0.1}]}
    source = Source("a.yaml", data, text, folder)
    return parse_campaign(source), source


def winds_of(wind, rotor=LARGE):
    campaign, source = parse(wind)
    return list(campaign.wind.realisations(Site(rotor, campaign.duration, Place(source, ("wind",)))))


@pytest.fixture
def doubled():
    """A new source and its section, as one file of `wind/` would declare them."""

    @dataclass(frozen=True)
    class DoubledWind(ConstantWind):
        kind = "doubled"

        @property
        def mean_speed(self):
            return 2 * self.speed

    class DoubledSection(WindSection):
        kind = "doubled"
        halves: Sweep
        veer: float = 0.0

        def realisations(self, site):
            for half, piece in expand(self.halves):
                yield Realisation(
                    f"{speed_id(2 * half)}_doubled", self.kind, (("speed", half),), ("halves", piece)
                )

    yield DoubledSection
    del SOURCES["doubled"], SECTIONS["doubled"]


def test_a_new_source_reaches_a_campaign_without_an_edit_elsewhere(doubled):
    campaign, source = parse({"type": "doubled", "halves": [3, 4]})
    found = resolve(named_by(campaign, source)).winds
    assert [wind.named.id for wind in found] == ["v06.00_doubled", "v08.00_doubled"]
    assert [wind.source.mean_speed for wind in found] == [6.0, 8.0]
    every = {"type": "doubled", "tower_influence": False, "yaw_misalignment": [0.0], "upflow": [0.0]}
    assert campaign.model_dump()["wind"] == {**every, "halves": [3.0, 4.0], "veer": 0.0}


@pytest.mark.parametrize(
    ("wind", "message"),
    [
        ({"type": "doubeld", "halves": 4}, "wind.type: 'doubeld' is not known; did you mean 'doubled'?"),
        ({"type": "doubled", "halfs": 4}, "unknown key 'halfs' in wind; did you mean 'halves'?"),
        (
            {"type": "doubled", "halves": 4, "seeds": 3},
            "wind.seeds: means nothing for wind of type 'doubled'",
        ),
        ({"type": "doubled"}, "wind: needs the key 'halves'"),
        ({"type": "doubled", "halves": "four"}, "wind.halves must be a number; got 'four'"),
        ({"speeds": 8, "halves": 4}, "wind.halves: means nothing for wind of type 'constant'"),
    ],
)
def test_its_keys_are_checked_as_all_others(doubled, wind, message):
    with pytest.raises(InputError) as caught:
        parse(wind)
    assert message in str(caught.value)


def test_a_key_that_would_be_ignored_is_refused():
    with pytest.raises(
        InputError, match=r"wind.horizontal_shear: means nothing for wind of type 'turbulent'"
    ):
        parse({"type": "turbulent", "speeds": 8, "intensity": 0.1, "horizontal_shear": 0.1})


@pytest.mark.parametrize("name", TURBULENCE_CLASSES)
def test_every_turbulence_class_of_the_source_works_in_a_campaign(name):
    (found,) = winds_of({"type": "turbulent", "speeds": 8, "turbulence_class": name})
    assert found.build(LARGE).sigma == TurbulentWind(8.0, turbulence_class=name).sigma
    assert found.id == f"v08.00_ntm{name}_s800001"


@pytest.mark.parametrize("wind_class", WIND_CLASSES)
def test_extreme_turbulence_is_that_of_its_wind_class(wind_class):
    wind = {
        "type": "turbulent",
        "speeds": 12,
        "turbulence": "etm",
        "turbulence_class": "B",
        "wind_class": wind_class,
    }
    (found,) = winds_of(wind)
    blowing = found.build(LARGE)
    assert (
        blowing.sigma
        == extreme_turbulence_sigma("B", wind_class, 12.0)
        > 1.2 * normal_turbulence_sigma("B", 12.0)
    )
    assert found.id == f"v12.00_etmB-{wind_class}_s1200001"
    assert "extreme turbulence model" in blowing.description
    # one seed is the same turbulence, only stronger
    normal = TurbulentWind(12.0, turbulence_class="B", seed=1200001, duration=20.0).on(LARGE)
    assert blowing.harmonic_series / blowing.sigma == pytest.approx(normal.harmonic_series / normal.sigma)


@pytest.mark.parametrize(
    ("wind", "message"),
    [
        (
            {"turbulence": "etm", "turbulence_class": "B"},
            "wind.turbulence: etm needs a wind_class (I, II, III)",
        ),
        (
            {"turbulence": "emt", "turbulence_class": "B"},
            "wind.turbulence: 'emt' is not known; did you mean 'etm'?",
        ),
        (
            {"turbulence": "etm", "turbulence_class": "B", "wind_class": "IV"},
            "wind.wind_class: 'IV' is not known; did you mean 'I'?",
        ),
        ({"turbulence_class": "B", "wind_class": "I"}, "means nothing for ntm; leave it out"),
        ({"turbulence": "etm", "intensity": 0.2}, "etm says how strong it is; give a turbulence_class"),
        (
            {"intensity": 0.1, "shear_exponent": 0.2, "roughness_length": 0.03},
            "wind.roughness_length: stands beside shear_exponent",
        ),
        ({"intensity": 0.1, "roughness_length": -1.0}, "wind.roughness_length must be above 0"),
        (
            {"intensity": 0.1, "spectrum": "kaimall"},
            "wind.spectrum: 'kaimall' is not known; did you mean 'kaimal'?",
        ),
    ],
)
def test_turbulence_that_contradicts_itself_is_refused(wind, message):
    with pytest.raises(InputError) as caught:
        parse({"type": "turbulent", "speeds": 12, **wind})
    assert message in str(caught.value)


@pytest.mark.parametrize("kind", [{"type": "constant"}, {"type": "turbulent", "intensity": 0.1}])
def test_a_logarithmic_profile_blows_in_every_kind_of_wind(kind):
    (found,) = winds_of({"speeds": 12, "roughness_length": 0.03, **kind})
    blowing = found.build(LARGE)
    assert blowing.parameters["roughness_length"] == 0.03 and "shear_exponent" not in blowing.parameters
    steady = mean_signals(Logarithmic(0.03), 12.0, LARGE, 6)
    # the turbulence's amplitudes have no mean
    assert blowing.at(np.arange(0, 20, 0.2))[:, 3:].mean(axis=0) == pytest.approx(steady[3:], abs=1e-9)


def test_an_unknown_turbulence_class_is_refused():
    with pytest.raises(InputError, match=r"wind.turbulence_class: 'a\+\+' is not known; did you mean 'A\+'"):
        parse({"type": "turbulent", "speeds": 8, "turbulence_class": "a++"})


def test_a_campaigns_turbulence_is_made_for_its_turbine():
    (found,) = winds_of({"type": "turbulent", "speeds": 8, "intensity": 0.1})
    assert found.build(LARGE).rotor == LARGE


def test_a_missing_wind_file_is_told_with_its_place(tmp_path):
    campaign, source = parse({"type": "file", "files": ["gone.csv"]}, tmp_path)
    with pytest.raises(InputError, match=r"^a.yaml:1: wind file 'gone.csv' cannot be read"):
        list(campaign.wind.realisations(Site(LARGE, 20.0, Place(source, ("wind",)))))


def test_what_a_file_holds_decides_and_not_where_it_lies(tmp_path):
    identities = []
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "gust.csv").write_text(
            "time,wind_speed,vertical_shear,horizontal_shear\n0,8,0,0\n"
        )
        campaign, source = parse({"type": "file", "files": "gust.csv"}, tmp_path / folder)
        site = Site(LARGE, 20.0, Place(source, ("wind",)))
        identities += [wind.identity for wind in campaign.wind.realisations(site)]
    assert identities[0] == identities[1]


# The size of the turbine


def test_turbulence_is_that_of_the_rotor_it_blows_on():
    open_, given = (
        TurbulentWind(8.0, intensity=0.1),
        TurbulentWind(8.0, None, "A", 0, 600.0, 0.2, 0.2, 63.0, 90.0),
    )
    assert open_.on(LARGE).rotor == LARGE
    assert given.on(LARGE).rotor == Rotor(63.0, 90.0)
    # a larger disc averages more of the eddies away
    assert open_.on(LARGE).at(np.arange(0.0, 600.0))[:, 0].std() < open_.at(np.arange(0.0, 600.0))[:, 0].std()


def test_one_given_size_stays_and_the_other_is_the_turbines():
    assert TurbulentWind(8.0, intensity=0.1, hub_height=100.0).on(LARGE).rotor == Rotor(120.0, 100.0)


def test_whoever_simulates_binds_the_winds_to_the_turbine():
    turbine = load_turbine("nrel5mw")
    ensemble = Ensemble(
        turbine, [TurbulentWind(8.0, intensity=0.1), ConstantWind(8.0)], np.zeros((2, 16)), 1.0
    )
    assert ensemble.winds[0].rotor == turbine.rotor
    assert turbine.rotor.radius == pytest.approx(63.0 * np.cos(np.deg2rad(2.5)))
    assert ensemble.winds[1] == ConstantWind(8.0)
