"""A corrector on a turbine that it was not trained for: refused with what differs, and the command that trains one."""

from __future__ import annotations

import pytest

from fatigue_runner.api import simulate
from fatigue_runner.corrector.train import standard_recipes
from fatigue_runner.errors import InputError
from fatigue_runner.turbine import load_turbine
from fatigue_runner.turbine.distance import apart


def test_a_corrector_of_another_turbine_is_refused_with_what_differs_and_the_command(tmp_path):
    path = tmp_path / "heavier.yaml"
    path.write_text("name: heavier\nbase: nrel5mw\nnacelle: {mass: 300000}\n")
    with pytest.raises(InputError) as caught:
        simulate(load_turbine(str(path)), 8.0, method="heun", step=0.01, duration=1.0, corrector="heun-10ms")
    told = str(caught.value)
    assert "was trained for turbine nrel5mw" in told
    assert "which differs in mass on the tower +17.1 %" in told
    assert f"`fatigue-runner train --turbine {path}` trains the standard set for it" in told


def test_turbines_that_look_alike_are_told_apart_by_their_parameters():
    from dataclasses import replace

    one = load_turbine("nrel5mw")
    other = replace(one, parameters={**one.parameters, "b_de": 2 * one.parameters["b_de"]})
    assert apart(other, one) == "1 parameters of the equations, b_de among them"


def test_the_standard_set_is_the_shipped_affine_recipes_of_the_real_turbine():
    names = [path.stem for path in standard_recipes()]
    assert "rk4-100ms" in names and "etdabm3-100ms" in names
    assert not any("t2b1i1cg" in name or "paper" in name or "commands" in name for name in names)


def test_a_turbine_without_a_controller_has_no_standard_corrector_for_its_operation(tmp_path):
    from dataclasses import replace

    bare = replace(load_turbine("nrel5mw"), control=None)
    left = {path.stem for path in standard_recipes()} - {path.stem for path in standard_recipes(bare)}
    assert left == {path.stem for path in standard_recipes() if "operation" in path.stem} and left
