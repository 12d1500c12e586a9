"""Maps that see what the controller commands within a step: the corners that cost a step at rated wind are no secret."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from operation_example import SPEEDS, error, runs, turbine, wind
from simulating import simulate_block

from fatigue_runner.corrector import CorrectorError, coordinates, features, find, load, save, steps
from fatigue_runner.corrector.train import read_recipe
from fatigue_runner.errors import InputError
from fatigue_runner.integrators import method
from fatigue_runner.integrators.command_rows import command_count, command_rows, commanded
from fatigue_runner.integrators.initial import initial_state
from fatigue_runner.integrators.linear_part import linearisation_point

STEP = 0.15


def shipped():
    return find("etdabm3-150ms-operation-commands")


def test_compiled_steps_are_what_the_matrices_and_the_controller_s_formulas_say():
    corrector, speed = shipped(), 12.0
    blowing, layout, past, h = wind(speed), turbine().layout, corrector.past, STEP
    start = initial_state(turbine(), "operating-point", blowing)[None]
    [compiled] = simulate_block(turbine(), "etdabm3", h, [blowing], start, 12 * h, corrector=corrector)
    point = linearisation_point(turbine(), speed)
    own = [
        weights[corrector.map.bin_of(speed)] * corrector.binding.size
        for weights in corrector.map.tensors().values()
    ]
    learned = dict(zip(corrector.map.tensors(), own, strict=True))
    base = method("etdabm3").matrices(turbine(), h, 0.0, past, 0.0, point, True)
    for name, plain in (("predictor", base[0]), ("again", base[0]), ("linear", base[1])):
        learned[name][:, : plain.shape[1]] += plain
    factors = features.multi_blade_factor_rows(layout, corrector.map.factors)

    def blown(times):
        return coordinates.blown(turbine(), blowing, np.atleast_1d(times))

    def part(x, t):
        return coordinates.nonlinear_part(turbine(), x[None], blown(t), 0.0, point)

    first = past - 1
    parts = [part(compiled.state[i], i * h) for i in range(first, -1, -1)]
    made = [commanded(turbine(), compiled.state[[i]]) for i in range(first, -1, -1)]
    x = compiled.state[first]
    for n in range(first, 12):
        turn = coordinates.turn_of(layout, x[None])
        seen = steps.rows(
            turbine(), x[None], blown(np.array([n, n + 0.5, n + 1]) * h)[None], parts[:past], turn, h
        )
        there = x + coordinates.from_fixed(layout, seen @ learned["predictor"].T, turn)[0]
        more = command_rows(turbine(), x[None], there[None], made[:past], h)
        assert more.shape[1] == command_count(past)
        again = np.concatenate([seen, more], axis=1)
        there = x + coordinates.from_fixed(layout, again @ learned["again"].T, turn)[0]
        parts.insert(0, part(there, (n + 1) * h))
        more = command_rows(turbine(), x[None], there[None], made[:past], h)
        made.insert(0, commanded(turbine(), there[None]))
        full = np.concatenate([seen, coordinates.parts_to_fixed(layout, parts[0], turn), more], axis=1)
        full = np.concatenate([full, *(full * full[:, [i]] for i in factors)], axis=1)
        x = x + coordinates.from_fixed(layout, full @ learned["linear"].T, turn)[0]
        # three winds of a step are nearly collinear: their weights magnify rounding
        assert np.abs(compiled.state[n + 1] - x).max() < 1e-8 * np.abs(x).max()


def test_steps_at_corners_are_found():
    """A line with a kink, and a column that does not bend."""
    x = np.arange(20.0)
    values = np.stack([np.maximum(x - 9.0, 0.0), 2.0 * x], axis=1)
    assert steps.most_bent(values, 1).tolist() == [8]  # between rows 9 and 10
    assert len(steps.most_bent(values, 50)) == 50


def test_an_integral_over_a_corner_is_seen_where_its_ends_and_a_polynomial_miss_it():
    """From region 2.5 into region 3 within one step: the mean torque, against a fine sum over the same interpolated states."""
    layout, h = turbine().layout, STEP
    ends = np.tile(turbine().operating_point(11.0), (2, 1))
    speed, rated = layout.row("filtered_generator_speed"), turbine().control_parameters["ctl_rated"]
    ends[:, speed] = rated - 4.0, rated + 1.0
    ends[:, layout.generator_speed] = ends[:, speed] + 5.0 / h / turbine().control_parameters["ctl_filter"]
    found = command_rows(turbine(), ends[:1], ends[1:], [commanded(turbine(), ends[:1])] * 3, h)[0]
    fine = np.repeat(ends[:1], 2001, axis=0)
    fine[:, speed] = np.linspace(*ends[:, speed], 2001)
    torque = commanded(turbine(), fine)[:, 1]
    mean = float(np.mean((torque[1:] + torque[:-1]) / 2))
    trapezoid = float(torque[[0, -1]].mean())
    assert abs(found[1] - mean) < 0.25 * abs(trapezoid - mean)
    assert abs(trapezoid - mean) > 500.0  # N m: there is a corner


def test_it_takes_most_of_the_method_s_error_off_in_every_wind_the_corners_of_rated_wind_included():
    plain, seeing = error(runs("etdabm3", STEP)), error(runs("etdabm3", STEP, "hybrid", corrector=shipped()))
    assert (seeing < plain / 3).all()
    assert seeing[SPEEDS.index(12.0)] < 5e-3


def test_at_the_same_step_it_is_twice_as_near_at_rated_wind_for_no_more_evaluations():
    with_them, without = (
        runs("etdabm3", 0.1, "hybrid", corrector=find(f"etdabm3-100ms-operation{name}"))
        for name in ("-commands", "")
    )
    at_rated = SPEEDS.index(12.0)
    assert error(with_them)[at_rated] < 0.5 * error(without)[at_rated]
    assert (error(with_them) < error(without)).all()
    assert sum(run.evaluations for run in with_them) <= sum(run.evaluations for run in without)


def test_a_case_does_not_depend_on_its_neighbours():
    together = runs("etdabm3", STEP, "hybrid", corrector=shipped())
    number = SPEEDS.index(12.0)
    blowing = wind(SPEEDS[number])
    start = initial_state(turbine(), "operating-point", blowing)[None]
    [alone] = simulate_block(
        turbine(), "etdabm3", STEP, [blowing], start, 60.0, 0.1, corrector=shipped(), mode="hybrid"
    )
    assert np.array_equal(alone.state, together[number].state)


def test_the_second_product_survives_the_file(tmp_path):
    save(shipped(), tmp_path / "x.safetensors")
    again = load(tmp_path / "x.safetensors")
    assert again.map.commands and np.array_equal(again.map.again, shipped().map.again)


def test_a_map_without_its_rows_is_refused():
    found = shipped()
    with pytest.raises(CorrectorError, match="do not fit etdabm3's features"):
        replace(found, map=replace(found.map, again=found.map.again[..., :-1]))
    with pytest.raises(CorrectorError, match="do not fit etdabm3's features"):
        replace(found, map=replace(found.map, again=None))


def test_commands_of_nobody_are_refused_in_a_recipe():
    winds = {"type": "turbulent", "speeds": [7.0], "duration": 20}
    data = {
        "name": "small", "family": "affine", "method": "etdabm3", "step": 0.1, "commands": True,
        "training": {**winds, "seed": 1}, "validation": {**winds, "seed": 2},
    }  # fmt: skip
    with pytest.raises(InputError, match=r"commands.*operation: controlled"):
        read_recipe(data)
