"""Climates and wind bins: distributions with known answers, and bins that are refused where a wind is missing or counts twice."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fatigue_runner import fatigue as fa
from fatigue_runner.errors import InputError
from fatigue_runner.fatigue.lifetime import interval, resampled


def test_bins_around_evenly_spaced_winds_follow_on_each_other():
    bins = fa.WindBins.around(np.arange(4.0, 25.0, 2.0))
    assert bins.edges == tuple(np.arange(3.0, 26.0, 2.0))
    # the known answer of the shared cases: IEC class II from 3 to 25 m/s
    assert bins.probabilities(fa.iec_climate("II")).sum() == pytest.approx(0.9056780900448717, rel=1e-12)


def test_a_measured_climate_gives_its_own_probabilities_back():
    climate = fa.TableClimate((4.0, 6.0, 8.0), (0.3, 0.5, 0.1))
    np.testing.assert_allclose(fa.WindBins((3.0, 5.0, 7.0, 9.0)).probabilities(climate), [0.3, 0.5, 0.1])
    np.testing.assert_allclose(
        fa.WindBins((3.0, 4.0, 7.0)).probabilities(climate), [0.15, 0.65]
    )  # uniform in a class
    assert climate.exceedance(20.0) == 0.0 and climate.exceedance(0.0) == pytest.approx(0.9)


@given(st.lists(st.floats(0.1, 5.0), min_size=2, max_size=12), st.floats(4.0, 12.0), st.floats(1.2, 3.5))
def test_bins_share_out_what_lies_between_their_outer_edges(widths, mean, shape):
    bins = fa.WindBins(tuple(np.cumsum([1.0, *widths])))
    climate = fa.WindClimate(mean, shape)
    between = climate.exceedance(bins.low) - climate.exceedance(bins.high)
    assert bins.probabilities(climate).sum() == pytest.approx(between, abs=1e-12)
    assert bins.places([0.5 * (a + b) for a, b in zip(bins.edges, bins.edges[1:], strict=False)]) == list(
        range(len(bins))
    )


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: fa.WindBins.around([4, 6, 10]), "no wind for 7 to 9 m/s between the bins of 2 m/s around 6 and 10 m/s; add a wind at 8"),
        (lambda: fa.WindBins.around([4, 6, 7], 2.0), "bins of 2 m/s overlap: winds of 6 and 7 m/s are 1 m/s apart"),
        (lambda: fa.WindBins.around([8.0, 8.0]), r"one wind speed \(8 m/s\) does not say how wide its bin is"),
        (lambda: fa.WindBins.around([0.5, 4.5]), "the bin around 0.5 m/s reaches below 0 m/s"),
        (lambda: fa.WindBins((3.0, 5.0, 5.0)), "edges of wind bins must rise"),
        (lambda: fa.WindBins((3.0, 5.0, 7.0)).check_filled([4.0]), "bin from 5 to 7 m/s has no wind"),
        (lambda: fa.WindBins((3.0, 5.0)).places([6.0]), "the wind of 6 m/s lies outside the bins from 3 to 5 m/s"),
        (lambda: fa.iec_climate("S"), "class S has the climate that its designer states"),
        (lambda: fa.TableClimate((4.0, 6.0), (0.7, 0.5)), "sum to 1.2, more than 1"),
        (lambda: fa.TableClimate((6.0, 4.0), (0.1, 0.5)), "must rise; 4 m/s does not"),
        (lambda: fa.TableClimate((6.0,), (0.1,)), "needs two speeds or more"),
    ],
)  # fmt: skip
def test_bins_and_climates_that_cannot_be_right_are_refused_in_a_sentence(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_the_bootstrap_draws_within_the_bins_and_is_the_same_every_time():
    places = [0, 0, 0, 1, 1, 2]
    drawn = resampled(places, 500)
    np.testing.assert_array_equal(drawn, resampled(places, 500))
    np.testing.assert_array_equal(drawn[:, :3].sum(axis=1), 3)
    np.testing.assert_array_equal(drawn[:, 5], 1)  # a bin of one wind has nothing to draw
    assert drawn[:, 0].mean() == pytest.approx(1.0, abs=0.15)


def test_the_bootstrap_finds_the_scatter_of_a_mean_in_closed_form():
    # the mean of 200 seeds of standard deviation 1 scatters by 1/sqrt(200): 90 % lie within 1.645 of that (central limit theorem)
    values = np.random.default_rng(7).standard_normal(200)
    low, high = interval(resampled([0] * 200, 4000) @ values / 200, 0.9)
    assert (high - low) / 2 == pytest.approx(1.645 * values.std() / 200**0.5, rel=0.06)
    assert (high + low) / 2 == pytest.approx(values.mean(), abs=0.01)
