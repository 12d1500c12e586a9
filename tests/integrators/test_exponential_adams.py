"""The exponential Adams methods: their textbook form, the isotropic linear part, and what they gain."""

from __future__ import annotations

import numpy as np
import pytest
from adams_example import error, runs, start, turbine, wind
from scipy.linalg import expm
from simulating import simulate_block

from fatigue_runner.integrators import method, multi_blade, stability_limit
from fatigue_runner.integrators.linear_part import linear_part
from fatigue_runner.layout import T2B1I1CG

TURN = multi_blade.transforms(T2B1I1CG)


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
    a = multi_blade.linear(turbine(), 0.0).isotropic

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
    a = multi_blade.linear(turbine(), 0.0).isotropic
    for angle in (0.3, 1.7, 4.0):
        c, s = np.cos(angle), np.sin(angle)
        turn = np.eye(16)
        for i in (3, 11):
            turn[i : i + 2, i : i + 2] = [[c, -s], [s, c]]
        turn = np.linalg.inv(TURN.state) @ turn @ TURN.state
        assert np.abs(turn @ a - a @ turn).max() < 1e-9 * np.abs(a).max()


def test_the_isotropic_part_is_what_the_average_over_the_azimuth_already_was():
    averaged, a = linear_part(turbine(), 0.0), multi_blade.linear(turbine(), 0.0).isotropic
    assert np.abs(averaged - a).max() < 1e-3 * np.abs(averaged).max()


def test_damping_moves_the_generator_s_own_entry_only():
    plain, damped = (multi_blade.linear(turbine(), 0.0, d).isotropic for d in (0.0, 1.5))
    assert np.argwhere(np.abs(plain - damped) > 1e-9).tolist() == [[15, 15]]
    assert plain[15, 15] - damped[15, 15] == pytest.approx(1.5)


def test_twenty_evaluations_a_second_are_better_spent_here_than_in_the_exponential_runge_kutta_method():
    assert error(runs("etdabm4", 0.05)) < error(runs("etdrk4", 0.2)) / 10


def test_the_stability_limit_knows_the_steep_region_of_the_torque_law():
    """At 8 m/s the motion is all linear and any step is stable; where the generator reaches region 2.5 it is not (seen in turbulence)."""
    assert stability_limit(turbine(), "etdabm3", 8.0) > 0.5
    assert 0.1 < stability_limit(turbine(), "etdabm3") < 0.15
