"""The compiled stepping: its order on the turbine, output between steps, independence of lanes, divergence."""

from __future__ import annotations

import numpy as np
import pytest
from simulating import simulate_block
from smooth_turbine import smooth_turbine, smooth_wind

import fatigue_runner as fr
from fatigue_runner.errors import FatigueRunnerWarning, InputError
from fatigue_runner.integrators import METHODS, method, stability_limit
from fatigue_runner.integrators.adams import LinearMultistep
from fatigue_runner.integrators.exponential_adams import ExponentialAdams
from fatigue_runner.integrators.exponential_runge_kutta import ExponentialRungeKutta
from fatigue_runner.integrators.output import hermite_weights
from fatigue_runner.turbine.generated.kernel import LANES
from fatigue_runner.wind import ConstantWind, StepWind, TurbulentWind

DURATION = 2.4


@pytest.fixture(scope="module")
def smooth():
    return smooth_turbine()


@pytest.fixture(scope="module")
def start(smooth):
    """Off the operating point, so that every mode moves."""
    x = smooth.operating_point(8.0)
    x[[0, 2, 5]] += 0.05, 0.3, 0.02
    return x


@pytest.fixture(scope="module")
def reference(smooth, start):
    return run(smooth, "dop853", DURATION / 1200, start, output_step=DURATION / 24)


def run(turbine, name, step, start, output_step=None, wind=None, duration=DURATION):
    wind = wind or smooth_wind(duration)
    return simulate_block(turbine, name, step, [wind], start[None], duration, output_step)[0]


def distance(trajectory, reference) -> float:
    """RMS over time and states of the error in units of each state's range."""
    scale = np.ptp(reference.state, axis=0)
    return float(np.sqrt(np.mean(((trajectory.state - reference.state) / scale) ** 2)))


# Steps per run: below the stability limit by far, with errors well above rounding (1e-12, from the stiff shaft).
STEPS = {
    1: (24000, 48000),
    2: (1200, 2400),
    3: (1200, 2400),
    4: (600, 1200),
    5: (384, 768),
    7: (72, 144),
    8: (48, 120),
}
# tsit5's first error term is so small that the second one rules at larger steps; etdrk4's errors meet rounding early
LATE = {"tsit5": (768, 1200), "etdrk4": (120, 240), "etdabm3": (384, 768), "etdabm4": (192, 384)}


@pytest.mark.parametrize("name", METHODS)
def test_observed_order_on_the_turbine_in_changing_wind(smooth, start, reference, name):
    steps = LATE.get(name, STEPS[method(name).order])
    errors = [distance(run(smooth, name, DURATION / n, start, DURATION / 24), reference) for n in steps]
    assert errors[1] > 5e-12
    observed = np.log(errors[0] / errors[1]) / np.log(steps[1] / steps[0])
    # where tsit5's first error term would rule, rounding already does
    assert observed == pytest.approx(method(name).order, abs=0.3 if name == "tsit5" else 0.15)


@pytest.mark.parametrize(
    "name", [n for n in METHODS if not isinstance(method(n), ExponentialRungeKutta | ExponentialAdams)]
)
def test_the_compiled_loop_does_what_the_method_s_definition_says(smooth, start, name):
    h, steps, wind = 0.01, 6, smooth_wind(DURATION)
    found = method(name)

    def slope(t, x):
        return smooth.rhs(x, *wind.at(np.array([t]))[0])

    def one_step(tableau, t, x):
        a, b, _, c = tableau.arrays()
        k = []
        for i in range(tableau.stages):
            k.append(slope(t + c[i] * h, x + h * sum((a[i, j] * k[j] for j in range(i)), np.zeros(16))))
        return x + h * sum(bi * ki for bi, ki in zip(b, k, strict=True))

    x, slopes, states = start, [], [start]
    for n in range(steps):
        t = n * h
        if not isinstance(found, LinearMultistep):
            x = one_step(found, t, x)
        else:
            slopes.insert(0, slope(t, x))
            if n < 3:
                x = one_step(found.start, t, x)
            else:
                new = x + h * sum(float(b) * f for b, f in zip(found.predictor, slopes, strict=False))
                if found.corrector is not None:
                    f = [slope(t + h, new), *slopes]
                    new = x + h * sum(float(b) * g for b, g in zip(found.corrector, f, strict=False))
                x = new
        states.append(x)
    compiled = run(smooth, name, h, start, wind=wind, duration=steps * h)
    assert np.abs(compiled.state - states).max() < 1e-9 * np.abs(states).max()


@pytest.mark.parametrize("name", METHODS)
def test_evaluations_count_the_initial_slope_and_the_start_up(smooth, start, name):
    steps = 10
    cost = {
        "euler": 1,
        "heun": 2,
        "rk3": 3,
        "heun-richardson": 5,
        "bs32": 3,
        "rk4": 4,
        "dp5": 6,
        "tsit5": 6,
        "rk7": 11,
        "dop853": 12,
        "etdrk4": 4,
    }
    expected = 1 + steps * cost.get(name, 0)
    # Adams methods need a start: RK4 steps, of the exponential ones eight small ones a step
    started = {
        "ab4": 1 + 3 * 4 + 7,
        "abm4": 1 + 3 * 4 + 7 * 2,
        "etdabm3": 1 + 32 + 10,
        "etdabm4": 1 + 2 * 32 + 10,
    }
    expected = started.get(name, expected)
    assert run(smooth, name, 0.001, start, duration=0.01).evaluations == expected


# --- output between steps -----------------------------------------------------------------------------------------


def test_hermite_weights_are_exact_for_polynomials_of_their_degree():
    for nodes, degree in (((0.0, 1.0), 5), ((-1.0, 0.0, 1.0), 8)):
        for theta in (-0.3, 0.25, 0.8):
            value, slope = hermite_weights(theta, nodes)
            for p in range(degree + 1):
                given = np.concatenate(
                    [[x**p, p * x ** max(p - 1, 0), p * (p - 1) * x ** max(p - 2, 0)] for x in nodes]
                )
                assert value @ given == pytest.approx(theta**p, abs=1e-12)
                assert slope @ given == pytest.approx(p * theta ** max(p - 1, 0), abs=1e-11)


@pytest.mark.parametrize(("name", "steps", "order"), [("rk4", (60, 120), 4), ("dp5", (96, 192), 5)])
def test_output_between_steps_keeps_the_method_s_order(smooth, start, name, steps, order):
    fine = run(smooth, "dop853", 0.001, start, output_step=0.007)
    errors = [distance(run(smooth, name, DURATION / n, start, output_step=0.007), fine) for n in steps]
    assert np.log2(errors[0] / errors[1]) > order - 0.3


@pytest.mark.parametrize("name", ["dop853", "rk7"])
def test_output_between_large_steps_is_as_accurate_as_at_them(smooth, start, name):
    fine = run(smooth, "dop853", 0.001, start, output_step=0.005)
    coarse = run(smooth, name, 0.025, start, output_step=0.005)
    error = np.abs(coarse.state - fine.state).max(axis=1)
    at_steps = np.isclose(coarse.time / 0.025, np.rint(coarse.time / 0.025))
    # the first step's inside, too, although it has no step before it
    assert error[~at_steps].max() < 20 * error[at_steps].max() < 1e-6


@pytest.mark.parametrize("name", ["rk4", "dop853"])
def test_output_at_a_step_s_end_is_the_step_s_result_to_the_bit(turbine, name):
    x = turbine.operating_point(8.0)
    every = run(turbine, name, 0.02, x, wind=ConstantWind(8.0), duration=1.0)
    some = run(turbine, name, 0.02, x, output_step=0.1, wind=ConstantWind(8.0), duration=1.0)
    more = run(turbine, name, 0.02, x, output_step=0.005, wind=ConstantWind(8.0), duration=1.0)
    assert np.array_equal(some.state, every.state[::5])
    assert np.array_equal(more.state[::4], every.state)
    assert some.time == pytest.approx(every.time[::5], abs=1e-12)


def test_output_steps_smaller_and_larger_than_the_step_are_both_honoured(turbine):
    x = turbine.operating_point(8.0)
    for output_step, samples in ((0.003, 334), (0.01, 101), (0.017, 59), (1.0, 2)):
        t = run(turbine, "heun", 0.01, x, output_step, ConstantWind(8.0), duration=1.0)
        assert len(t.time) == len(t.state) == samples
        assert t.time == pytest.approx(np.arange(samples) * output_step)
        assert len(t.local_error) == samples - 1


def test_the_local_error_of_an_interval_is_the_worst_of_its_steps(turbine):
    x = turbine.operating_point(8.0)
    x[2] += 0.5
    every = run(turbine, "dp5", 0.02, x, wind=ConstantWind(8.0), duration=1.0)
    some = run(turbine, "dp5", 0.02, x, output_step=0.1, wind=ConstantWind(8.0), duration=1.0)
    # scaled by the state at the interval's end instead of each step's: not the same number to the last digit
    worst = every.local_error.reshape(-1, 5).max(axis=1)
    assert some.local_error == pytest.approx(worst, rel=0.3)
    assert np.isnan(run(turbine, "rk4", 0.02, x, wind=ConstantWind(8.0), duration=0.1).local_error).all()


# --- lanes --------------------------------------------------------------------------------------------------------


def cases(count: int):
    winds = [TurbulentWind(7.0 + 0.05 * i, intensity=0.15, seed=i, duration=20.0) for i in range(count)]
    return winds


@pytest.mark.parametrize("name", ["heun", "tsit5", "abm4", "etdrk4"])
def test_a_case_s_bits_do_not_depend_on_its_neighbours_or_the_block_s_size(turbine, name):
    winds = cases(2 * LANES + 5)
    initial = np.stack([turbine.operating_point(w.mean_speed) for w in winds])

    def states(order):
        block = simulate_block(turbine, name, 0.01, [winds[i] for i in order], initial[order], 3.0, 0.035)
        return {i: t.state for i, t in zip(order, block, strict=True)}

    everything = states(list(range(len(winds))))
    mixed = list(np.random.Generator(np.random.PCG64(1)).permutation(len(winds)))
    for order in (mixed, [3], [0, 17, 3], list(range(LANES)), list(range(LANES + 1))):
        for i, state in states(order).items():
            assert np.array_equal(state, everything[i]), i


def test_constant_wind_gives_the_same_bits_next_to_changing_wind(turbine):
    x = turbine.operating_point(8.0)[None]
    alone = simulate_block(turbine, "rk4", 0.02, [ConstantWind(8.0, 0.1)], x, 2.0)[0]
    winds = [ConstantWind(8.0, 0.1), StepWind([0.0, 1.0], [[8.0, 0, 0], [9.0, 0, 0]])]
    beside = simulate_block(turbine, "rk4", 0.02, winds, np.repeat(x, 2, axis=0), 2.0)[0]
    assert np.array_equal(alone.state, beside.state)


# --- divergence ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["heun", "dp5", "abm4", "etdrk4"])
def test_a_diverging_lane_reports_its_time_and_leaves_the_others_bits_alone(turbine, name):
    winds = cases(4)
    initial = np.stack([turbine.operating_point(w.mean_speed) for w in winds])
    fine = simulate_block(turbine, name, 0.01, winds, initial, 3.0, 0.02)
    wild = initial.copy()
    wild[1, 10] = 9000.0  # a flap velocity that no step survives
    block = simulate_block(turbine, name, 0.01, winds, wild, 3.0, 0.02)
    for i in (0, 2, 3):
        assert block[i].diverged_at is None
        assert np.array_equal(block[i].state, fine[i].state)
    lost = block[1]
    assert lost.diverged_at is not None and 0.0 < lost.diverged_at < 3.0
    assert lost.time[-1] < lost.diverged_at
    assert len(lost.state) == len(lost.time) == len(lost.local_error) + 1
    assert np.isfinite(lost.state).all()
    assert lost.steps == round(lost.diverged_at / 0.01) and lost.evaluations == method(name).evaluations(
        lost.steps
    )


@pytest.mark.parametrize("name", ["rk4", "ab4"])
def test_a_start_that_is_no_number_has_diverged_at_once(turbine, name):
    winds = cases(3)
    initial = np.stack([turbine.operating_point(w.mean_speed) for w in winds])
    fine = simulate_block(turbine, name, 0.01, winds, initial, 1.0)
    initial[1, 4] = np.nan
    block = simulate_block(turbine, name, 0.01, winds, initial, 1.0)
    assert block[1].diverged_at == 0.0
    assert len(block[1].time) == 1 and block[1].steps == 0
    assert all(np.array_equal(block[i].state, fine[i].state) for i in (0, 2))


def test_every_output_before_the_divergence_is_a_good_one(turbine):
    """A step end after the divergence must not reach the output between the last two good ones."""
    x = turbine.operating_point(8.0)
    t = run(turbine, "heun", 0.2, x, output_step=0.03, wind=ConstantWind(8.0), duration=60.0)
    assert t.diverged_at is not None
    assert t.time[-1] <= t.diverged_at - 0.2 + 1e-9
    assert np.abs(t.state[:, [0, 1, 2, 3, 4, 5]]).max() < 1e4


@pytest.mark.parametrize("value", [0.0, -0.01, np.nan, np.inf])
def test_an_impossible_step_is_refused(turbine, value):
    with pytest.raises(InputError, match="step must be a positive number"):
        simulate_block(turbine, "heun", value, [ConstantWind(8.0)], np.zeros((1, 16)), 1.0)


def test_an_unknown_method_is_refused_with_the_nearest_one():
    with pytest.raises(InputError, match="did you mean 'heun'"):
        method("huen")


# --- stability ----------------------------------------------------------------------------------------------------


def test_the_stability_limit_under_the_torque_law_alone_is_found_where_the_turbine_can_stay(turbine):
    """It has no steady rotation at 18 m/s, where a turbine with a pitch controller is looked at, too."""
    assert stability_limit(turbine.operated("torque-law"), "rk4") > 0.05


@pytest.mark.parametrize(
    "name", [n for n in METHODS if not isinstance(method(n), ExponentialRungeKutta | ExponentialAdams)]
)
def test_the_predicted_stability_limit_separates_runs_that_stay_from_runs_that_grow(turbine, name):
    limit = stability_limit(turbine, name, 8.0)
    assert 0.0005 < limit < 1.0 or name == "euler"
    if name == "euler":
        assert limit < 0.01  # damping only, no imaginary axis
        return
    start = turbine.operating_point(8.0)
    start[0] += 0.01

    def spread(step):
        t = run(turbine, name, step, start, wind=ConstantWind(8.0), duration=1000 * step)
        late = t.state[-200:, :6]
        return np.inf if t.diverged_at is not None else np.abs(late - late.mean(axis=0)).max()

    assert spread(0.95 * limit) < 0.5
    assert spread(1.1 * limit) > 1.0


def test_multistep_growth_of_the_exact_solution_is_that_of_the_exponential():
    for name in ("ab4", "abm4"):
        z = np.array([-0.01 + 0.02j, 0.03j])
        assert method(name).growth(z) == pytest.approx(np.abs(np.exp(z)), abs=1e-8)
    # Hairer & Wanner (2010), Solving ODEs II, V.1: AB4's real stability interval is (-3/10, 0)
    assert method("ab4").growth(np.array([-0.2999])) <= 1.0 < method("ab4").growth(np.array([-0.3001]))


def test_a_diverged_trajectory_says_so():
    """Its loads once gave a damage-equivalent load of 8.8e7 N m without a word."""
    with pytest.warns(
        FatigueRunnerWarning,
        match=r"rk4 500 ms diverged at .* of 20 s: the trajectory ends there.*no fatigue",
    ):
        run = fr.simulate("nrel5mw", 8.0, "rk4", 0.5, 20.0)
    assert run.diverged_at is not None and run.time[-1] < 20.0


def test_a_pitch_in_degrees_is_told():
    with pytest.raises(InputError, match=r"pitch is in rad: 5 rad are 286 deg; give math.radians\(5\)"):
        fr.simulate("nrel5mw", 8.0, "rk4", 0.05, 1.0, pitch=5)


def test_a_corrector_is_guarded_from_python_as_in_a_campaign():
    from inspect import signature

    from fatigue_runner.campaign.spec import IntegratorSection

    assert signature(fr.simulate).parameters["mode"].default == IntegratorSection.model_fields["mode"].default
