"""The exponential Adams methods: their textbook form, the isotropic linear part, what they gain, and their learned and guarded steps."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.linalg import expm

from fatigue_runner.corrector import exponential_adams as learned
from fatigue_runner.corrector import find
from fatigue_runner.corrector.artefact import CorrectorError, load, save
from fatigue_runner.errors import InputError
from fatigue_runner.integrators import exponential_adams as adams
from fatigue_runner.integrators import method, simulate_block, stability_limit
from fatigue_runner.integrators.exponential import linear_part
from fatigue_runner.turbine import load_turbine
from fatigue_runner.wind import TurbulentWind


@cache
def turbine():
    return load_turbine("nrel5mw")


def wind(speed=8.0, seed=4, duration=40.0):
    return TurbulentWind(speed, intensity=0.14, seed=9_100_000 + seed, duration=duration)


def start(off=True):
    x = turbine().operating_point(8.0)
    if off:
        x[[0, 2, 5]] += 0.05, 0.3, 0.02
    return x


def weight(a, h, nodes, j):
    """Integral of exp((1 - t) h A) l_j(t) over the step by Gauss's rule, l_j being Lagrange's polynomial: no phi functions."""
    points, weights = np.polynomial.legendre.leggauss(20)
    total = np.zeros_like(a)
    for t, w in zip((points + 1) / 2, weights / 2, strict=True):
        others = [n for i, n in enumerate(nodes) if i != j]
        total += w * h * expm((1 - t) * h * a) * np.prod([(t - n) / (nodes[j] - n) for n in others])
    return total


@pytest.mark.parametrize("name", ["etdabm3", "etdabm4"])
def test_the_compiled_loop_is_the_textbook_predictor_and_corrector(name):
    h, steps, blowing, x = 0.05, 7, wind(), start()
    found = method(name)
    compiled = simulate_block(turbine(), name, h, [blowing], x[None], steps * h)[0]
    a = adams.linear(turbine(), 0.0).isotropic

    def f(t, y):
        return turbine().rhs(y, *blowing.at(np.array([t]))[0])

    def rk4(t, y, d):
        k1 = f(t, y)
        k2 = f(t + d / 2, y + d / 2 * k1)
        k3 = f(t + d / 2, y + d / 2 * k2)
        return y + d / 6 * (k1 + 2 * k2 + 2 * k3 + f(t + d, y + d * k3))

    before = [-i for i in range(found.predictor)]
    after = [1, *(-i for i in range(found.past))]
    ahead = [weight(a, h, before, j) for j in range(len(before))]
    back = [weight(a, h, after, j) for j in range(len(after))]
    places, slopes = [x], [f(0.0, x)]
    for n in range(steps):
        t = n * h
        if n < found.past - 1:
            for i in range(8):
                x = rk4(t + i * h / 8, x, h / 8)
            places.insert(0, x)
        else:
            g = [s - a @ (y - x) for s, y in zip(slopes, places, strict=True)]
            predicted = x + sum(w @ v for w, v in zip(ahead, g, strict=False))
            new = f(t + h, predicted) - a @ (predicted - x)
            x = x + sum(w @ v for w, v in zip(back, [new, *g], strict=False))
            places.insert(0, predicted)
        slopes.insert(0, f(t + h, places[0]))
        assert np.abs(compiled.state[n + 1] - x).max() < 1e-9 * np.abs(x).max()


def test_the_linear_part_commutes_with_a_turn_of_the_blades_by_any_angle():
    a = adams.linear(turbine(), 0.0).isotropic
    for angle in (0.3, 1.7, 4.0):
        c, s = np.cos(angle), np.sin(angle)
        turn = np.eye(16)
        for i in (3, 11):
            turn[i : i + 2, i : i + 2] = [[c, -s], [s, c]]
        turn = np.linalg.inv(adams.T_STATE) @ turn @ adams.T_STATE
        assert np.abs(turn @ a - a @ turn).max() < 1e-9 * np.abs(a).max()


def test_the_isotropic_part_is_what_the_average_over_the_azimuth_already_was():
    averaged, a = linear_part(turbine(), 0.0), adams.linear(turbine(), 0.0).isotropic
    assert np.abs(averaged - a).max() < 1e-3 * np.abs(averaged).max()


def test_damping_moves_the_generator_s_own_entry_only():
    plain, damped = (adams.linear(turbine(), 0.0, d).isotropic for d in (0.0, 1.5))
    assert np.argwhere(np.abs(plain - damped) > 1e-9).tolist() == [[15, 15]]
    assert plain[15, 15] - damped[15, 15] == pytest.approx(1.5)


def runs(name, step, corrector=None, mode="enhanced", duration=40.0):
    blowing = [wind(v, i, duration) for i, v in enumerate((5.5, 7.0, 8.5, 9.5))]
    x = np.array([turbine().operating_point(w.mean_speed) for w in blowing])
    return simulate_block(
        turbine(), name, step, blowing, x, duration - 1, 0.6, corrector=corrector, mode=mode
    )


@cache
def truth():
    return runs("dop853", 0.02)


def error(found) -> float:
    out = []
    for run, true in zip(found, truth(), strict=True):
        assert run.diverged_at is None
        away = np.sqrt(((run.state - true.state) ** 2).mean(axis=0))
        out.append(float((away / np.ptp(true.state, axis=0)).max()))
    return float(np.median(out))


def test_twenty_evaluations_a_second_are_better_spent_here_than_in_the_exponential_runge_kutta_method():
    assert error(runs("etdabm4", 0.05)) < error(runs("etdrk4", 0.2)) / 10


# --- the learned part ---------------------------------------------------------------------------------------------


@cache
def shipped(name="etdabm3-100ms"):
    return find(name)


def test_compiled_steps_are_what_the_matrices_of_the_artefact_say():
    corrector, blowing, h = shipped(), wind(), 0.1
    past = corrector.past
    compiled = simulate_block(turbine(), "etdabm3", h, [blowing], start()[None], 8 * h, corrector=corrector)[
        0
    ]
    base_ahead, base = adams.matrices(turbine(), method("etdabm3"), h, 0.0, past, corrector.damping)
    ahead, rest, _ = corrector.matrices()
    whole = rest.copy()
    whole[:, : base.shape[1]] += base

    def part(x, t):
        return learned.nonlinear_part(turbine(), x[None], blowing.at(np.array([t])), corrector.damping)

    first = past - 1
    parts = [part(compiled.state[i], i * h) for i in range(first, -1, -1)]
    x = compiled.state[first]
    for n in range(first, 8):
        turn = np.cos(x[6:7]), np.sin(x[6:7])
        blown = blowing.at(np.array([n, n + 0.5, n + 1]) * h)[None]
        seen = learned.rows(turbine(), x[None], blown, parts[:past], turn)
        predicted = x + learned.from_fixed(seen @ (base_ahead + ahead).T, turn)[0]
        parts.insert(0, part(predicted, (n + 1) * h))
        full = np.concatenate([seen, learned.parts_to_fixed(parts[0], turn)], axis=1)
        x = x + learned.from_fixed(learned.multiplied(full, corrector.factors) @ whole.T, turn)[0]
        assert np.abs(compiled.state[n + 1] - x).max() < 1e-9 * np.abs(x).max()


@pytest.mark.parametrize("name", ["etdabm3-150ms", "etdabm3-125ms", "etdabm3-100ms", "etdabm3-75ms"])
def test_the_learned_part_takes_most_of_the_error_off_on_unseen_winds(name):
    corrector = shipped(name)
    found = [error(runs("etdabm3", corrector.step, corrector, mode)) for mode in ("enhanced", "hybrid")]
    try:
        plain = error(runs("etdabm3", corrector.step))
    except AssertionError:
        plain = np.inf  # diverged
    assert max(found) < plain / 1.2


def wrong(seed: int):
    """A corrector whose matrices were replaced by noise of a thousand times their size."""
    rng = np.random.Generator(np.random.PCG64(seed))
    good = shipped()
    assert good.linear is not None and good.predictor is not None
    noise = [1e3 * np.abs(w).mean() * rng.standard_normal(w.shape) for w in (good.predictor, good.linear)]
    return replace(good, predictor=noise[0], linear=noise[1])


def test_a_wrong_predictor_and_corrector_leave_the_hybrid_as_good_as_its_fallback():
    zero = replace(shipped(), predictor=shipped().predictor * 0, linear=shipped().linear * 0)
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


# --- the artefact -------------------------------------------------------------------------------------------------


def test_both_matrices_survive_the_file(tmp_path):
    good = shipped()
    save(good, tmp_path / "x.safetensors")
    again = load(tmp_path / "x.safetensors")
    assert np.array_equal(again.predictor, good.predictor) and np.array_equal(again.linear, good.linear)
    assert (again.damping, again.ahead_atol, again.past) == (3.0, good.ahead_atol, 3)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"predictor": None}, "its predictor is missing"),
        ({"predictor": np.zeros((16, 5))}, "do not fit etdabm3's features"),
        ({"linear": np.full((16, 114), np.nan)}, "not a finite number"),
        ({"damping": -1.0}, "damping must be a number"),
        ({"ahead_atol": (1.0,) * 15}, "16 positive numbers"),
        ({"method": "rk4"}, "do not exist for rk4"),
        ({"factors": ("sin_azimuth",)}, "does not exist for exponential methods"),
        ({"history": 9}, "look back 4 steps at most"),
    ],
)
def test_a_damaged_artefact_is_refused_with_what_is_wrong(change, message):
    with pytest.raises((CorrectorError, InputError), match=message):
        replace(shipped(), **change)


def test_the_stability_limit_knows_the_steep_region_of_the_torque_law():
    """At 8 m/s the motion is all linear and any step is stable; where the generator reaches region 2.5 it is not (seen in turbulence)."""
    assert stability_limit(turbine(), "etdabm3", 8.0) > 0.5
    assert 0.1 < stability_limit(turbine(), "etdabm3") < 0.15
