"""What a corrector sees follows from the layout: names and compiled rows agree, and an artefact knows the states it was made for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from corrector_example import trained, turbine

from fatigue_runner.corrector import CorrectorError, features, load, save
from fatigue_runner.corrector.guard import open_guard
from fatigue_runner.corrector.maps import StageMap
from fatigue_runner.integrators import correction, multi_blade
from fatigue_runner.layout import T2B1I1CG, Channel, FirstOrder

CONTROLLED = T2B1I1CG.extended(
    first_order=(FirstOrder(Channel("filtered_speed", "rad/s", "filtered speed", "rpm")),),
    wind=(Channel("wind_cos_2", "m/s", "second harmonic, cosine", "m/s"),),
)


@pytest.mark.parametrize(
    "layout", [T2B1I1CG, CONTROLLED], ids=["shipped", "with a first-order state and a signal"]
)
def test_there_is_a_name_for_every_compiled_row(layout):
    for stages, history in ((2, 0), (4, 1)):
        rows = correction.fixed_rows(layout) + correction.stage_part(layout) * (stages + history)
        assert len(features.stage_aware(layout, stages, history)) == rows
    assert len(features.raw(layout)) == correction.raw_rows(layout)
    for past in (2, 3):
        names = features.multi_blade(layout, past)
        assert len(names) == len(set(names)) == multi_blade.base_rows(layout, past)
        assert names[multi_blade.wind_row(layout)] == "wind_speed@start"
        assert names[multi_blade.past_row(layout)].startswith("nonlinear_tower_fore_aft")
    assert {"edge", "edge_velocity", *features.DRIVE} == {layout.names[row] for row in features.drive(layout)}


def controlled():
    """A corrector for one more state and one more signal; of random weights."""
    rows = len(features.stage_aware(CONTROLLED, 2))
    weights = np.random.default_rng(1).standard_normal((CONTROLLED.size, rows))
    return replace(trained(), map=StageMap(weights, layout=CONTROLLED), guard=open_guard(CONTROLLED.size))


def test_an_artefact_of_more_states_and_signals_names_them(tmp_path):
    save(controlled(), tmp_path / "more.safetensors")
    back = load(tmp_path / "more.safetensors")
    assert back.map.layout.names == CONTROLLED.names
    assert [c.name for c in back.map.layout.wind] == [c.name for c in CONTROLLED.wind]
    np.testing.assert_array_equal(back.map.linear, controlled().map.linear)


def test_it_is_refused_on_a_turbine_of_other_states():
    with pytest.raises(CorrectorError, match="was trained for a turbine of 17 states, this one has 16"):
        controlled().bind(turbine(), "heun", 0.02)


def test_it_is_refused_on_a_turbine_whose_equations_know_another_wind():
    layout = T2B1I1CG.extended(wind=CONTROLLED.wind[3:])
    weights = np.zeros((layout.size, len(features.stage_aware(layout, 2))))
    learned = replace(trained(), map=StageMap(weights, layout=layout))
    with pytest.raises(
        CorrectorError, match="horizontal_shear, wind_cos_2, the equations of this turbine know wind_speed"
    ):
        learned.bind(turbine(), "heun", 0.02)


def test_weights_and_guards_of_another_width_are_refused():
    with pytest.raises(CorrectorError, match="do not fit heun's features"):
        replace(controlled(), map=StageMap(trained().map.linear, layout=CONTROLLED))
    with pytest.raises(CorrectorError, match="its guard's atol needs a number for each of 17 states, got 16"):
        replace(controlled(), guard=trained().guard)
