"""Order of every method: the exact order conditions, and the observed one on a problem that is not linear and not autonomous."""

from __future__ import annotations

from collections import Counter
from fractions import Fraction
from functools import cache
from math import factorial, prod

import numpy as np
import pytest

from fatigue_runner.integrators import METHODS, method
from fatigue_runner.integrators.adams import LinearMultistep
from fatigue_runner.integrators.butcher import ButcherTableau

TABLEAUX = [name for name in METHODS if isinstance(method(name), ButcherTableau)]
ADAMS = [name for name in METHODS if isinstance(method(name), LinearMultistep)]
EMBEDDED = [name for name in TABLEAUX if method(name).b_hat is not None]

Tree = tuple  # a rooted tree is the sorted tuple of its root's subtrees

# OEIS A000081, rooted trees with n nodes: what the generator below must give
NUMBER_OF_TREES = (1, 1, 2, 4, 9, 20, 48, 115)


@cache
def size(tree: Tree) -> int:
    return 1 + sum(size(child) for child in tree)


@cache
def density(tree: Tree) -> int:
    """gamma(t), Hairer, Norsett & Wanner (2008), II.2, definition 2.10."""
    return size(tree) * prod(density(child) for child in tree)


@cache
def trees(nodes: int) -> list[Tree]:
    """All rooted trees: each of nodes - 1 with one more leaf at any place."""
    if nodes == 1:
        return [()]
    return sorted({grown for tree in trees(nodes - 1) for grown in _with_leaf(tree)}, key=repr)


def _with_leaf(tree: Tree) -> set[Tree]:
    grown = {tuple(sorted((*tree, ()), key=repr))}
    for i, child in enumerate(tree):
        grown |= {tuple(sorted((*tree[:i], g, *tree[i + 1 :]), key=repr)) for g in _with_leaf(child)}
    return grown


def defect(tableau: ButcherTableau, weights, tree: Tree):
    """sum_i b_i Phi_i(t) - 1 / gamma(t): zero for all trees up to the order."""
    exact = all(isinstance(x, Fraction) for row in (*tableau.A, weights) for x in row)
    rows = [(), *tableau.A]

    @cache
    def elementary(t: Tree) -> list:
        inner = [elementary(child) for child in t]
        return [
            prod((sum(a * u[j] for j, a in enumerate(row)) for u in inner), start=Fraction(1)) for row in rows
        ]

    value = sum(b * phi for b, phi in zip(weights, elementary(tree), strict=True))
    return value - Fraction(1, density(tree)) if exact else float(value) - 1 / density(tree)


@pytest.mark.parametrize("nodes", range(1, 9))
def test_the_generator_gives_every_rooted_tree_once(nodes):
    assert len(trees(nodes)) == NUMBER_OF_TREES[nodes - 1]
    assert all(size(tree) == nodes for tree in trees(nodes))


def test_densities_are_those_of_the_tall_and_the_bushy_tree():
    tall, bushy = (((((),),),),), ((), (), (), ())
    assert density(tall) == factorial(size(tall))
    assert density(bushy) == 5


@pytest.mark.parametrize("name", TABLEAUX)
def test_order_conditions_hold_for_every_tree_up_to_the_order(name):
    tableau = method(name)
    for nodes in range(1, tableau.order + 1):
        for tree in trees(nodes):
            left = defect(tableau, tableau.b, tree)
            # coefficients given as decimals hold to their last digits only
            assert left == 0 if isinstance(left, Fraction) else abs(left) < 2e-14, tree


@pytest.mark.parametrize("name", TABLEAUX)
def test_the_order_is_not_higher_than_stated(name):
    tableau = method(name)
    nodes = tableau.order + 1
    assert max(abs(defect(tableau, tableau.b, tree)) for tree in trees(nodes)) > 1e-9


@pytest.mark.parametrize("name", EMBEDDED)
def test_the_embedded_weights_have_exactly_their_order(name):
    tableau = method(name)
    for nodes in range(1, tableau.embedded_order + 1):
        for tree in trees(nodes):
            assert abs(defect(tableau, tableau.b_hat, tree)) < 1e-14, tree
    next_trees = trees(tableau.embedded_order + 1)
    assert max(abs(defect(tableau, tableau.b_hat, tree)) for tree in next_trees) > 1e-9


@pytest.mark.parametrize("name", ADAMS)
def test_adams_weights_integrate_polynomials_up_to_their_degree_exactly(name):
    adams = method(name)
    for degree in range(adams.order + 1):
        # the integral of s^degree from 0 to 1, slopes being taken at s = 0, -1, -2, -3 (predictor) and 1, 0, -1, -2 (corrector)
        exact = Fraction(1, degree + 1)
        for first, weights in ((0, adams.predictor), (1, adams.corrector)):
            if weights is None:
                continue
            value = sum(b * Fraction(first - i) ** degree for i, b in enumerate(weights))
            assert (value == exact) == (degree < adams.order)


# --- observed order ------------------------------------------------------------------------------------------------


def slope(t: float, x: np.ndarray) -> np.ndarray:
    """x' = x^2 y cos t, y' = -x y^2 sin 2t ... : neither linear nor autonomous; the exact solution is not needed."""
    return np.array(
        [x[0] * x[1] * np.cos(t) - 0.5 * x[0] ** 2, np.sin(2 * t) - x[0] * x[1], x[1] - x[2] ** 3]
    )


def runge_kutta_step(tableau: ButcherTableau, t: float, x: np.ndarray, h: float) -> np.ndarray:
    """Straight from the definition; what the compiled loop must agree with."""
    a, b, _, c = tableau.arrays()
    k = []
    for i in range(tableau.stages):
        k.append(slope(t + c[i] * h, x + h * sum((a[i, j] * k[j] for j in range(i)), np.zeros_like(x))))
    return x + h * sum(bi * ki for bi, ki in zip(b, k, strict=True))


def solve(name: str, steps: int, duration: float) -> np.ndarray:
    found, h = method(name), duration / steps
    x, history = np.array([1.0, 0.5, 0.3]), []
    for n in range(steps):
        t = n * h
        if isinstance(found, ButcherTableau):
            x = runge_kutta_step(found, t, x, h)
            continue
        history.insert(0, slope(t, x))
        if n < 3:
            x = runge_kutta_step(found.start, t, x, h)
            continue
        predicted = x + h * sum(float(b) * f for b, f in zip(found.predictor, history, strict=False))
        if found.corrector is not None:
            slopes = [slope(t + h, predicted), *history]
            predicted = x + h * sum(float(b) * f for b, f in zip(found.corrector, slopes, strict=False))
        x = predicted
    return x


@cache
def exact(duration: float) -> np.ndarray:
    return solve("dop853", 1500, duration)


def test_the_exact_solution_is_that_of_another_method():
    assert solve("rk7", 500, 2.0) == pytest.approx(exact(2.0), abs=1e-14)


# Steps where the error lies between the first term's regime and rounding.
STEPS = {
    1: (400, 800, 1600),
    2: (100, 200, 400),
    3: (100, 200, 400),
    4: (100, 200, 400),
    5: (80, 112, 160),
    7: (28, 32, 40),
    8: (14, 16, 20),
}


def fitted_order(steps, errors) -> float:
    return -float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


@pytest.mark.parametrize("name", TABLEAUX + ADAMS)
def test_observed_order_on_a_nonlinear_and_non_autonomous_problem(name):
    steps = STEPS[method(name).order]
    duration = 4.0 if method(name).order == 7 else 2.0
    errors = [np.linalg.norm(solve(name, n, duration) - exact(duration)) for n in steps]
    assert min(errors) > 3e-14  # else it is rounding that is fitted
    assert fitted_order(steps, errors) == pytest.approx(method(name).order, abs=0.15)


def test_the_registry_names_each_method_once_and_by_its_own_name():
    assert [method(name).name for name in METHODS] == list(METHODS)
    assert max(Counter(METHODS).values()) == 1
