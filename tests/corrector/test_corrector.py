"""Corrected steps: the compiled correction, the enhanced step and the guarded one, lane by lane."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from corrector_example import (
    collect,
    network,
    operating_points,
    trained,
    training_samples,
    turbine,
    with_weights,
)
from hypothesis import given, settings
from hypothesis import strategies as st
from simulating import simulate_block

from fatigue_runner.corrector import coordinates, features, samples, threshold
from fatigue_runner.errors import InputError
from fatigue_runner.turbine import load_turbine
from fatigue_runner.wind import ConstantWind, TurbulentWind

UNSEEN = ConstantWind(7.4, 0.1, 0.02)


def start(speed=7.4):
    return turbine().operating_point(speed)[None]


def run(
    corrector=None, mode="enhanced", method="heun", step=0.02, duration=10.0, wind=UNSEEN, x=None, output=None
):
    x = start() if x is None else x
    return simulate_block(
        turbine(), method, step, [wind], x, duration, output, corrector=corrector, mode=mode
    )[0]


@pytest.fixture(scope="module")
def reference():
    return run(method="dop853", step=0.02)


def error(trajectory, reference) -> float:
    """RMS over time in units of the states' ranges, the largest over the states."""
    n = len(trajectory.state)
    away = np.sqrt(((trajectory.state - reference.state[:n]) ** 2).mean(axis=0))
    return float((away / np.ptp(reference.state, axis=0)).max())


CASES = {
    "affine": lambda: trained(),
    "affine with factors": lambda: trained(factors=("sin_azimuth", "wind_speed@start")),
    "rk4": lambda: trained("rk4", 0.1),
    "raw network, relu": lambda: network(True, "relu"),
    "stage-aware network, isru": lambda: network(False, "isru"),
}


@pytest.mark.parametrize("name", CASES)
def test_one_enhanced_step_is_the_base_step_plus_what_predict_says(name):
    """x+ = eta_h(x) + h^(p+1) N; the paper's algorithm 1 adds h^(p+1) N to x instead, which is off by h f."""
    corrector = CASES[name]()
    found = training_samples(corrector.method, corrector.step)
    expected = found.plain + corrector.predict(found)
    for i in range(0, 1600, 173):
        wind = ConstantWind(*found.pieces[i, 0, 0])
        one = run(
            corrector,
            method=corrector.method,
            step=corrector.step,
            duration=corrector.step,
            wind=wind,
            x=found.state[i : i + 1],
        )
        assert one.state[-1] == pytest.approx(expected[i], rel=1e-12, abs=1e-12)
        assert np.abs(one.state[-1] - found.state[i] - corrector.predict(found)[i]).max() > 1e-3


def test_a_trained_corrector_takes_two_digits_off_the_error_in_an_unseen_wind(reference):
    plain, enhanced = error(run(), reference), error(run(trained()), reference)
    assert enhanced < plain / 100


def test_a_corrector_that_looks_back_sees_the_slopes_of_the_steps_before():
    """Two steps from a point of an accurate trajectory, against numpy's sum over the features."""
    corrector = trained("rk4", 0.1, history=1)
    x, wind = start(), ConstantWind(7.4, 0.1, 0.02)
    ran = run(corrector, method="rk4", step=0.1, duration=0.2, wind=wind, x=x)
    # the first step is the fallback's, in many substeps: accurate
    fine = run(method="rk4", step=0.1 / 32, duration=0.1, wind=wind, x=x)
    assert ran.state[1] == pytest.approx(fine.state[-1], rel=1e-11, abs=1e-11)
    pieces = np.zeros((1, 1, 4, 3))
    pieces[0, 0, 0] = 7.4, 0.1, 0.02
    now = samples.single_steps(turbine(), "rk4", 0.1, ran.state[1:2], pieces)
    before = 0.1 * coordinates.slopes(turbine(), ran.state, ran.wind)[0]
    now.rows = np.concatenate([now.rows, before[None]], axis=1)
    assert ran.state[2] == pytest.approx((now.plain + corrector.predict(now))[0], rel=1e-10, abs=1e-10)
    assert np.abs(corrector.predict(now)).max() > 1e-7


def test_evaluations_count_the_fallback_only_where_it_is_used():
    assert run(trained(), duration=1.0).evaluations == 1 + 50 * 2
    # RK3 shares both stages of Heun
    assert run(trained(), "hybrid", duration=1.0).evaluations == 1 + 50 * 3
    # two halves of an RK4 step, whose first slope is shared
    assert run(trained("rk4", 0.1), "hybrid", "rk4", 0.1, 1.0).evaluations == 1 + 10 * (4 + 7)
    assert (
        run(trained("rk4", 0.1, history=1), "enhanced", "rk4", 0.1, 1.0).evaluations
        == 1 + 10 * 4 + 32 * 4 - 1
    )


class TestTheHybrid:
    """Whatever the network says, a step ends within limit * sc of the fallback."""

    def wrong(self, kind: str):
        corrector = trained()
        weights = corrector.map.linear
        if kind == "untrained":
            return with_weights(corrector, 0 * weights)
        if kind == "deliberately wrong":
            return with_weights(corrector, -50 * weights)
        if kind == "huge":
            return with_weights(corrector, 1e30 * weights)
        rng = np.random.default_rng(0)
        return with_weights(corrector, weights * np.where(rng.random(weights.shape) < 0.3, -1e3, 1.0))

    @pytest.mark.parametrize("kind", ["untrained", "deliberately wrong", "huge", "bits flipped"])
    def test_is_as_good_as_the_fallback_with_any_network_where_the_enhanced_one_fails(self, kind, reference):
        bad = self.wrong(kind)
        fallback, hybrid = run(method="rk3"), run(bad, "hybrid")
        assert error(hybrid, reference) <= 1.05 * error(fallback, reference)
        enhanced = run(bad)
        assert enhanced.diverged_at is not None or error(enhanced, reference) > 3 * error(fallback, reference)

    def test_refuses_a_correction_that_is_no_number(self):
        """NaN weights cannot be loaded; here they go around the check, as a broken memory would."""
        bad = trained()
        weights = bad.map.linear.copy()
        weights[13, 3] = np.nan
        broken = replace(bad)
        object.__setattr__(broken, "map", replace(bad.map, linear=weights))
        hybrid, fallback = run(broken, "hybrid", duration=2.0), run(method="rk3", duration=2.0)
        assert not hybrid.accepted.any()
        np.testing.assert_array_equal(hybrid.state, fallback.state)

    def test_accepts_a_good_network_and_is_as_good_as_the_enhanced_one(self, reference):
        hybrid = run(trained(), "hybrid")
        assert hybrid.accepted.mean() > 0.95
        assert error(hybrid, reference) < 2 * error(run(trained()), reference) + 1e-6
        assert np.all((hybrid.discrepancy <= hybrid.threshold) == hybrid.accepted)

    def test_takes_substeps_of_the_base_method_where_the_full_step_is_unstable(self):
        corrector = with_weights(trained("rk4", 0.2), 1e3 * trained("rk4", 0.2).map.linear)
        assert corrector.guard.substeps == 2
        hybrid = run(corrector, "hybrid", "rk4", 0.2, 4.0)
        halves = run(method="rk4", step=0.1, duration=4.0, output=0.2)
        assert not hybrid.accepted.any()
        assert hybrid.state[1:] == pytest.approx(halves.state[1:], rel=1e-9, abs=1e-9)

    @settings(max_examples=25, deadline=None)
    @given(
        size=st.floats(-1e6, 1e6), column=st.integers(0, 40), row=st.integers(0, 15),
        limit=st.floats(0, 1e3), norm=st.sampled_from(["max", "rms"]), rtol=st.sampled_from([0.0, 1e-3]),
    )  # fmt: skip
    def test_is_never_further_than_the_limit_from_the_fallback(self, size, column, row, limit, norm, rtol):
        good = trained()
        weights = good.map.linear.copy()
        weights[row, column] += size
        g = replace(good.guard, limit=limit, norm=norm, rtol=(rtol,) * 16)
        x = start() * (1 + 1e-3)
        hybrid = run(replace(with_weights(good, weights), guard=g), "hybrid", duration=0.02, x=x)
        fallback = run(method="rk3", duration=0.02, x=x).state[-1]
        away = threshold.distances((hybrid.state[-1] - fallback)[None], x, fallback[None], g)[0]
        assert away <= limit * (1 + 1e-9) + 1e-9 / min(g.atol) * 1e-6
        if not hybrid.accepted[0]:
            np.testing.assert_array_equal(hybrid.state[-1], fallback)


@pytest.mark.parametrize("mode", ["enhanced", "hybrid"])
def test_a_corrected_case_does_not_depend_on_its_neighbours(mode):
    winds = [TurbulentWind(7.0 + 0.1 * i, intensity=0.14, seed=i, duration=5.0) for i in range(18)]
    x = operating_points(winds)
    corrector = trained("rk4", 0.1)
    together = simulate_block(turbine(), "rk4", 0.1, winds, x, 3.0, None, corrector=corrector, mode=mode)
    for i in (0, 5, 17):
        alone = simulate_block(
            turbine(), "rk4", 0.1, [winds[i]], x[i : i + 1], 3.0, None, corrector=corrector, mode=mode
        )[0]
        np.testing.assert_array_equal(alone.state, together[i].state)
        np.testing.assert_array_equal(alone.discrepancy, together[i].discrepancy)


def test_a_run_under_constant_wind_equals_one_under_the_same_wind_as_a_series():
    from fatigue_runner.wind import SeriesWind

    series = SeriesWind(0.5, np.tile([7.4, 0.1, 0.02], (30, 1)))
    a, b = run(trained(), duration=4.0), run(trained(), duration=4.0, wind=series)
    assert b.state == pytest.approx(a.state, rel=1e-10, abs=1e-12)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"mode": "hybird"}, "unknown mode 'hybird'; did you mean 'hybrid'"),
        ({"method": "rk3"}, "was trained for heun, the campaign uses rk3"),
        ({"step": 0.01}, "trained for step 0.02 s, the campaign uses 0.01 s"),
        ({"method": "ab4"}, "a corrector needs a Runge-Kutta or an exponential Adams method"),
    ],
)
def test_a_run_that_does_not_fit_the_corrector_is_refused(change, words):
    with pytest.raises(InputError, match=words):
        run(trained(), **{"duration": 1.0, **change})


def test_a_corrector_of_another_turbine_is_refused():
    other = load_turbine("t2b1i1cg")
    with pytest.raises(InputError, match="was trained for turbine nrel5mw"):
        simulate_block(other, "heun", 0.02, [UNSEEN], start(), 1.0, corrector=trained())


def test_a_corrector_for_fixed_pitch_is_refused_under_a_controller():
    turbine = load_turbine("nrel5mw").operated("controlled")
    words = "trained for nrel5mw with `operation: fixed`, the run has `operation: controlled`"
    with pytest.raises(InputError, match=words):
        simulate_block(
            turbine, "heun", 0.02, [UNSEEN], turbine.operating_point(8.0)[None], 1.0, corrector=trained()
        )


class TestSamples:
    def test_a_defect_is_what_the_step_lacks_to_many_small_ones(self):
        found = training_samples()
        i = 11
        fine = run(
            method="rk4",
            step=0.001,
            duration=0.02,
            wind=ConstantWind(*found.pieces[i, 0, 0]),
            x=found.state[i : i + 1],
        )
        plain = run(duration=0.02, wind=ConstantWind(*found.pieces[i, 0, 0]), x=found.state[i : i + 1])
        assert found.defect[i] == pytest.approx(fine.state[-1] - plain.state[-1], rel=1e-5, abs=1e-10)

    def test_a_step_over_a_knot_of_the_wind_is_cut_at_the_knot(self):
        wind = TurbulentWind(8.0, intensity=0.1, seed=1, duration=10.0, harmonics=1)  # a knot every 0.2 s
        assert samples.pieces_of([wind], 0.3, 0.1) == 3
        assert samples.pieces_of([wind], 0.125, 0.125) == 5
        assert samples.pieces_of([ConstantWind(8.0)], 0.3, 0.1) == 1
        cut = samples.wind_pieces(turbine(), wind, np.array([2.1]), 0.3, 3)[0]
        for i, u in ((0, 0.03), (1, 0.07), (2, 0.05)):
            value = ((cut[i, 3] * u + cut[i, 2]) * u + cut[i, 1]) * u + cut[i, 0]
            assert value == pytest.approx(wind.at(np.array([2.1 + 0.1 * i + u]))[0], abs=1e-12)
        whole = samples.wind_pieces(turbine(), wind, np.array([2.1]), 0.3)[0, 0]
        off = ((whole[3] * 0.17 + whole[2]) * 0.17 + whole[1]) * 0.17 + whole[0]
        assert np.abs(off - wind.at(np.array([2.27]))[0]).max() > 1e-6

    def test_wind_pieces_are_exact_where_the_wind_is_cubic(self):
        wind = TurbulentWind(8.0, intensity=0.14, seed=1, duration=10.0, harmonics=1)
        piece = samples.wind_pieces(turbine(), wind, np.array([2.05]), 0.1)[0, 0]
        for u in (0.0, 0.03, 0.1):
            assert np.polyval(piece[::-1], u) == pytest.approx(wind.at(np.array([2.05 + u]))[0], abs=1e-12)

    def test_the_same_seed_gives_the_same_samples(self):
        def rows(seed):
            return collect("heun", 0.02, [UNSEEN], 3.0, 20, 1e-5, seed).rows

        np.testing.assert_array_equal(rows(1), rows(1))
        assert not np.array_equal(rows(1), rows(2))

    def test_a_diverging_reference_is_refused_by_name(self):
        with pytest.raises(
            InputError, match=r"training wind constant-7.4.* diverged at .* leave this wind out"
        ):
            collect("heun", 0.02, [UNSEEN], 3.0, 20, 1e-5, 0, initial=start() * 1e5)

    def test_features_are_named_one_by_one(self):
        assert training_samples().rows.shape[1] == len(features.stage_aware(turbine().layout, 2))
        looking_back = training_samples("rk4", 0.1, 1)
        assert looking_back.rows.shape[1] == len(features.stage_aware(turbine().layout, 4, 1))


def test_the_limit_is_kappa_times_the_largest_distance_of_the_training_set():
    corrector, found = trained(), training_samples()
    other = threshold.fallback_results(turbine(), "heun", 0.02, 0, found)
    away = threshold.distances(
        found.plain + corrector.predict(found) - other, found.state, other, corrector.guard
    )
    assert corrector.guard.limit == pytest.approx(2.0 * away.max())
    half = threshold.from_training_set(
        corrector.map, corrector.binding, turbine(), found, kappa=1.0, quantile=0.5
    )
    assert (away <= half.limit).mean() == pytest.approx(0.5, abs=0.01)
