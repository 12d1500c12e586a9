"""Rainflow counting against the standard's example and, cycle for cycle, the PyPI package `rainflow`."""

import math
from collections import Counter

import numpy as np
import pytest
import rainflow as reference
from hypothesis import example, given, settings
from hypothesis import strategies as st

from fatigue_runner import fatigue as fa
from fatigue_runner.errors import InputError
from fatigue_runner.fatigue import rainflow

# ASTM E1049-85, 5.4.4, figure 6: the worked example of the standard.
ASTM_SERIES = [-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0]
ASTM_CYCLES = [  # range, mean, count; ranges and counts as printed in the standard, in the order of its steps
    (3.0, -0.5, 0.5),
    (4.0, -1.0, 0.5),
    (4.0, 1.0, 1.0),
    (8.0, 1.0, 0.5),
    (9.0, 0.5, 0.5),
    (8.0, 0.0, 0.5),
    (6.0, 1.0, 0.5),
]

loads = st.floats(-1e9, 1e9, allow_nan=False)
# Small integers tie and repeat more often than floats do; any finite float brings the extremes of the format.
series = st.one_of(
    st.lists(loads, min_size=3, max_size=80),
    st.lists(st.integers(-4, 4).map(float), min_size=3, max_size=80),
    st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=3, max_size=20),
)
unhurried = settings(deadline=None)  # the first example may compile
varying = series.filter(lambda values: min(values) != max(values))


def cycles(values, residue="half"):
    return [tuple(float(x) for x in cycle) for cycle in zip(*rainflow(values, residue), strict=True)]


def cycles_of_the_package(values):
    return [cycle[:3] for cycle in reference.extract_cycles(values)]


def counts_by_range(values):
    total: Counter[float] = Counter()
    for size, _, count in cycles(values):
        total[size] += count
    return total


def test_the_example_of_the_standard_is_counted_cycle_for_cycle():
    assert cycles(ASTM_SERIES) == ASTM_CYCLES


@settings(max_examples=600, deadline=None)
@given(varying)
@example([0.0, 1e-200, 0.0, 1.0])  # the product of two slopes underflows: the package misses this reversal
@example([-1.7e308, 1.7e308, -1.7e308, 0.0])  # a range beyond the largest float
@example([0.0, 5.0, 5.0])
@example([5.0, 5.0, 0.0, 5.0])
def test_equals_the_package_rainflow_cycle_for_cycle_in_order(values):
    assert cycles(values) == cycles_of_the_package(values)


@pytest.mark.parametrize("growth", [0.99, 1.0, 1.01])
def test_equals_the_package_on_long_decaying_steady_and_growing_oscillations(growth):
    n = np.arange(3000)
    values = growth**n * np.cos(2.1 * n) + 0.01 * n
    assert cycles(values) == cycles_of_the_package(values)


@unhurried
@given(varying)
def test_the_counts_sum_to_half_the_number_of_ranges_between_reversals(values):
    points = list(reference.reversals(values))
    assert rainflow(values)[2].sum() == (len(points) - 1) / 2


@unhurried
@given(varying)
def test_residue_full_counts_every_open_range_as_one_and_drop_leaves_it_out(values):
    half = cycles(values)
    assert cycles(values, "full") == [(size, mean, 1.0) for size, mean, _ in half]
    assert cycles(values, "drop") == [cycle for cycle in half if cycle[2] == 1.0]


def test_residue_drop_keeps_only_the_closed_cycle_of_the_standard_example():
    assert cycles(ASTM_SERIES, "drop") == [(4.0, 1.0, 1.0)]


@unhurried
@given(st.lists(st.integers(-50, 50).map(float), min_size=3, max_size=60))
def test_counting_backwards_in_time_gives_the_same_count_of_every_range(values):
    assert counts_by_range(values[::-1]) == counts_by_range(values)


@unhurried
@given(varying)
def test_a_mirrored_series_has_the_same_ranges_and_opposite_means(values):
    ranges, means, counts = rainflow(values)
    mirrored = rainflow(-np.array(values))
    np.testing.assert_array_equal(mirrored[0], ranges)
    np.testing.assert_array_equal(mirrored[1], -means)
    np.testing.assert_array_equal(mirrored[2], counts)


@unhurried
@given(varying, st.integers(2, 4))
def test_a_plateau_counts_once_however_long_it_lasts(values, repeats):
    assert cycles(np.repeat(values, repeats)) == cycles(values)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("index", [0, 10, 99])
def test_a_sample_that_is_not_finite_is_refused_with_its_index(value, index):
    values = np.sin(np.arange(100.0))
    values[index] = value
    with pytest.raises(InputError, match=rf"is {value} at index {index} of 100") as refused:
        rainflow(values)
    assert isinstance(refused.value, ValueError)


@pytest.mark.parametrize("values", [[5.0] * 10, [0.0, -0.0, 0.0], [], [1.0], [0.0, 9.0]])
def test_a_constant_and_fewer_than_three_samples_hold_no_cycle(values):
    assert [part.shape for part in rainflow(values)] == [(0,), (0,), (0,)]


def test_a_monotone_ramp_is_half_a_cycle():
    assert cycles(np.arange(10)) == [(9.0, 4.5, 0.5)]


def test_an_unknown_residue_is_refused_with_the_nearest_known_one():
    with pytest.raises(InputError, match="unknown residue 'halves'; did you mean 'half'"):
        rainflow(ASTM_SERIES, "halves")


def test_a_table_of_channels_is_refused_rather_than_counted_as_one():
    with pytest.raises(InputError, match=r"one dimension, got shape \(3, 2\)"):
        rainflow(np.zeros((3, 2)))


def test_lists_integers_single_precision_and_columns_count_alike_and_stay_as_they_are():
    table = np.zeros((9, 3))
    table[:, 1] = ASTM_SERIES
    kept = table.copy()
    for values in (tuple(ASTM_SERIES), np.array(ASTM_SERIES, np.int32), np.float32(ASTM_SERIES), table[:, 1]):
        assert cycles(values) == ASTM_CYCLES
    np.testing.assert_array_equal(table, kept)


def test_what_lies_below_a_mask_is_refused_and_an_open_mask_is_none():
    """NumPy drops the mask of what becomes a plain array: the hidden 9 would count."""
    hidden = np.ma.array([0.0, 5, 0, 9, 0], mask=[0, 0, 0, 1, 0])
    with pytest.raises(InputError, match="masked at index 3") as refused:
        rainflow(hidden)
    assert isinstance(refused.value, ValueError)
    for values in (np.ma.array(ASTM_SERIES), np.ma.array(ASTM_SERIES, mask=[False] * len(ASTM_SERIES))):
        assert cycles(values) == ASTM_CYCLES


def test_all_channels_and_exponents_come_from_one_count_equal_to_the_package():
    rng = np.random.default_rng(5)
    time = np.arange(6001) / 50
    loads = {
        f"c{i}": 1e6 * (np.sin((1 + i) * time) + np.cumsum(rng.standard_normal(time.size)) / 50)
        for i in range(3)
    }
    loads |= {"still": np.full(time.size, 3.0), "broken": np.where(time > 60, np.nan, 1.0)}
    exponents = [3.0, 4.0, 5.0, 10.0, 12.0, 6.7]
    found = fa.count_channels(loads, exponents, 120.0)
    for name in ("c0", "c1", "c2"):
        cycles = [(c[0], c[2]) for c in reference.extract_cycles(loads[name])]
        for m in exponents:
            by_hand = (math.fsum(n * s**m for s, n in cycles) / 120.0) ** (1 / m)
            assert found[name].load(m) == pytest.approx(by_hand, rel=1e-12)
        assert found[name].cycles == math.fsum(n for _, n in cycles)
        assert found[name].largest_range == max(s for s, _ in cycles)
    assert (
        found["still"].condition == "constant"
        and found["broken"].condition == "not finite from sample 3001 of 6001"
    )
    assert list(found) == list(loads)
