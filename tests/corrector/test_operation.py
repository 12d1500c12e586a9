"""Correctors of a turbine that operates: what the shipped one gains in each wind, what is refused, what a refused step becomes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from corrector_example import trained
from operation_example import SPEEDS, error, runs, shipped, turbine, wind
from simulating import simulate_block

from fatigue_runner.corrector import CorrectorError, coordinates, features, find, load, save, steps
from fatigue_runner.corrector.train import read_recipe, train
from fatigue_runner.errors import InputError
from fatigue_runner.integrators import method, multi_blade
from fatigue_runner.integrators.initial import initial_state
from fatigue_runner.integrators.linear_part import linearisation_point
from fatigue_runner.wind import ConstantWind


def test_the_hybrid_is_never_worse_than_its_method_and_mostly_much_better():
    plain, hybrid = error(runs("etdabm3", 0.1)), error(runs("etdabm3", 0.1, "hybrid"))
    assert (hybrid < plain).all()
    assert np.median(plain / hybrid) > 4  # measured: 8


def test_about_ten_evaluations_a_second():
    spent = [run.evaluations / 60.0 for run in runs("etdabm3", 0.1, "hybrid")]
    assert np.median(spent) < 11.5 and max(spent) < 14


def test_a_case_does_not_depend_on_its_neighbours_though_lanes_have_matrices_of_their_own():
    together = runs("etdabm3", 0.1, "hybrid")
    for number in (1, 3):
        blowing = wind(SPEEDS[number])
        start = initial_state(turbine(), "operating-point", blowing)[None]
        [alone] = simulate_block(
            turbine(), "etdabm3", 0.1, [blowing], start, 60.0, 0.1, corrector=shipped(), mode="hybrid"
        )
        assert np.array_equal(alone.state, together[number].state)
        assert alone.evaluations == together[number].evaluations


def test_compiled_steps_are_what_the_matrices_of_the_wind_s_bin_say():
    corrector, speed, h = shipped(), 13.3, 0.1
    blowing, layout, past = wind(speed), turbine().layout, corrector.past
    start = initial_state(turbine(), "operating-point", blowing)[None]
    [compiled] = simulate_block(turbine(), "etdabm3", h, [blowing], start, 8 * h, corrector=corrector)
    point = linearisation_point(turbine(), speed)
    base_ahead, base = method("etdabm3").matrices(turbine(), h, 0.0, past, 0.0, point)
    number, size = corrector.map.bin_of(speed), corrector.binding.size
    assert corrector.map.bins[number] == 13.0
    ahead, whole = corrector.map.predictor[number] * size, corrector.map.linear[number] * size
    whole[:, : base.shape[1]] += base
    rows = features.multi_blade_factor_rows(layout, corrector.map.factors)

    def blown(times):
        return coordinates.blown(turbine(), blowing, np.atleast_1d(times))

    def part(x, t):
        return coordinates.nonlinear_part(turbine(), x[None], blown(t), 0.0, point)

    first = past - 1
    parts = [part(compiled.state[i], i * h) for i in range(first, -1, -1)]
    x = compiled.state[first]
    for n in range(first, 8):
        turn = coordinates.turn_of(layout, x[None])
        seen = steps.rows(
            turbine(), x[None], blown(np.array([n, n + 0.5, n + 1]) * h)[None], parts[:past], turn, h
        )
        assert seen.shape[1] + multi_blade.parts(layout) == len(features.multi_blade(layout, past))
        predicted = x + coordinates.from_fixed(layout, seen @ (base_ahead + ahead).T, turn)[0]
        parts.insert(0, part(predicted, (n + 1) * h))
        full = np.concatenate([seen, coordinates.parts_to_fixed(layout, parts[0], turn)], axis=1)
        full = np.concatenate([full, *(full * full[:, [i]] for i in rows)], axis=1)
        x = x + coordinates.from_fixed(layout, full @ whole.T, turn)[0]
        # three winds of a step are nearly collinear: their weights magnify rounding
        assert np.abs(compiled.state[n + 1] - x).max() < 1e-9 * np.abs(x).max()


def test_every_bin_and_what_it_was_trained_for_survive_the_file(tmp_path):
    save(shipped(), tmp_path / "x.safetensors")
    again = load(tmp_path / "x.safetensors")
    assert np.array_equal(again.map.linear, shipped().map.linear)
    assert (again.map.bins, again.map.layout.harmonics) == (tuple(range(3, 26)), True)
    assert (again.binding, again.guard) == (shipped().binding, shipped().guard)
    assert again.binding.operation == "controlled"


@pytest.mark.parametrize(
    ("corrector", "own", "here"), [(shipped, "controlled", "fixed"), (trained, "fixed", "controlled")]
)
def test_another_operation_than_the_one_trained_for_is_refused(corrector, own, here):
    made, other = corrector(), turbine(here)
    words = (
        f"trained for nrel5mw with `operation: {own}`, the run has `operation: {here}` .*use one for {here}"
    )
    with pytest.raises(CorrectorError, match=words):
        made.bind(other, made.method, made.step)


def test_a_wrong_corrector_leaves_steps_that_are_stable_where_the_method_is_not():
    """etdabm3 at 0.1 s diverges at fixed pitch far above rated, and a hybrid that falls back on it would, too."""
    fixed, good = turbine("fixed"), find("etdabm3-100ms")
    start = initial_state(fixed, "paper-spinning", ConstantWind(24.0))[None]
    given = ([ConstantWind(24.0, 0.1)], start, 40.0, 0.5)
    [plain] = simulate_block(fixed, "etdabm3", 0.1, *given)
    [hybrid] = simulate_block(fixed, "etdabm3", 0.1, *given, corrector=good, mode="hybrid")
    assert plain.diverged_at is not None and hybrid.diverged_at is None
    [true] = simulate_block(fixed, "dop853", 0.01, *given)
    away = np.abs(hybrid.state[-20:] - true.state[-20:]).max(axis=0) / np.ptp(true.state, axis=0)
    assert away.max() < 0.02


def test_refused_steps_are_counted_with_what_they_cost():
    found = shipped()
    strict = replace(found, guard=replace(found.guard, limit=0.0))
    blowing = wind(12.0)
    start = initial_state(turbine(), "operating-point", blowing)[None]
    counts = [
        simulate_block(turbine(), "etdabm3", 0.1, [blowing], start, 5.0, corrector=corrector, mode=mode)[
            0
        ].evaluations
        for corrector, mode in ((strict, "enhanced"), (strict, "hybrid"))
    ]
    judged = 50 - (found.past - 1)
    assert counts[1] - counts[0] == judged * (4 * found.guard.substeps + 1)


def recipe(**changed):
    winds = {"type": "turbulent", "harmonics": 6, "duration": 20}
    data = {
        "name": "small", "family": "affine", "operation": "controlled", "method": "heun", "step": 0.02, "samples": 200,
        "training": {**winds, "speeds": [11, 12, 13, 14, 15], "seed": 1},
        "validation": {**winds, "speeds": [13.5], "seed": 2},
    }  # fmt: skip
    return read_recipe({**data, **changed})[0]


def test_a_runge_kutta_method_is_trained_in_operation_by_one_key_more():
    made = train(recipe())
    assert made.binding.operation == "controlled" and made.map.layout.names == turbine().layout.names
    assert made.validation["nrmse_enhanced"] < made.validation["nrmse_plain"] / 5  # measured: 40


def test_a_bin_without_a_wind_and_bins_of_another_family_are_refused():
    with pytest.raises(InputError, match="no wind of training is nearest to 20 m/s"):
        recipe(method="etdabm3", step=0.1, wind_bins=[12, 20])
    with pytest.raises(InputError, match=r"wind_bins.*belongs to family affine of exponential-adams methods"):
        recipe(wind_bins=[12])


@pytest.mark.slow(reason="two minutes of runs")
def test_no_hybrid_run_diverges_in_any_wind():
    """8 seeds of 600 s in each; a hundred each stand in docs/correctors.md, by `fatigue-runner benchmark stability`."""
    from fatigue_runner.benchmark.study import stability

    result = stability.measure(8, 600.0, chosen=[shipped()])
    assert {row["hybrid"]["diverged"] for row in result["rows"]} == {0}
    assert len(result["rows"]) == 6 and min(row["accepted"] for row in result["rows"]) > 0.9
