"""The exponential method: its functions, its textbook form, what it gains, what it stands."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm
from simulating import simulate_block

from fatigue_runner.integrators import linear_part as parts
from fatigue_runner.integrators import stability_limit
from fatigue_runner.integrators.initial import initial_state
from fatigue_runner.integrators.linear_part import linear_part, linearisation_point, phi_functions
from fatigue_runner.wind import ConstantWind, TurbulentWind


def test_phi_functions_are_those_of_the_scalar_formulas():
    z = np.array([[-1.3]])
    e = np.exp(-1.3)
    expected = [e, (e - 1) / -1.3, (e - 1 + 1.3) / 1.69, (e - 1 + 1.3 - 0.845) / -2.197]
    assert [float(p[0, 0]) for p in phi_functions(z, 3)] == pytest.approx(expected, rel=1e-12)


def test_phi_functions_of_a_singular_matrix_follow_their_recursion():
    z = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 2.0], [0.0, 0.0, 0.0]])
    phi = phi_functions(z, 3)
    for k in range(3):
        fact = [1, 1, 2][k]
        assert z @ phi[k + 1] == pytest.approx(phi[k] - np.eye(3) / fact, abs=1e-14)


def test_the_linear_part_does_not_feel_where_the_rotor_stands(turbine):
    a = linear_part(turbine, 0.0)
    turned = np.zeros(16)
    turned[6], turned[7] = 1.0, turbine.parameters["g_ratio"]
    assert np.abs((a @ turned)[8:]).max() < 1e-9
    assert a[:8, 8:] == pytest.approx(np.eye(8), abs=1e-9)


def test_the_compiled_loop_is_krogstad_s_method_in_its_textbook_form(turbine):
    """With g = f - A x and exp(hA), as printed; the loop works with f and differences instead."""
    h, steps = 0.05, 5
    wind = TurbulentWind(8.0, intensity=0.2, seed=4, duration=10.0, harmonics=1).on(turbine.rotor)
    x = turbine.operating_point(8.0)
    x[[0, 2, 5]] += 0.05, 0.3, 0.02
    compiled = simulate_block(turbine, "etdrk4", h, [wind], x[None], steps * h)[0]
    a = linear_part(turbine, 0.0)
    e_half, e_full = expm(a * h / 2), expm(a * h)
    _, p1h, p2h = phi_functions(a * h / 2, 2)
    _, p1, p2, p3 = phi_functions(a * h, 3)

    def g(t, y):
        return turbine.rhs(y, *wind.at(np.array([t]))[0]) - a @ y

    for n in range(steps):
        t = n * h
        g1 = g(t, x)
        s2 = e_half @ x + h / 2 * p1h @ g1
        g2 = g(t + h / 2, s2)
        s3 = e_half @ x + h * (p1h / 2 @ g1 + p2h @ (g2 - g1))
        g3 = g(t + h / 2, s3)
        s4 = e_full @ x + h * (p1 @ g1 + 2 * p2 @ (g3 - g1))
        g4 = g(t + h, s4)
        x = e_full @ x + h * (
            (p1 - 3 * p2 + 4 * p3) @ g1 + (2 * p2 - 4 * p3) @ (g2 + g3) + (4 * p3 - p2) @ g4
        )
        assert compiled.state[n + 1] == pytest.approx(x, rel=1e-9, abs=1e-9)


def test_it_is_more_accurate_than_rk4_at_the_same_cost_in_turbulence(turbine):
    wind = [TurbulentWind(8.0, intensity=0.15, seed=9, duration=30.0)]
    start = turbine.operating_point(8.0)[None]
    fine = simulate_block(turbine, "dop853", 0.01, wind, start, 30.0, 0.1)[0].state

    def error(name):
        t = simulate_block(turbine, name, 0.1, wind, start, 30.0, 0.1)[0]
        return np.max(np.sqrt(np.mean((t.state - fine) ** 2, axis=0)) / np.ptp(fine, axis=0))

    # measured: about 100 times
    assert error("etdrk4") < error("rk4") / 20


def test_it_is_stable_where_no_other_method_is(turbine):
    assert stability_limit(turbine, "etdrk4") > 0.4 > stability_limit(turbine, "dop853")
    start = turbine.operating_point(8.0)[None]
    t = simulate_block(turbine, "etdrk4", 0.4, [ConstantWind(8.0, 0.1)], start, 400.0)[0]
    assert t.diverged_at is None and np.ptp(t.state[-200:, 13]) < 1.0


def test_the_linear_part_is_that_of_the_case_s_wind_in_operation_and_of_8_m_s_at_fixed_pitch(turbine):
    assert [linearisation_point(turbine, v) for v in (4.0, 18.0)] == [8.0, 8.0]
    operated = turbine.operated("controlled")
    assert [linearisation_point(operated, v) for v in (1.0, 11.4, 11.6, 30.0)] == [3.0, 11.0, 12.0, 25.0]
    integral = operated.layout.row("speed_error_integral")
    own = [linear_part(operated, 0.0, v)[integral, integral] for v in (8.0, 12.0, 20.0)]
    # the integral is pulled back below rated, integrates above, and does both around it
    assert own[0] < -5 < own[1] < -1 < own[2] <= 0


@pytest.mark.parametrize(("name", "step"), [("etdrk4", 0.2), ("etdabm3", 0.1), ("etdabm4", 0.1)])
def test_in_operation_far_above_rated_the_case_s_own_linear_part_is_worth_its_evaluations(
    turbine, name, step, monkeypatch
):
    operated = turbine.operated("controlled")
    wind = TurbulentWind(20.0, 0.14, seed=9, duration=42.0, harmonics=6).on(turbine.rotor)
    start = initial_state(operated, "operating-point", wind)[None]

    def run(method, h):
        return simulate_block(operated, method, h, [wind], start, 40.0, 0.2)[0].state[50:]

    fine, own = run("dop853", 0.025), run(name, step)
    monkeypatch.setattr(parts, "linearisation_point", lambda *_: 8.0)
    for module in ("exponential_runge_kutta", "exponential_adams"):
        monkeypatch.setattr(f"fatigue_runner.integrators.{module}.linearisation_point", lambda *_: 8.0)
    shared = run(name, step)
    errors = [np.max(np.sqrt(np.mean((x - fine) ** 2, axis=0)) / np.ptp(fine, axis=0)) for x in (own, shared)]
    assert errors[0] < errors[1] / 1.5  # measured: 1.8 (etdrk4), 4 (Adams)


@pytest.mark.parametrize("name", ["etdrk4", "etdabm3"])
def test_lanes_of_other_winds_keep_a_case_s_bits(turbine, name):
    operated = turbine.operated("controlled")
    winds = [ConstantWind(v, 0.1) for v in (6.0, 12.0, 12.2, 21.0)]
    start = np.array([operated.operating_point(w.mean_speed) for w in winds])
    start[:, 0] += 0.1
    together = simulate_block(operated, name, 0.1, winds, start, 6.0)
    pair = simulate_block(operated, name, 0.1, winds[1:3], start[1:3], 6.0)  # one matrix for both
    for number, run in ((1, pair[0]), (2, pair[1])):
        assert np.array_equal(run.state, together[number].state)
    [alone] = simulate_block(operated, name, 0.1, winds[3:], start[3:], 6.0)
    assert np.array_equal(alone.state, together[3].state)
