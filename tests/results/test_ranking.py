"""The ranking of integrators says what a careful engineer would say of the same table."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fatigue_runner.results import ranking
from fatigue_runner.results.cells import format_count, format_percent, number, truth

CHANNELS = ("blade1_root_flapwise_moment", "tower_base_fore_aft_moment")


def row(method="rk4", step=0.02, evaluations=200.0, error=0.001, status="done", wind=8.0, **more):
    """One case of the table; `error` is the DEL error of its first channel, the others have a tenth."""
    errors = {
        f"del_error_{channel}_m{exponent}": error if channel == CHANNELS[0] and exponent == 4 else error / 10
        for channel in CHANNELS
        for exponent in (4, 10)
    }
    dels = {column.replace("_error", ""): 1e6 for column in errors}
    base = {"case_id": f"{method}-{step}-{wind}", "wind_speed": wind, "method": method, "step": step}
    base |= {"corrector": "", "mode": "", "is_reference": False, "status": status, "duration": 60.0}
    base |= {"evaluations_per_second": evaluations, "wall_time": 0.06, "nrmse_max": abs(error) / 2}
    return {**base, **dels, **errors, **more}


def reference(wind=8.0):
    errors = {f"del_error_{c}_m{e}": "" for c in CHANNELS for e in (4, 10)}
    return row("rk7", 1e-3, 11000.0, 0.0, wind=wind, is_reference=True, nrmse_max="", **errors)


def test_the_cheapest_method_within_a_level_is_named_with_its_cost_and_its_worst_place():
    rows = [row("heun", 0.01, 200, 0.05), row("rk4", 0.02, 200, 0.004), row("rk4", 0.01, 400, 0.0002)]
    sentences = ranking.answer(ranking.rank([*rows, reference()]))
    assert sentences[0].startswith("Cheapest within 1 % DEL error: rk4 20 ms, 200 evaluations")
    assert "fewer than" not in sentences[0]  # a reference's step is anybody's choice
    assert "0.4 % (blade 1 root flapwise, m = 4, 8 m/s)" in sentences[0]
    assert sentences[1].startswith("Cheapest within 0.1 % DEL error: rk4 10 ms")


def corrected(wind, acceptance, trained=(4.2, 11.8)):
    more = {"corrector": "rk4-100ms", "mode": "hybrid", "acceptance_rate": acceptance}
    return row("rk4", 0.1, wind=wind, trained_from=trained[0], trained_to=trained[1], **more)


def test_winds_that_a_corrector_was_not_trained_on_are_counted_with_the_acceptance_there():
    rows = [corrected(11.8, 0.9999), corrected(8.0, 0.9999), corrected(12.5, 0.8), corrected(15.0, 0.62)]
    summaries = ranking.rank([*rows, row(wind=20.0), reference()])
    assert ranking.unseen_winds(summaries) == [
        "rk4-100ms, hybrid: 2 of 4 winds lie outside the 4.2 to 11.8 m/s that rk4-100ms was trained on, between 12.5 and "
        "15 m/s; the hybrid's acceptance rate is 71\u00a0% there, under the others 99.9\u00a0%."
    ]


def test_without_a_guard_or_other_winds_no_acceptance_is_made_up():
    (sentence,) = ranking.unseen_winds(ranking.rank([corrected(13.0, "")]))
    assert "1 of 1 winds lie outside" in sentence and "at 13 m/s; no guard tells" in sentence
    (sentence,) = ranking.unseen_winds(ranking.rank([corrected(13.0, 1.0)]))
    assert sentence.endswith("the hybrid's acceptance rate is 100\u00a0% there.")


def test_a_table_that_does_not_say_what_a_corrector_was_trained_on_counts_nothing():
    assert ranking.unseen_winds(ranking.rank([corrected(13.0, 0.5, ("", ""))])) == []
    assert ranking.unseen_winds(ranking.rank([corrected(5.0, 0.5)])) == []


def test_the_worst_case_decides_and_not_the_mean():
    rows = [row("heun", 0.01, 100, 1e-5, wind=float(w)) for w in range(5, 15)] + [
        row("heun", 0.01, 100, -0.2, wind=15.0)
    ]
    summary = ranking.rank(rows)[0]
    assert summary.worst_del_error.value == -0.2
    assert summary.worst_del_error.wind_speed == 15.0
    assert ranking.cheapest_within([summary], 0.01) is None
    assert (
        "No integrator is within 1 % DEL error; the nearest is heun 10 ms with 20 %"
        in ranking.answer([summary])[0]
    )


def test_a_method_that_diverges_once_is_never_recommended_nor_on_the_front():
    good = [row("rk4", 0.02, 200, 0.004, wind=w) for w in (6.0, 8.0)]
    bad = [row("heun", 0.04, 50, 1e-6, wind=6.0), row("heun", 0.04, 50, 0.0, "diverged", wind=8.0)]
    summaries = ranking.rank([*good, *bad])
    assert {s.method: s.on_front for s in summaries} == {"heun": False, "rk4": True}
    assert ranking.cheapest_within(summaries, 0.01).method == "rk4"
    assert "Not considered: heun 40 ms: 1 of 2 cases diverged." in ranking.answer(summaries)


def test_the_errors_of_a_diverged_case_are_not_counted():
    rows = [row(wind=6.0, error=0.001), row(wind=8.0, error=1e9, status="diverged")]
    assert ranking.rank(rows)[0].worst_del_error.size == 0.001


def test_the_reference_comes_last_and_has_no_error_of_its_own():
    last = ranking.rank([reference(), row()])[-1]
    assert (
        last.is_reference and last.worst_del_error is None and last.nrmse_worst is None and not last.on_front
    )


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ([reference()], "Only the reference was run"),
        ([], "Only the reference was run"),
        ([{**row(), **{k: "" for k in row() if k.startswith("del_error")}}], "no reference was run"),
    ],
)
def test_where_nothing_can_be_compared_the_answer_says_why(rows, words):
    assert words in ranking.answer(ranking.rank(rows))[0]


def test_rows_as_the_csv_module_reads_them_rank_as_the_typed_rows_do():
    rows = [row("heun", 0.01, 200, 0.05), row("rk4", 0.02, 200, 0.004), reference()]
    as_text = [{k: "" if v is None else str(v) for k, v in r.items()} for r in rows]
    assert ranking.rank(as_text) == ranking.rank(rows)


def test_a_corrected_integrator_is_another_integrator_than_the_plain_one():
    rows = [row(), row(corrector="affine", mode="hybrid", evaluations=210.0)]
    assert [s.label for s in ranking.rank(rows)] == ["rk4 20 ms", "rk4 20 ms + affine, hybrid"]


costs = st.integers(1, 5)
errors = st.sampled_from([1e-5, 1e-4, 1e-3, 1e-2, 0.1])


@given(st.lists(st.tuples(costs, errors), min_size=1, max_size=12))
def test_nothing_off_the_front_beats_what_is_on_it_and_everything_off_it_is_beaten(points):
    rows = [row(f"m{i}", 0.01, float(cost), error) for i, (cost, error) in enumerate(points)]
    summaries = ranking.rank(rows)
    front = [s for s in summaries if s.on_front]

    def beats(a, b):
        ea, eb = a.worst_del_error.size, b.worst_del_error.size
        ca, cb = a.evaluations_per_second, b.evaluations_per_second
        return ea <= eb and ca <= cb and (ea < eb or ca < cb)

    assert front
    for s in summaries:
        assert s.on_front != any(beats(other, s) for other in summaries)


@pytest.mark.parametrize(
    ("value", "shown"),
    [(0.0, "0 %"), (0.01, "1 %"), (0.00123, "0.12 %"), (0.5, "50 %"), (12.3, "1230 %"), (2e-7, "2.0e−5 %")],
)
def test_percentages_keep_two_digits(value, shown):
    assert format_percent(value) == shown


def test_counts_are_plain_digits():
    assert [format_count(v) for v in (1.234, 9.96, 200.0, 110000.0)] == ["1.2", "10", "200", "110000"]


def test_an_empty_or_undefined_cell_is_unknown_and_not_zero():
    assert [number({"a": v}, "a") for v in ("", None, "nan", float("inf"), "text", True)] == [None] * 6
    assert number({"a": "1e7"}, "a") == 1e7 and number({}, "a") is None
    assert [truth({"a": v}, "a") for v in (True, "True", "1", False, "", None)] == [True] * 3 + [False] * 3


def test_one_sentence_serves_several_levels_that_one_integrator_wins():
    sentences = ranking.answer(ranking.rank([row("rk4", 0.02, 200, 0.0005), row("rk4", 0.01, 400, 1e-6)]))
    assert len(sentences) == 1
    assert sentences[0].startswith("Cheapest within 1 % and within 0.1 % DEL error: rk4 20 ms")


def test_that_nothing_is_good_enough_is_said_once_at_the_easiest_level():
    sentences = ranking.answer(ranking.rank([row("heun", 0.02, 100, 0.3), row("heun", 0.01, 200, 0.05)]))
    assert sentences == [
        "No integrator is within 1 % DEL error; the nearest is heun 10 ms with 5 % (blade 1 root flapwise, m = 4, 8 m/s)."
    ]


def test_what_a_corrector_saves_is_measured_against_the_cheapest_method_without_one():
    """ "522 times fewer than the reference" measured the reference that one chose."""
    learned = row("etdabm3", 0.1, 10.0, 0.004, corrector="etdabm3-100ms", mode="hybrid")
    rows = [learned, row("rk4", 0.05, 80.0, 0.006), row("rk4", 0.02, 200.0, 1e-5), reference()]
    first, second = ranking.answer(ranking.rank(rows))
    assert (
        "etdabm3-100ms, hybrid, 10 evaluations per simulated second, 8 times fewer than rk4 50 ms without a corrector"
        in first
    )
    assert second.startswith("Cheapest within 0.1 % DEL error: rk4 20 ms") and "fewer" not in second
    (alone,) = [s for s in ranking.answer(ranking.rank([learned, reference()])) if "within 1 %" in s]
    assert "no method without a corrector is as good here" in alone


def test_the_fastest_is_named_where_it_is_not_the_cheapest():
    rows = [
        row("heun", 0.01, 200, 0.004) | {"wall_time": 0.06},
        row("rk4", 0.03, 130, 0.004) | {"wall_time": 0.12},
        reference(),
    ]
    (sentence, _) = ranking.answer(ranking.rank(rows))
    assert "Cheapest within 1 % DEL error: rk4 30 ms" in sentence
    assert "Fastest, as measured here: heun 10 ms, 1000 µs per simulated second against 2000" in sentence
