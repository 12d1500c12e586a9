"""A ladder of corrected steps: what the guard of one refuses is made in smaller ones, lane by lane."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from corrector_example import trained
from operation_example import SPEEDS, error, runs, shipped, turbine, wind
from simulating import simulate_block

from fatigue_runner.corrector import CorrectorError, find, load, save
from fatigue_runner.corrector.recipe import Progress
from fatigue_runner.corrector.train import read_recipe
from fatigue_runner.errors import InputError
from fatigue_runner.integrators.initial import initial_state

STEPS = 600  # of 0.1 s in a run


@cache
def ladder(top=1.0, below=1.0):
    """The shipped one, its guards' limits times these."""
    found = find("etdabm3-100ms-operation-ladder")
    rungs = tuple(with_limit(rung, below) for rung in found.rungs)
    return replace(with_limit(found, top), rungs=rungs)


def with_limit(corrector, factor):
    return replace(corrector, guard=replace(corrector.guard, limit=corrector.guard.limit * factor))


def hybrid(corrector):
    return runs("etdabm3", corrector.step, "hybrid", corrector=corrector)


def test_half_steps_where_the_guard_refuses_whole_ones_are_nearer_for_little_more():
    single, own = hybrid(shipped()), hybrid(ladder())
    assert (error(own) < 1.05 * error(single)).all()
    at_rated = SPEEDS.index(12.0)
    assert error(own)[at_rated] < 0.8 * error(single)[at_rated]
    assert all(run.evaluations < 1.5 * other.evaluations for run, other in zip(own, single, strict=True))
    assert 0.9 < own[at_rated].accepted.mean() < 1.0


def test_a_run_that_is_made_of_half_steps_alone_errs_as_one_that_knows_no_others():
    """Their earlier parts are evaluated between step ends, each step anew, and are as good as if they had been steps of their own."""
    [rung] = ladder().rungs
    alone = replace(with_limit(rung, np.inf), name="half")
    made, plain = hybrid(ladder(0.0, np.inf)), hybrid(alone)
    assert not any(run.accepted[10:].any() for run in made)
    ratio = error(made) / error(plain)
    assert (ratio < 1.5).all() and (ratio > 0.6).all()
    # the first slope, two steps of 8 RK4 steps; then the step that is refused, an earlier part between two step ends, two half steps
    assert {run.evaluations for run in made} == {1 + 2 * (4 * 8) + STEPS + (STEPS - 2) * 3}


def test_what_every_rung_refuses_is_made_by_rk4_as_without_a_ladder():
    both, none = hybrid(ladder(0.0, 0.0)), hybrid(replace(ladder(0.0), rungs=()))
    for run, other in zip(both, none, strict=True):
        assert np.array_equal(run.state, other.state)
        assert run.evaluations > other.evaluations  # rungs that were tried in vain


def test_a_case_does_not_depend_on_whether_its_neighbours_come_down():
    together = hybrid(ladder(0.5))
    for number in (0, 2):
        blowing = wind(SPEEDS[number])
        start = initial_state(turbine(), "operating-point", blowing)[None]
        [alone] = simulate_block(
            turbine(), "etdabm3", 0.1, [blowing], start, 60.0, 0.1, corrector=ladder(0.5), mode="hybrid"
        )
        for field in ("state", "accepted", "discrepancy", "local_error"):
            assert np.array_equal(getattr(alone, field), getattr(together[number], field)), field
        assert alone.evaluations == together[number].evaluations


def test_a_lane_that_diverges_leaves_the_others_as_they_are():
    start = np.array([initial_state(turbine(), "operating-point", wind(v)) for v in (8.0, 12.0)])
    wild = start.copy()
    wild[0, turbine().layout.generator_speed] = 1e9
    winds = [wind(8.0), wind(12.0)]
    given = {"corrector": ladder(0.5), "mode": "hybrid"}
    fine = simulate_block(turbine(), "etdabm3", 0.1, winds, start, 20.0, 0.1, **given)
    lost = simulate_block(turbine(), "etdabm3", 0.1, winds, wild, 20.0, 0.1, **given)
    assert lost[0].diverged_at is not None and lost[1].diverged_at is None
    assert np.array_equal(lost[1].state, fine[1].state)


def test_a_ladder_survives_its_file(tmp_path):
    save(ladder(), tmp_path / "x.safetensors")
    again = load(tmp_path / "x.safetensors")
    [rung], [own] = again.rungs, ladder().rungs
    assert (rung.step, rung.guard, rung.name) == (0.05, own.guard, own.name)
    assert np.array_equal(rung.map.linear, own.map.linear) and np.array_equal(
        rung.map.predictor, own.map.predictor
    )
    assert np.array_equal(again.map.linear, ladder().map.linear) and again.guard == ladder().guard


def with_rungs_of_its_own():
    [half] = ladder().rungs
    return replace(half, rungs=(replace(half, binding=replace(half.binding, step=0.025)),))


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda: replace(ladder(), rungs=(shipped(),)), "rung at 100 ms must be at 50 ms"),
        (lambda: replace(ladder(), rungs=(ladder().rungs[0], ladder().rungs[0])), "at 50 ms must be at 25 ms"),
        (lambda: replace(ladder(), rungs=(with_rungs_of_its_own(),)), "rungs of its own"),
        (lambda: replace(trained(), rungs=(trained(),)), "only exponential Adams methods"),
        (
            lambda: replace(find("etdabm3-100ms"), rungs=ladder().rungs),
            "rung at 50 ms is for another turbine",
        ),
    ],
)  # fmt: skip
def test_rungs_that_do_not_fit_are_refused(made, words):
    with pytest.raises(CorrectorError, match=words):
        made()


def small_recipe(**changed):
    winds = {
        "type": "turbulent",
        "speeds": [7.0, 8.0, 9.0],
        "intensity": [0.1, 0.1],
        "shear_exponent": [0.2, 0.2],
        "duration": 20,
    }
    return {
        "name": "small", "family": "affine", "method": "etdabm3", "step": 0.1, "history": 3, "samples": 60,
        "training": {**winds, "seed": 1}, "validation": {**winds, "seed": 2},
        "guard": {"kappa": 3, "quantile": 0.99}, **changed,
    }  # fmt: skip


def test_a_recipe_trains_every_rung_with_the_strict_guard_above_the_lowest():
    recipe, _ = read_recipe(small_recipe(ladder={"halvings": 2, "kappa": 1.5}))
    learned = recipe.train(recipe.load_turbine(), Progress())
    assert [rung.step for rung in learned.rungs] == [0.05, 0.025]
    assert [learned.guard.kappa, *(rung.guard.kappa for rung in learned.rungs)] == [1.5, 1.5, 3.0]
    finest = learned.rungs[-1].guard.substeps
    assert [learned.guard.substeps, learned.rungs[0].guard.substeps] == [4 * finest, 2 * finest]


def test_halvings_are_bounded_and_a_runge_kutta_recipe_has_none():
    with pytest.raises(InputError, match=r"ladder\.halvings must be at most 4"):
        read_recipe(small_recipe(ladder={"halvings": 9}))
    with pytest.raises(InputError, match="ladder"):
        read_recipe(small_recipe(method="rk4", ladder={"halvings": 1}))
