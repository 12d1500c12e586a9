"""What one evaluation takes, and the cost that is made of it."""

from __future__ import annotations

import numpy as np
import pytest

from fatigue_runner.benchmark.speed import right_hand_side
from fatigue_runner.corrector import find
from fatigue_runner.integrators import Ensemble, Integrator
from fatigue_runner.integrators.evaluation_times import evaluation_times
from fatigue_runner.results.evaluation_cost import break_even, delta_t, delta_ts
from fatigue_runner.turbine import load_turbine
from fatigue_runner.wind import ConstantWind


def test_f_and_every_correction_are_timed_for_one_case_and_per_case_of_many():
    turbine = load_turbine("t2b1i1cg")
    winds = [ConstantWind(v) for v in (6.0, 8.0)]
    ensemble = Ensemble(turbine, winds, np.stack([turbine.operating_point(v) for v in (6.0, 8.0)]), 1.0)
    network, affine = find("paper-heun-10ms"), find("heun-10ms-t2b1i1cg")
    integrators = [Integrator("heun", 0.01, c, m) for c in (network, affine) for m in ("enhanced", "hybrid")]
    found = evaluation_times(ensemble, [Integrator("rk4", 0.01), *integrators], rounds=3)
    assert set(found) == {"f", network.name, affine.name}  # whatever the mode
    for own in found.values():
        # one case alone takes a group of lanes
        assert 0 < 2 * own["lane"] < own["single"] < 1e-3
    assert found[network.name]["lane"] > found[affine.name]["lane"]  # 28,305 multiply-adds against 3,440


@pytest.mark.parametrize("name", ["t2b1i1cg", "nrel5mw_edges"])
def test_the_interpreted_right_hand_side_is_the_compiled_one(name):
    turbine = load_turbine(name)
    x = turbine.operating_point(8.0) + 0.01 * np.random.Generator(np.random.PCG64(0)).standard_normal(
        turbine.layout.size
    )
    own = right_hand_side.interpreted(turbine)(x.tolist(), [8.3, 0.1, -0.05])
    exact = turbine.rhs(x, wind=8.3, vertical_shear=0.1, horizontal_shear=-0.05)
    np.testing.assert_allclose(own, exact, rtol=1e-9, atol=1e-12 * np.abs(exact).max())


def test_delta_t_is_the_papers_formula():
    # Heun's two evaluations of 1.5 ms and a network of 14 us in each step of 10 ms
    assert delta_t(200.0, 0.01, 1.5e-3, 14e-6) == pytest.approx((2 * 1.5e-3 + 14e-6) / 0.01)
    times = {"f": {"single": 2.0, "lane": 1.0}, "net": {"single": 6.0, "lane": 3.0}}
    assert delta_ts(times, 20.0, 0.1) == {"single": 40.0, "lane": 20.0}
    assert delta_ts(times, 20.0, 0.1, "net") == {"single": 100.0, "lane": 50.0}
    assert delta_ts(times, 20.0, 0.1, "other") == delta_ts({}, 20.0, 0.1) == {}


def test_at_the_break_even_ratio_both_cost_the_same():
    evaluations, step, rival = 200.0, 0.01, 660.0
    ratio = break_even(evaluations, step, rival)
    assert delta_t(evaluations, step, 1.0, ratio) == pytest.approx(delta_t(rival, step, 1.0))
    assert break_even(200.0, 0.01, 150.0) is None  # dearer even if N cost nothing
