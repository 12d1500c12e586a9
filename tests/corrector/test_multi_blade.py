"""The learned part of exponential Adams methods: compiled steps, what they gain, their guard and their artefact."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from adams_example import error, runs, start, turbine, wind
from corrector_example import with_map
from simulating import simulate_block

from fatigue_runner.corrector import CorrectorError, coordinates, features, find, load, save, steps
from fatigue_runner.errors import InputError
from fatigue_runner.integrators import method, multi_blade


@cache
def shipped(name="etdabm3-100ms"):
    return find(name)


def test_compiled_steps_are_what_the_matrices_of_the_artefact_say():
    corrector, blowing, h = shipped(), wind(harmonics=6), 0.1
    past = corrector.past
    compiled = simulate_block(turbine(), "etdabm3", h, [blowing], start()[None], 8 * h, corrector=corrector)[
        0
    ]
    base_ahead, base = method("etdabm3").matrices(turbine(), h, 0.0, past, corrector.damping, harmonics=True)
    layout = turbine().layout
    size, factors = corrector.binding.size, features.multi_blade_factor_rows(layout, corrector.map.factors)
    ahead, whole = corrector.map.predictor * size, corrector.map.linear * size
    whole[:, : base.shape[1]] += base

    def blown(times):
        return coordinates.blown(turbine(), blowing, np.atleast_1d(times))

    def part(x, t):
        return coordinates.nonlinear_part(turbine(), x[None], blown(t), corrector.damping)

    first = past - 1
    parts = [part(compiled.state[i], i * h) for i in range(first, -1, -1)]
    x = compiled.state[first]
    for n in range(first, 8):
        turn = np.cos(x[6:7]), np.sin(x[6:7])
        seen = steps.rows(
            turbine(), x[None], blown(np.array([n, n + 0.5, n + 1]) * h)[None], parts[:past], turn, h
        )
        predicted = x + coordinates.from_fixed(layout, seen @ (base_ahead + ahead).T, turn)[0]
        parts.insert(0, part(predicted, (n + 1) * h))
        full = np.concatenate([seen, coordinates.parts_to_fixed(layout, parts[0], turn)], axis=1)
        full = np.concatenate([full, *(full * full[:, [i]] for i in factors)], axis=1)
        x = x + coordinates.from_fixed(layout, full @ whole.T, turn)[0]
        assert np.abs(compiled.state[n + 1] - x).max() < 1e-9 * np.abs(x).max()


def test_a_wind_without_harmonics_meets_the_map_without_their_columns():
    corrector = shipped()
    layout, bare = corrector.map.layout, corrector.map.layout.extended(harmonics=False)
    gone = np.arange(multi_blade.harmonic_row(layout), multi_blade.past_row(layout))
    rows = multi_blade.base_rows(layout, corrector.past)
    less = with_map(
        corrector, layout=bare, predictor=np.delete(corrector.map.predictor, gone, axis=1),
        linear=np.delete(corrector.map.linear, [*gone, *(gone + rows)], axis=1),
    )  # fmt: skip
    found = [
        simulate_block(turbine(), "etdabm3", 0.1, [wind()], start()[None], 4.0, corrector=c)[0].state
        for c in (corrector, less)
    ]
    assert np.array_equal(*found)


@pytest.mark.parametrize(
    ("name", "harmonics"),
    [
        ("etdabm3-150ms", 6),
        ("etdabm3-125ms", 6),
        ("etdabm3-125ms", 1),
        ("etdabm3-100ms", 1),
        ("etdabm3-75ms", 1),
    ],
)
def test_the_learned_part_takes_most_of_the_error_off_on_unseen_winds(name, harmonics):
    corrector = shipped(name)
    found = [
        error(runs("etdabm3", corrector.step, corrector, mode, harmonics=harmonics), harmonics)
        for mode in ("enhanced", "hybrid")
    ]
    try:
        plain = error(runs("etdabm3", corrector.step, harmonics=harmonics), harmonics)
    except AssertionError:
        plain = np.inf  # diverged
    assert max(found) < plain / 1.2


def wrong(seed: int):
    """A corrector whose matrices were replaced by noise of a thousand times their size."""
    rng = np.random.Generator(np.random.PCG64(seed))
    good = shipped().map
    noise = [1e3 * np.abs(w).mean() * rng.standard_normal(w.shape) for w in (good.predictor, good.linear)]
    return with_map(shipped(), predictor=noise[0], linear=noise[1])


def test_a_wrong_predictor_and_corrector_leave_the_hybrid_as_good_as_its_fallback():
    zero = with_map(shipped(), predictor=shipped().map.predictor * 0, linear=shipped().map.linear * 0)
    fallback = error(runs("etdabm3", 0.1, zero))
    found = runs("etdabm3", 0.1, wrong(1), "hybrid")
    assert error(found) < 1.05 * fallback
    assert all(run.accepted.mean() < 0.2 for run in found)
    enhanced = runs("etdabm3", 0.1, wrong(1))
    assert any(run.diverged_at is not None for run in enhanced) or error(enhanced) > 10 * fallback


def test_a_guarded_step_ends_within_the_limit_of_its_fallback_or_on_it():
    good = shipped()
    for run in runs("etdabm3", 0.1, good, "hybrid"):
        assert run.accepted.mean() > 0.98
        assert np.array_equal(run.accepted, run.discrepancy <= good.guard.limit)


def test_evaluations_count_the_longer_start_of_a_corrector_that_looks_back_further():
    def count(steps, corrector=None):
        x = start(off=False)[None]
        return simulate_block(turbine(), "etdabm3", 0.1, [wind()], x, 0.1 * steps, corrector=corrector)[
            0
        ].evaluations

    # RK4 in eight sub-steps until there are two, with the corrector three, values
    assert [count(n) for n in (1, 2, 5)] == [1 + 32 + 1, 1 + 32 + 2, 1 + 32 + 5]
    assert [count(n, shipped()) for n in (1, 2, 5)] == [1 + 32 + 1, 1 + 64 + 2, 1 + 64 + 5]


def test_both_matrices_survive_the_file(tmp_path):
    good = shipped()
    save(good, tmp_path / "x.safetensors")
    again = load(tmp_path / "x.safetensors")
    assert np.array_equal(again.map.predictor, good.map.predictor)
    assert np.array_equal(again.map.linear, good.map.linear)
    assert (again.damping, again.guard, again.past) == (3.0, good.guard, 3)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"predictor": np.zeros((16, 5))}, "do not fit etdabm3's features"),
        ({"linear": np.full((16, 132), np.nan)}, "not a finite number"),
        ({"damping": -1.0}, "damping must be a number"),
        ({"factors": ("sin_azimuth",)}, "does not exist for exponential methods"),
        ({"history": 9}, "looks back 4 steps at most"),
    ],
)
def test_a_damaged_map_is_refused_with_what_is_wrong(change, message):
    with pytest.raises((CorrectorError, InputError), match=message):
        with_map(shipped(), **change)


def test_a_guard_without_units_for_the_predictor_and_another_method_are_refused():
    good = shipped()
    with pytest.raises(CorrectorError, match="ahead_atol needs a number for each of 16 states"):
        replace(good, guard=replace(good.guard, ahead_atol=(1.0,) * 15))
    with pytest.raises(CorrectorError, match="'multi-blade' do not exist for rk4"):
        replace(good, binding=replace(good.binding, method="rk4"))
