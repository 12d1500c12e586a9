"""Bin probabilities and lifetime loads against IEC 61400-1's Rayleigh distribution and the power sum."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fatigue_runner import fatigue as fa
from fatigue_runner.errors import InputError


def test_the_bins_of_iec_class_two_have_the_probabilities_of_the_rayleigh_distribution():
    found = fa.bin_probabilities(fa.iec_climate("II"), np.arange(4.0, 25.0, 2.0), 2.0)
    # exp(-pi/4 (v / 8.5)²) at the edges; V_ave = 0.2 x 42.5 m/s, IEC 61400-1
    edges = np.exp(-math.pi / 4 * (np.arange(3.0, 26.0, 2.0) / 8.5) ** 2)
    np.testing.assert_allclose(found, -np.diff(edges), rtol=1e-12)
    assert found.sum() == pytest.approx(0.9056780900448717, rel=1e-12)  # what 3 to 25 m/s cover, not 1


@given(st.floats(4.0, 12.0), st.floats(1.2, 4.0))
def test_a_climate_has_its_mean_and_bins_over_all_winds_sum_to_one(mean, shape):
    climate = fa.WindClimate(mean, shape)
    middles = mean * (np.arange(40000) + 0.5) / 1000
    assert climate.exceedance(middles).sum() * mean / 1000 == pytest.approx(mean, rel=1e-5)
    bins = fa.bin_probabilities(climate, np.arange(0.5, 40 * mean), 1.0)
    assert bins.sum() == pytest.approx(1.0, rel=1e-9)


def test_the_lowest_bin_does_not_reach_below_calm():
    assert fa.bin_probabilities(fa.iec_climate("I"), [0.5], 4.0)[0] == 1 - fa.iec_climate("I").exceedance(2.5)


def test_overlapping_bins_and_unknown_classes_are_refused():
    with pytest.raises(InputError, match="bins of width 2 m/s overlap: two centres are 1 m/s apart"):
        fa.bin_probabilities(fa.iec_climate("I"), [4.0, 6.0, 7.0], 2.0)
    with pytest.raises(InputError, match="unknown IEC wind class 'IV'; did you mean"):
        fa.iec_climate("IV")


def test_seeds_share_the_probability_of_their_bin():
    climate = fa.iec_climate("II")
    shared = fa.case_probabilities(climate, [6.0, 8.0, 6.0, 6.0], 2.0)
    alone = fa.bin_probabilities(climate, [6.0, 8.0], 2.0)
    np.testing.assert_allclose(shared, [alone[0] / 3, alone[1], alone[0] / 3, alone[0] / 3], rtol=1e-14)


def test_the_lifetime_del_is_a_power_sum_and_not_the_mean_of_dels():
    # MLife: (Σ p L^m)^(1/m) for n_eq = lifetime x 1 Hz; the linear mean would be 2.36
    seconds = 25 * 8760 * 3600.0
    found = fa.lifetime_equivalent_load([1.0, 10.0], [0.84846949, 0.15153051], 10, n_eq=seconds, years=25.0)
    assert found.load == pytest.approx(8.280375058015588, rel=1e-7)


def test_the_lifetime_del_refers_to_ten_million_cycles_in_twenty_years():
    found = fa.lifetime_equivalent_load([1.0], [1.0], 4)
    assert found.load == pytest.approx((20 * 8760 * 3600 / 1e7) ** 0.25, rel=1e-14)


def test_a_failed_case_is_lost_with_its_probability_and_nobody_else_takes_its_place():
    probabilities = [0.2, 0.3, 0.4]
    found = fa.lifetime_equivalent_load([5.0, None, 7.0], probabilities, 4)
    assert (found.covered, found.lost) == (pytest.approx(0.6), 0.3)
    assert found.load == fa.lifetime_equivalent_load([5.0, 0.0, 7.0], probabilities, 4).load
    assert "cover 0.6000 of the wind climate, 0.3000 lost to failed cases, not renormalised" in str(found)


def test_renormalising_is_only_done_when_asked_and_is_said():
    plain = fa.lifetime_equivalent_load([5.0, None], [0.25, 0.75], 4)
    asked = fa.lifetime_equivalent_load([5.0, None], [0.25, 0.75], 4, renormalise=True)
    assert asked.load == pytest.approx(plain.load * 4**0.25)
    assert asked.covered == plain.covered == 0.25
    assert "renormalised to 1" in str(asked)


def test_when_all_cases_fail_there_is_no_lifetime_del():
    found = fa.lifetime_equivalent_load([None, None], [0.4, 0.5], 4, renormalise=True)
    assert found.load is None and found.lost == pytest.approx(0.9)
    assert str(found).startswith("no lifetime DEL, all cases failed")


@given(st.lists(st.floats(1e-3, 1e9), min_size=1, max_size=20), st.floats(1.0, 14.0), st.floats(1e-3, 1e3))
def test_the_lifetime_del_is_proportional_and_lies_between_its_cases(loads, m, factor):
    weights = np.full(len(loads), 1 / len(loads))
    seconds = 20 * 8760 * 3600.0
    found = fa.lifetime_equivalent_load(loads, weights, m, n_eq=seconds).load
    assert min(loads) * (1 - 1e-9) <= found <= max(loads) * (1 + 1e-9)
    scaled = fa.lifetime_equivalent_load([factor * load for load in loads], weights, m, n_eq=seconds).load
    assert scaled == pytest.approx(factor * found, rel=1e-9)


@pytest.mark.parametrize(
    ("loads", "probabilities", "message"),
    [
        ([1.0, 2.0], [0.5], "got 2 loads and 1 probabilities"),
        ([1.0, 2.0], [0.6, 0.5], "sum to 1.1, more than 1"),
        ([1.0, np.nan], [0.5, 0.5], "loads must be finite and not negative, got nan"),
        ([1.0, 2.0], [0.5, -0.1], "probabilities must be finite and not negative"),
    ],
)
def test_a_wrong_lifetime_is_refused_in_a_sentence(loads, probabilities, message):
    with pytest.raises(InputError, match=message):
        fa.lifetime_equivalent_load(loads, probabilities, 4)
