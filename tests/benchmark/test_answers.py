"""The benchmark's answers have known answers: fronts and costs read from curves, all on points made by hand."""

from __future__ import annotations

import math

import pytest
from benchmark_points import point, result
from hypothesis import given
from hypothesis import strategies as st

from fatigue_runner.benchmark.pages import words
from fatigue_runner.benchmark.study import answers


def test_the_front_holds_the_points_that_none_beats_and_none_that_diverged():
    points = [
        point("a", 0.1, 10, 1e-2),
        point("b", 0.1, 20, 2e-2),
        point("c", 0.1, 30, 1e-3),
        point("d", 0.1, 30, 2e-3),
        point("e", 0.1, 5, 1e-6, diverged=1),
        point("f", 0.1, 1, 0.5),
    ]
    assert [p.series for p in answers.front(points, answers.wall, answers.nrmse)] == ["a", "c"]


def test_the_cost_of_an_accuracy_lies_on_a_straight_line_in_log_log():
    # an order-4 method: ten times the cost for 1e-4 of the error
    curve = [point("a", 0.1, 10, 1e-1 * 0.9), point("a", 0.1, 10, 1e-2), point("a", 0.01, 100, 1e-6)]
    found = answers.reach(curve, answers.wall, answers.nrmse, 1e-4)
    assert found.wall == pytest.approx(10**1.5 * 1e-6)
    assert found.evaluations == pytest.approx(10**1.5) and found.step == pytest.approx(10**-1.5)
    assert found.between == ("a 100 ms", "a 10 ms")


def test_a_curve_is_never_extrapolated():
    curve = [point("a", 0.1, 10, 1e-3), point("a", 0.05, 20, 1e-4)]
    assert answers.reach(curve, answers.wall, answers.nrmse, 1e-5) is None
    # beyond its cheap end it costs what its largest step costs, although a larger one might do
    found = answers.reach(curve, answers.wall, answers.nrmse, 1e-2)
    assert found.wall == pytest.approx(10e-6) and found.between == ("a 100 ms",)


def test_a_level_that_a_point_has_exactly_costs_what_the_point_costs():
    curve = [point("a", 0.1, 10, 1e-3), point("a", 0.05, 20, 1e-4)]
    assert answers.reach(curve, answers.wall, answers.nrmse, 1e-4).wall == pytest.approx(20e-6)


def test_a_step_that_diverged_or_is_useless_bends_no_curve():
    curve = [
        point("a", 0.3, 2, 1e-9, diverged=2),
        point("a", 0.2, 5, 70.0),
        point("a", 0.1, 10, 5e-3),
        point("a", 0.05, 20, 1e-4),
    ]
    assert answers.reach(curve, answers.wall, answers.nrmse, 1e-2).wall == pytest.approx(10e-6)


def test_nothing_is_read_across_a_step_that_is_unstable():
    curve = [point("a", 0.3, 2, 3e-2), point("a", 0.2, 3, 2.0), point("a", 0.1, 10, 1e-3)]
    found = answers.reach(curve, answers.wall, answers.nrmse, 1e-2)
    assert found.wall == pytest.approx(10e-6) and found.between == ("a 100 ms",)
    lost = [curve[0], point("a", 0.2, 3, None, diverged=1), curve[2]]
    assert answers.reach(lost, answers.wall, answers.nrmse, 1e-2) == found


def test_a_point_that_is_dearer_and_worse_than_another_of_its_curve_does_not_count():
    curve = [point("a", 0.1, 10, 1e-3), point("a", 0.09, 12, 2e-3), point("a", 0.05, 20, 1e-4)]
    without = [curve[0], curve[2]]
    level = 5e-4
    assert answers.reach(curve, answers.wall, answers.nrmse, level) == answers.reach(
        without, answers.wall, answers.nrmse, level
    )


@given(
    st.lists(st.tuples(st.floats(1, 1e3), st.floats(1e-8, 5e-2)), min_size=1, max_size=8),
    st.floats(1e-8, 5e-2),
)
def test_what_an_accuracy_costs_lies_between_two_points_of_the_curve(values, level):
    curve = [point("a", 1 / cost, cost, error) for cost, error in values]
    found = answers.reach(curve, answers.evaluations, answers.nrmse, level)
    good = [p.evaluations_per_second for p in curve if p.nrmse_max <= level]
    assert (found is None) == (not good)
    if found is not None:
        assert min(p.evaluations_per_second for p in curve) * (1 - 1e-9) <= found.evaluations
        assert found.evaluations <= min(good) * (1 + 1e-9)


def test_classical_and_corrected_ones_are_named_with_the_ratio_of_their_costs():
    found = result([
        point("a", 0.1, 10, 1e-2), point("a", 0.01, 1000, 1e-6),
        point("b", 0.1, 40, 1e-2),
        point("a + affine, enhanced", 0.1, 8, 1e-3, "enhanced"),
        point("a + affine, hybrid", 0.1, 16, 1e-3, "hybrid"),
    ])  # fmt: skip
    at = {a.target: a for a in answers.answers(found, "wall")}
    best = at["NRMSE 1e-03"]
    assert best.classical.series == "a" and best.corrected.series == "a + affine, enhanced"
    # a: 10 to 1000 µs over four decades of error, so 10^1.5 at a quarter of them
    assert best.ratio == pytest.approx(10**1.5 / 8)
    assert "times cheaper" in words.in_words(best)
    assert at["NRMSE 1e-05"].corrected is None and at["NRMSE 1e-05"].ratio is None
    assert "no corrected one gets there" in words.in_words(at["NRMSE 1e-05"])


def test_a_corrector_that_loses_is_said_to_be_dearer():
    found = result([point("a", 0.1, 10, 1e-4), point("a + affine, enhanced", 0.1, 20, 1e-4, "enhanced")])
    said = words.in_words(answers.answers(found, "wall")[0])
    assert said.endswith("2.00 times dearer.")


def test_adaptive_methods_count_by_their_evaluations_and_not_by_an_interpreters_time():
    found = result([point("a", 0.1, 10, 1e-4)])
    found["adaptive"] = [point("d-adaptive", 0.1, 5, 1e-4, "adaptive", wall={"interpreter": 1.0})]
    assert answers.answers(found, "wall")[0].classical.series == "a"
    assert answers.answers(found, "evaluations")[0].classical.series == "d-adaptive"


def test_a_corrector_is_held_against_the_classical_curves_at_its_own_error():
    found = result([
        point("a", 0.1, 10, 1e-2), point("a", 0.05, 100, 1e-4),
        point("a + affine, enhanced", 0.1, 20, 1e-3, "enhanced"),
        point("a + affine, hybrid", 0.1, 20, 1e-9, "hybrid"),
    ])  # fmt: skip
    duel, beyond = answers.duels(found)
    assert duel.ratio("wall") == pytest.approx(math.sqrt(10 * 100) / 20)
    assert beyond.ratio("wall") is None  # closer than any classical point: no ratio is invented


def test_exponential_methods_can_be_left_out_of_the_comparison_and_their_corrected_forms_stay():
    found = result([
        point("rk4", 0.1, 40, 1e-3), point("etdrk4", 0.1, 10, 1e-3),
        point("etdrk4 + affine, enhanced", 0.2, 8, 1e-3, "enhanced"),
    ])  # fmt: skip
    ratios = [answers.answers(found, "wall", with_exponential=w)[1].ratio for w in (True, False)]
    assert ratios == [pytest.approx(10 / 8), pytest.approx(40 / 8)]
