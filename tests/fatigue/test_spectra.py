"""Markov matrices, crossings, durations and spectra against what they are of a sine, and against sums that they must keep."""

from __future__ import annotations

import numpy as np
import pytest

from fatigue_runner import fatigue as fa
from fatigue_runner.errors import InputError
from fatigue_runner.fatigue.spectra import (
    exceedance,
    extremes,
    level_crossings,
    load_duration,
    markov_matrix,
    spectrum,
)

STEP = 0.02
TIME = np.arange(30001) * STEP
SINE = 5.0 + 3.0 * np.sin(2 * np.pi * 0.5 * TIME + 0.1)


def test_a_sine_rises_through_every_level_within_it_once_a_cycle():
    found = level_crossings(SINE, [1.9, 2.1, 4.0, 7.9, 8.1])
    np.testing.assert_array_equal(found, [0, 300, 300, 300, 0])
    np.testing.assert_array_equal(level_crossings([0.0, 1.0, 2.0, 0.0, 3.0], [2.5, 0.0, 1.0]), [1, 2, 2])


def test_a_markov_matrix_keeps_every_cycle_and_a_sine_has_one_cell():
    ranges, means, counts = fa.rainflow(SINE)
    cells = markov_matrix(ranges, means, counts, np.arange(0.5, 11.0), np.arange(0.5, 11.0))
    assert (cells > 1).sum() == 1 and cells[5, 4] >= counts.sum() - 1  # 5.5 to 6.5 about 4.5 to 5.5
    assert cells.sum() == pytest.approx(counts.sum(), abs=1)  # what the ends leave is smaller
    load, cycles = exceedance(ranges, counts)
    assert (np.diff(load) <= 0).all() and cycles[-1] == counts.sum()


def test_the_damage_of_a_fine_markov_matrix_is_that_of_its_cycles():
    values = np.cumsum(np.random.default_rng(3).standard_normal(5000))
    ranges, means, counts = fa.rainflow(values)
    edges = np.linspace(0.0, ranges.max(), 2001)
    cells = markov_matrix(ranges, means, counts, edges, [-1e9, 1e9]).sum(axis=1)
    middles = 0.5 * (edges[1:] + edges[:-1])
    assert (cells @ middles**4) == pytest.approx(counts @ ranges**4, rel=2e-3)


def test_the_seconds_of_a_load_sum_to_its_duration_and_follow_the_arcsine_law():
    found = load_duration(SINE, STEP, [1.9, 3.5, 5.0, 6.51, 8.1])
    assert found.sum() == pytest.approx(TIME.size * STEP)
    # a sine of amplitude 3 is above 1.51 for arccos(1.51 / 3) / pi of the time, to a sample of a hundred at each end
    assert found[3] / found.sum() == pytest.approx(np.arccos(1.51 / 3) / np.pi, abs=0.01)


def test_the_integral_of_a_spectrum_is_the_variance_and_its_peak_the_frequency():
    frequency, density = spectrum(SINE, STEP)
    assert np.sum(density) * frequency[1] == pytest.approx(np.var(SINE), rel=1e-2)
    assert frequency[np.argmax(density)] == pytest.approx(0.5)


def test_extremes_have_their_times():
    low, high = extremes([3.0, -1.0, 7.0, 7.0], [0.0, 0.5, 1.0, 1.5])
    assert (low.value, low.time, high.value, high.time) == (-1.0, 0.5, 7.0, 1.0)


def test_edges_that_fall_and_series_that_are_not_finite_are_refused():
    with pytest.raises(InputError, match="edges of bins must rise"):
        load_duration(SINE, STEP, [3.0, 2.0])
    with pytest.raises(InputError, match="index 1"):
        level_crossings([0.0, np.nan, 1.0], [0.5])
