"""An integrator has one id and one label, wherever it is met."""

from __future__ import annotations

import pytest

from fatigue_runner import naming
from fatigue_runner.integrators import Integrator
from fatigue_runner.results import cells
from fatigue_runner.viewer import overview


@pytest.mark.parametrize(
    ("given", "label"),
    [
        (("heun", 0.01), "heun 10 ms"),
        (("rk7", 0.0001), "rk7 0.1 ms"),
        (("heun", 0.01, "heun-10ms", "hybrid"), "heun-10ms, hybrid"),
        (("heun", 0.01, "paper-heun-10ms", "enhanced"), "paper-heun-10ms, enhanced"),
        # a name that does not tell method and step does not stand alone: two steps may have correctors of one name
        (("heun", 0.01, "my-net", "hybrid"), "heun 10 ms + my-net, hybrid"),
        (("heun", 0.01, "heun-100ms", "hybrid"), "heun 10 ms + heun-100ms, hybrid"),
        (("heun", None), "heun"),
        (("heun", None, "my-net", ""), "heun + my-net"),
    ],
)
def test_a_label_tells_method_and_step_once(given, label):
    assert naming.integrator_label(*given) == label


def test_api_report_and_viewer_call_an_integrator_the_same():
    class Net:
        name = "my-net"

    one = Integrator("heun", 0.01, Net(), "hybrid")
    row = {"method": "heun", "step": 0.01, "corrector": "my-net", "mode": "hybrid", "is_reference": False}
    as_text = {name: str(value) for name, value in row.items()}
    assert {one.label, cells.integrator(row), cells.integrator(as_text), overview.integrator(row)} == {
        "heun 10 ms + my-net, hybrid"
    }


def test_a_series_is_the_method_and_the_family_at_any_step():
    assert naming.integrator_series("heun") == "heun"
    assert naming.integrator_series("heun", "mlp", "hybrid") == "heun + network, hybrid"
    assert naming.integrator_series("heun", "affine", "enhanced") == "heun + affine, enhanced"


def test_a_long_file_name_is_cut_in_an_id_and_stays_apart_from_others_that_begin_alike():
    assert naming.file_id("a b_c.1") == "a-b-c.1"
    first, second = (naming.file_id("\u00e9" * 200 + end) for end in "xy")
    assert first != second and first[:30] == second[:30] and len(first.encode()) <= naming.LONGEST
