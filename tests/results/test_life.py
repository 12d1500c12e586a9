"""A life from rows: by hand, beside the formulas of MLife and pCrunch, and with what is lost."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from fatigue_runner.errors import InputError
from fatigue_runner.results import life_words
from fatigue_runner.results.columns import CASE
from fatigue_runner.results.lifetime import DAMAGE_COLUMNS, LOAD_COLUMNS, life_of
from fatigue_runner.results.lifetime_section import LifetimeSection
from fatigue_runner.results.ranking import rank

TABLE = {"table": {"speeds": [6, 8, 10], "probabilities": [0.5, 0.3, 0.1]}}
CHANNEL = "tower_base_fore_aft_moment"
REFERENCE = ("rk7", 0.01, "", "", True)
YEAR = 8760 * 3600.0


def row(speed, seed, load, method="rk7", status="done", damage=None, exponent=2):
    reference = method == "rk7"
    found = dict.fromkeys(column.name for column in CASE) | {
        "case_id": f"{method}-{speed}-{seed}", "wind_speed": speed, "seed": seed, "method": method, "step": 0.01,
        "is_reference": reference, "status": status, f"del_{CHANNEL}_m{exponent}": load, "evaluations_per_second": 700 if reference else 80,
    }  # fmt: skip
    return (
        found
        if damage is None
        else found | {"damage_tower_base_000": damage, "damage_tower_base_180": damage / 2}
    )


def section(**more):
    return LifetimeSection.model_validate({"climate": TABLE, "n_eq": 20 * YEAR, **more})


# 6 m/s: 100; 8 m/s: two seeds, 180 and 220; 10 m/s: 400
CASES = [row(6, 1, 100.0), row(8, 1, 180.0), row(8, 2, 220.0), row(10, 1, 400.0)]


def test_a_lifetime_load_by_hand():
    # 0.5 · 100² + 0.3/2 · (180² + 220²) + 0.1 · 400² = 5000 + 12120 + 16000 = 33120; its root is 181.99
    found = life_of(CASES, section()).load(REFERENCE, CHANNEL, 2)
    assert found.value == pytest.approx(33120**0.5)
    assert found.shares == pytest.approx((5000 / 33120, 12120 / 33120, 16000 / 33120))
    assert (found.cases, found.lost_cases, found.covered, found.lost) == (4, 0, pytest.approx(0.9), 0.0)


def test_the_sum_of_the_bins_is_told_and_scaled_to_one_only_when_asked():
    life = life_of(CASES, section())
    assert life.covered == pytest.approx(0.9)
    assert "hold 0.9000 of the time (taken as it is, not renormalised)" in life.statement()[0]
    assert "Idle for 10.0% of the 20 years" in life.statement()[1]
    scaled = life_of(CASES, section(renormalise=True))
    assert scaled.covered == pytest.approx(0.9) and "scaled to 1 as asked" in scaled.statement()[0]
    assert scaled.load(REFERENCE, CHANNEL, 2).value == pytest.approx((33120 / 0.9) ** 0.5)


def test_availability_and_the_cycles_it_refers_to_count_by_the_exponent():
    found = life_of(CASES, section(availability=0.5, n_eq=1e7, years=25)).load(REFERENCE, CHANNEL, 2)
    assert found.value == pytest.approx((33120 * 0.5 * 25 * YEAR / 1e7) ** 0.5)


def test_a_lost_case_takes_its_share_with_it():
    cases = [*CASES[:3], row(10, 1, None, status="diverged")]
    life = life_of(cases, section())
    found = life.load(REFERENCE, CHANNEL, 2)
    assert found.value == pytest.approx(17120**0.5)
    assert (found.cases, found.lost_cases, found.covered, found.lost) == (
        3,
        1,
        pytest.approx(0.8),
        pytest.approx(0.1),
    )
    assert "1 case with a probability of 0.1000 is lost" in " ".join(life_words.distrust(life))


def test_a_diverged_case_with_a_load_in_the_table_and_a_case_that_is_not_there_are_lost_too():
    cases = [
        *CASES[:3],
        row(10, 1, 400.0, status="diverged"),
        *(row(s, n, 1.0, "rk4") for s, n in ((6, 1), (8, 1), (8, 2))),
    ]
    life = life_of(cases, section())
    assert life.load(REFERENCE, CHANNEL, 2).lost_cases == 1
    assert life.load(("rk4", 0.01, "", "", False), CHANNEL, 2).lost == pytest.approx(0.1)


def test_an_integrator_is_measured_on_the_winds_that_the_reference_finished():
    others = [
        row(6, 1, 101.0, "rk4"),
        row(8, 1, 181.8, "rk4"),
        row(8, 2, 222.2, "rk4"),
        row(10, 1, None, "rk4", "failed"),
    ]
    life = life_of([*CASES, *others], section())
    found = life.load(("rk4", 0.01, "", "", False), CHANNEL, 2)
    assert found.error == pytest.approx(0.01) and found.value == pytest.approx(1.01 * 17120**0.5)
    assert life.load(REFERENCE, CHANNEL, 2).error is None


def test_damage_adds_by_miners_sum_and_gives_years():
    cases = [
        row(6, 1, 1.0, damage=0.01),
        row(8, 1, 1.0, damage=0.02),
        row(8, 2, 1.0, damage=0.04),
        row(10, 1, 1.0, damage=0.2),
    ]
    life = life_of(cases, section(availability=0.9))
    worst = life.hot_spot(REFERENCE, "tower_base")
    # 0.5 · 0.01 + 0.3 · 0.03 + 0.1 · 0.2 = 0.034 a year; 20 · 0.9 years of it
    assert worst.value == pytest.approx(0.034 * 18) and worst.at == 0.0
    assert life.years_of(worst) == pytest.approx(1 / (0.034 * 0.9))
    assert [f.value for f in life.around(REFERENCE, "tower_base")] == pytest.approx([0.612, 0.306])
    assert "Tower base: 33 years" in life_words.places_in_words(life)[0]
    assert "winds of 9 to 11 m/s do 59% of the damage" in life_words.places_in_words(life)[0]


def seeds(count, scatter=0.1, method="rk7", error=0.0, start=0):
    rng = np.random.default_rng(start)
    return [
        row(v, s, (1 + error) * 100 * v * (1 + scatter * rng.standard_normal()), method)
        for v in (6, 8, 10)
        for s in range(count)
    ]


def test_the_seeds_interval_holds_the_life_and_narrows_with_the_root_of_their_number():
    few, many = (life_of(seeds(n), section()).load(REFERENCE, CHANNEL, 2) for n in (6, 96))
    for found in (few, many):
        assert found.low < found.value < found.high
    assert many.scatter == pytest.approx(few.scatter / 4, rel=0.5)
    assert (
        life_of(CASES[:2] + CASES[3:], section()).load(REFERENCE, CHANNEL, 2).low is None
    )  # one seed says nothing


def test_an_integrator_is_good_enough_where_it_errs_by_a_tenth_of_what_the_seeds_leave():
    for error, good in ((0.001, True), (0.02, False)):
        cases = [*seeds(6), *seeds(6, method="rk4", error=error)]
        life = life_of(cases, section())
        assert life_words.good_enough(life, ("rk4", 0.01, "", "", False)) is good
        said = " ".join(life_words.integrator_in_words(life, rank(cases)))
        assert said.startswith(
            "Good enough for this life: rk4 10 ms, 8.8 times cheaper" if good else "No integrator errs"
        )


def test_the_tables_hold_what_their_columns_say(tmp_path):
    cases = [row(s, n, 100.0, damage=0.01) for s, n in ((6, 1), (8, 1), (10, 1))]
    life = life_of(cases, section())
    life.write(tmp_path)
    for name, columns, count in (("lifetime.csv", LOAD_COLUMNS, 1), ("damage.csv", DAMAGE_COLUMNS, 2)):
        with (tmp_path / name).open(newline="") as file:
            rows = list(csv.DictReader(file))
        assert list(rows[0]) == [column.name for column in columns] and len(rows) == count
        assert all(column.meaning for column in columns)
    life_of(CASES, section()).write(tmp_path)
    assert not (tmp_path / "damage.csv").exists()  # of the earlier life


def test_a_table_as_read_from_csv_gives_the_same_life():
    as_text = [{k: "" if v is None else str(v) for k, v in case.items()} for case in CASES]
    assert (
        life_of(as_text, section()).load(REFERENCE, CHANNEL, 2).value
        == life_of(CASES, section()).load(REFERENCE, CHANNEL, 2).value
    )


def test_the_api_takes_tables_of_other_libraries_and_keys_of_a_campaign(tmp_path):
    import pyarrow as pa

    import fatigue_runner as fr

    table = pa.Table.from_pylist([{k: v for k, v in case.items() if v is not None} for case in CASES])
    life = fr.lifetime(table, climate=TABLE, n_eq=20 * YEAR)
    assert life.load(REFERENCE, CHANNEL, 2).value == pytest.approx(33120**0.5)
    assert "Climate: a table of 3 speeds" in str(life)
    assert life.to_arrow().column("lifetime_del").to_pylist() == [life.loads[0].value]
    assert life.damage_to_arrow().num_rows == 0
    with pytest.raises(InputError, match="a life needs a climate"):
        fr.lifetime(CASES)
    with pytest.raises(InputError, match="unknown key 'yeers'; did you mean 'years'"):
        fr.lifetime(CASES, climate="II", yeers=3)


def test_no_wind_and_no_case_are_said_in_a_sentence():
    with pytest.raises(InputError, match="no wind with a mean speed"):
        life_of([], section())
    lost = [row(v, 1, None, status="failed") for v in (6, 8, 10)]
    life = life_of(lost, section())
    assert life.load(REFERENCE, CHANNEL, 2).value is None
    assert life_words.loads_in_words(life) == ["No lifetime load: no case counts."]


# --- beside other programs: their formulas, read in their sources, on the same short-term loads

LOADS = np.array([100.0, 180.0, 220.0, 400.0])
SHARES = np.array([0.5, 0.15, 0.15, 0.1])


def test_mlife_has_the_same_lifetime_load_for_the_cycles_that_its_cases_stand_for():
    # compute_fatigue_per_DEL_type.m: DEL = (sum_j f_j sum_i n_ij R_ij^m / sum_j f_j T_j f_eq)^(1/m) with the time factor
    # f_j = p_j T_life / T_j; so N_eq is the life's seconds in the bins, not all of its seconds
    m, seconds, life_time = 2, 600.0, 20 * YEAR
    factor = SHARES * life_time / seconds
    ranges_sum = factor * seconds * LOADS**m  # sum_i n_i R_i^m = T f_eq DEL^m of each case
    equivalent = float((factor * seconds).sum())
    mlife = (ranges_sum.sum() / equivalent) ** (1 / m)
    found = life_of(CASES, section(n_eq=equivalent)).load(REFERENCE, CHANNEL, m)
    assert found.value == pytest.approx(mlife, rel=1e-12)


def test_pcrunch_takes_the_mean_of_loads_which_does_another_damage_than_its_cases():
    # crunch.py, compute_total_fatigue: sum(prob * dels) with prob scaled to 1. A constant load that does the cases' damage is the power
    # mean, ours: 0.9 of the time at L, L^m = 33120 / 0.9.
    m = 2
    pcrunch = float((SHARES / SHARES.sum()) @ LOADS)
    ours = life_of(CASES, section(renormalise=True)).load(REFERENCE, CHANNEL, m).value
    damage = float((SHARES / SHARES.sum()) @ LOADS**m)
    assert ours**m == pytest.approx(damage) and pcrunch**m < 0.8 * damage
    assert pcrunch == pytest.approx(166.667, rel=1e-5) and ours == pytest.approx(191.833, rel=1e-5)


def test_pcrunch_has_the_same_damage_where_probabilities_are_scaled_to_one():
    # crunch.py: availability * sum(prob * damage) * lifetime * 365 * 86400 / sum(T * prob), prob scaled to 1
    rates, seconds = np.array([0.01, 0.02, 0.04, 0.2]), 600.0
    damage = rates * seconds / YEAR
    prob = SHARES / SHARES.sum()
    pcrunch = 0.97 * float(prob @ damage) * 20 * 365 * 86400 / float(prob @ np.full(4, seconds))
    cases = [
        row(v, s, 1.0, damage=float(d))
        for (v, s), d in zip(((6, 1), (8, 1), (8, 2), (10, 1)), rates, strict=True)
    ]
    found = life_of(cases, section(availability=0.97, renormalise=True)).hot_spot(REFERENCE, "tower_base")
    assert found.value == pytest.approx(pcrunch, rel=1e-12)
