"""A life in a campaign: its keys, what is refused with the line, and the tables beside results.csv, in the toy world."""

from __future__ import annotations

import csv

import pytest
from campaign_world import build_world, write_campaign

from fatigue_runner.campaign import run_campaign
from fatigue_runner.campaign.plan import make_plan
from fatigue_runner.errors import InputError


@pytest.fixture
def world(monkeypatch):
    return build_world(monkeypatch)


LIFE = "{climate: II}"
DAMAGE = "{wohler_exponents: [4], damage: [{place: tower_base, curve: dnv-d-air}]}"


def read(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_a_campaign_with_a_climate_writes_its_life(world, tmp_path):
    results = run_campaign(write_campaign(tmp_path, lifetime=LIFE, fatigue=DAMAGE), tmp_path / "out")
    assert [(b.low, b.high) for b in results.life.bins] == [(5, 7), (7, 9), (9, 11)]
    loads = read(tmp_path / "out" / "lifetime.csv")
    assert len(loads) == 4 * 4  # integrators x channels, one exponent
    # the toy's moments are sines of amplitude proportional to the wind: so are the DELs, and rk4's error is step^4 in all of them
    channel = "tower_base_fore_aft_moment"
    short = {r["wind_speed"]: r[f"del_{channel}_m4"] for r in results.where(is_reference=True)}
    p = [b.probability for b in results.life.bins]
    by_hand = (
        sum(q * short[v] ** 4 for q, v in zip(p, (6, 8, 10), strict=True)) * 20 * 8760 * 3600 / 1e7
    ) ** 0.25
    row = next(r for r in loads if r["is_reference"] == "True" and r["channel"] == channel)
    assert float(row["lifetime_del"]) == pytest.approx(by_hand, rel=1e-12)
    rk4 = next(r for r in loads if r["method"] == "rk4" and r["channel"] == channel)
    assert float(rk4["error"]) == pytest.approx(
        0.1**4, rel=1e-3
    )  # loads are counted as single precision holds them
    damage = read(tmp_path / "out" / "damage.csv")
    assert len(damage) == 4 * 24 and {r["place"] for r in damage} == {"tower_base"}
    assert float(damage[0]["damage"]) > 0


def test_another_climate_needs_no_new_simulation_and_another_curve_only_a_new_count(world, tmp_path):
    exact = {"log": "{precision: float64}"}
    run_campaign(write_campaign(tmp_path, lifetime=LIFE, **exact), tmp_path / "out")
    before = len(world.calls)
    again = run_campaign(
        write_campaign(tmp_path, lifetime="{climate: {weibull: {mean: 7}}}", **exact), tmp_path / "out"
    )
    assert again.simulated == 0 and len(world.calls) == before
    assert again.life.climate.name == "Weibull, mean 7 m/s, shape 2"
    counted = run_campaign(write_campaign(tmp_path, lifetime=LIFE, fatigue=DAMAGE, **exact), tmp_path / "out")
    assert counted.simulated == 12 and len(world.calls) == before  # evaluated anew from the logs
    assert counted.life.places == ("tower_base",)


def test_a_diverged_case_is_lost_with_its_probability(world, tmp_path):
    world.diverging["rk4", 8.0] = 3.0
    life = run_campaign(write_campaign(tmp_path, lifetime=LIFE), tmp_path / "out").life
    rk4 = next(key for key in life.integrators if key[0] == "rk4")
    figure = life.load(rk4, "tower_base_fore_aft_moment", 4)
    assert (figure.cases, figure.lost_cases) == (2, 1)
    assert figure.lost == pytest.approx(life.bins[1].probability)


def test_the_names_of_weis_are_understood(world, tmp_path):
    text = (
        write_campaign(tmp_path)
        .read_text()
        .replace("duration: 10\n", "analysis_time: 8\ntransient_time: 2\n")
    )
    wind = "wind:\n  type: turbulent\n  intensity: 0.1\n  n_seeds: 2\n  speeds: [6, 8, 10]\n"
    path = tmp_path / "weis.yaml"
    path.write_text(text.replace("wind:\n  speeds: [6, 8, 10]\n", wind))
    plan = make_plan(path)
    assert (plan.campaign.duration, plan.campaign.discard) == (10.0, 2.0)
    assert len(plan.named.realisations) == 6


REFUSED = [
    ({"lifetime": "{climate: IV}"}, r"toy.yaml:\d+: lifetime.climate: unknown IEC wind class 'IV'; did you mean"),
    ({"lifetime": "{climate: S}"}, "lifetime.climate: IEC class S has the climate that its designer states"),
    ({"lifetime": "{}"}, "key 'climate' is missing in lifetime"),
    ({"lifetime": "{climate: {weibull: {mean: -3}}}"}, "mean must be above 0; got -3"),
    ({"lifetime": "{climate: {weibull: {mean: 8}, table: {speeds: [1, 2], probabilities: [0.1, 0.1]}}}"}, "one of `weibull` and `table`"),
    ({"lifetime": "{climate: {table: {speeds: [4, 6], probabilities: [0.9, 0.5]}}}"}, "sum to 1.4, more than 1"),
    ({"lifetime": "{climate: II, bins: {width: 3}}"}, r"toy.yaml:\d+: lifetime: bins of 3 m/s overlap: winds of 6 and 8 m/s"),
    ({"lifetime": "{climate: II, bins: {width: 1}}"}, "no wind for 6.5 to 7.5 m/s between the bins of 1 m/s around 6 and 8 m/s"),
    ({"lifetime": "{climate: II, bins: {edges: [5, 7, 9, 11, 13]}}"}, "the bin from 11 to 13 m/s has no wind"),
    ({"lifetime": "{climate: II, bins: {edges: [5, 7, 9]}}"}, "the wind of 10 m/s lies outside the bins from 5 to 9 m/s"),
    ({"lifetime": "{climate: II, bins: {edges: [9, 7]}}"}, "edges of wind bins must rise"),
    ({"lifetime": "{climate: II, operating_range: [3, 25]}"}, "miss 3 to 5 m/s and 11 to 25 m/s of the operating"),
    ({"lifetime": "{climate: II, operating_range: [25, 3]}"}, "must be .from, to. in m/s"),
    ({"lifetime": "{climate: II, availability: 1.2}"}, "lifetime.availability must be at most 1; got 1.2"),
    ({"lifetime": "{climate: II, year: 25}"}, "unknown key 'year' in lifetime; did you mean 'years'"),
    ({"fatigue": "{wohler_exponents: [4, 0]}"}, "must be at least 1; got 0"),
    ({"fatigue": "{wohler_exponents: [-3]}"}, "must be at least 1; got -3"),
    ({"fatigue": "{damage: [{place: tower_base, curve: dnv-q-air}]}"}, "'dnv-q-air' is not known; did you mean"),
    ({"fatigue": "{damage: [{place: tower_bas, curve: dnv-d-air}]}"}, "'tower_bas' is not known; did you mean 'tower_base'"),
    ({"fatigue": "{damage: [{place: tower_base, curve: {exponents: [-3], stress: 80}}]}"}, "exponents must be above zero: a curve falls"),
    ({"fatigue": "{damage: [{place: tower_base, curve: {exponents: [3, 5], stress: 80}}]}"}, "one knee between two exponents"),
    ({"fatigue": "{damage: [{place: blade1_root, curve: dnv-d-air}]}"}, "does not say how thick its blade 1 root is"),
    ({"fatigue": "{damage: [{place: tower_base, curve: dnv-d-air}, {place: tower_base, curve: ec3-80}]}"}, "'tower_base' stands twice"),
    ({"fatigue": "{damage: [{place: tower_base, ultimate: 3, curve: {laminate: epoxy, tension: 1, compression: 1}}]}"}, "laminate"),
    ({"analysis_time": "10"}, "analysis_time: is part of what 'duration' says"),
    ({"wind": "{type: turbulent, intensity: 0.1, speeds: [6, 8, 10], seeds: [1, 2, 1]}"}, "seed 1 stands twice"),
]  # fmt: skip


@pytest.mark.parametrize(("replace", "message"), REFUSED, ids=[message[:40] for _, message in REFUSED])
def test_what_makes_no_life_is_refused_with_the_line_before_anything_is_written(
    world, tmp_path, replace, message
):
    text = "\n".join(
        line
        for line in write_campaign(tmp_path).read_text().splitlines()
        if "speeds" not in line or "wind" not in replace
    )
    (tmp_path / "toy.yaml").write_text(text)
    path = write_campaign(tmp_path, text, **replace)
    with pytest.raises(InputError, match=message) as caught:
        run_campaign(path, tmp_path / "out")
    assert "toy.yaml:" in str(caught.value) and not (tmp_path / "out").exists()


def test_under_control_the_bins_must_cover_the_turbines_operating_range(world, tmp_path):
    path = write_campaign(
        tmp_path, lifetime="{climate: II, bins: {edges: [5, 7, 9, 10.5]}}", operation="controlled"
    )
    with pytest.raises(InputError, match=r"miss 10\.5 to 11 m/s of the operating range"):
        make_plan(path)
    make_plan(write_campaign(tmp_path, lifetime=LIFE, operation="controlled"))
