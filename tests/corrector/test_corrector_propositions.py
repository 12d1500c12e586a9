"""The two propositions of arXiv:2504.05493 as numbers: the bound of the global error, and the modified equation.

With eta_h(x) = flow_h(x) + h^(p+1) delta(x) + O(h^(p+2)) the enhanced method makes flow_h + h^(p+1) (delta + N). If that last part
is at most h^(p+1) e in size and f has the Lipschitz constant L, the global error at T is at most h^p e (exp(L T) - 1) / L.
"""

from __future__ import annotations

import numpy as np
import pytest
from simulating import simulate_block

P = 2  # Heun


def heun(f, x, h):
    k = f(x)
    return x + h / 2 * (k + f(x + h * k))


def flow(f, x, time, steps=200):
    """Classical RK4 in many steps: exact to 1e-12 here."""
    h = time / steps
    for _ in range(steps):
        a = f(x)
        b = f(x + h / 2 * a)
        c = f(x + h / 2 * b)
        d = f(x + h * c)
        x = x + h / 6 * (a + 2 * b + 2 * c + d)
    return x


def enhanced(f, network, x, h, steps):
    for _ in range(steps):
        x = heun(f, x, h) + h ** (P + 1) * network(x, h)
    return x


def imperfect(f, away):
    """A network that misses the defect by `away`(x)."""
    return lambda x, h: (flow(f, x, h, 4) - heun(f, x, h)) / h ** (P + 1) + away(x)


@pytest.mark.parametrize("h", [0.2, 0.1, 0.05])
@pytest.mark.parametrize("e", [1e-3, 1e-1])
@pytest.mark.parametrize("x0", [-2.0, 0.3, 1.5])
def test_the_global_error_stays_below_the_bound_where_its_constants_are_known(h, e, x0):
    """f = sin has L = 1, and the network's error is at most e."""
    time = 2.0
    got = enhanced(np.sin, imperfect(np.sin, lambda x: e * np.cos(5 * x)), x0, h, round(time / h))
    bound = h**P * e * (np.exp(time) - 1)
    assert abs(got - flow(np.sin, x0, time)) <= bound


def test_the_bound_is_sharp_where_errors_grow_as_fast_as_they_can():
    """x' = x and a network that is always off by e in the same direction: all of the bound but O(h) is used."""
    h, e, time = 0.01, 1e-2, 2.0
    got = enhanced(lambda x: x, imperfect(lambda x: x, lambda x: e), 1.0, h, round(time / h))
    assert (got - np.exp(time)) / (h**P * e * (np.exp(time) - 1)) == pytest.approx(1.0, abs=0.01)


def test_on_the_turbine_the_bound_holds_and_says_nothing_beyond_a_second():
    """With measured constants, in the coordinates of the modes, where L is smallest: the shaft's 24 rad/s."""
    from corrector_example import trained, training_samples, turbine

    from fatigue_runner.wind import ConstantWind

    corrector, found, h = trained(), training_samples(), 0.02
    x0 = turbine().operating_point(7.4)
    delta = np.where(np.arange(16) % 8 == 6, 1e-6, 1e-4)
    shifts = np.concatenate([np.diag(delta), -np.diag(delta)], axis=1)
    slopes = turbine().rhs(x0[:, None] + shifts, 7.4)
    values, modes = np.linalg.eig((slopes[:, :16] - slopes[:, 16:]) / (2 * delta))
    lipschitz = np.abs(values).max()
    size = np.linalg.norm(
        np.linalg.solve(modes, (corrector.predict(found) - found.defect).T), axis=0
    ).max() / h ** (P + 1)
    wind = [ConstantWind(7.4, 0.1, 0.02)]

    def bound_and_error(time):
        got = simulate_block(turbine(), "heun", h, wind, x0[None], time, corrector=corrector)[0].state[-1]
        true = simulate_block(turbine(), "rk4", 0.001, wind, x0[None], time, time)[0].state[-1]
        bound = h**P * size * (np.exp(lipschitz * time) - 1) / lipschitz
        return bound, np.linalg.norm(np.linalg.solve(modes, got - true))

    assert 20 < lipschitz < 30
    for time in (0.02, 0.1, 0.5):
        bound, error = bound_and_error(time)
        assert error <= bound
    # the errors of modes that swing and die out do not grow as exp(L T), so the bound soon tells nothing
    bound, error = bound_and_error(1.0)
    assert bound > 1e6 * error


def slope(errors, steps) -> float:
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


def delta(x):
    """Heun's local error on x' = sin x: f'' f^2 / 12 - f'^2 f / 6."""
    return -(np.sin(x) ** 3) / 12 - np.cos(x) ** 2 * np.sin(x) / 6


@pytest.mark.parametrize(
    "network",
    [lambda x: np.tanh(2 * x - 1), lambda x: max(x - 1.0, 0.0)],
    ids=["smooth network", "ReLU network"],
)
def test_the_modified_equation_has_h_to_the_p_not_to_the_p_plus_1(network):
    """The enhanced solution follows x' = f + h^p (delta + N) to O(h^(p+1)); with h^(p+1), as printed, only to O(h^p)."""
    steps, time, x0 = np.array([0.1, 0.05, 0.025, 0.0125]), 2.0, 0.4
    away = {power: [] for power in (P, P + 1)}
    for h in steps:
        got = enhanced(np.sin, lambda x, _: network(x), x0, h, round(time / h))
        for power, errors in away.items():

            def modified(x, power=power, h=h):
                return np.sin(x) + h**power * (delta(x) + network(x))

            errors.append(abs(got - flow(modified, x0, time, 4000)))
    assert slope(away[P], steps) == pytest.approx(P + 1, abs=0.15)
    assert slope(away[P + 1], steps) == pytest.approx(P, abs=0.15)
