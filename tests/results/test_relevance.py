"""An error of a load that is next to nothing does not decide a verdict, and no other is made smaller."""

from __future__ import annotations

import pytest

from fatigue_runner.results import ranking
from fatigue_runner.results.relevance import FLOOR, governing, place_of, relevant, relevant_errors

SIDE, FORE = "tower_base_side_side_moment", "tower_base_fore_aft_moment"
COLUMNS = [(SIDE, 4.0, f"{SIDE}_m4"), (FORE, 4.0, f"{FORE}_m4")]


def row(side: float, side_error: float, fore: float = 2e6, fore_error: float = 1e-4):
    return {
        "case_id": "a", "method": "rk4", "step": 0.05, "is_reference": False, "status": "done", "evaluations_per_second": 80.0,
        f"mean_{SIDE}": 3.605e6, f"mean_{FORE}": 4e7,
        f"del_{SIDE}_m4": side * (1 + side_error), f"del_error_{SIDE}_m4": side_error,
        f"del_{FORE}_m4": fore * (1 + fore_error), f"del_error_{FORE}_m4": fore_error,
    }  # fmt: skip


def test_a_del_of_1_kn_m_on_a_mean_of_thousands_decides_nothing():
    """The quickstart's verdict hung on it."""
    found = relevant_errors(row(1.3e3, 0.1), COLUMNS)
    assert found[f"{SIDE}_m4"] == pytest.approx(0.1 * 1.3e3 / (FLOOR * 4e7))
    (summary,) = ranking.rank([row(1.3e3, 0.1)])
    assert summary.worst_del_error is not None and summary.worst_del_error.size < 1e-3


def test_a_del_that_matters_has_its_error_as_it_is():
    found = relevant_errors(row(2e6, 0.1, fore_error=-0.02), COLUMNS)
    assert found == {f"{SIDE}_m4": 0.1, f"{FORE}_m4": -0.02}


def test_what_governs_is_of_the_same_place():
    assert (
        place_of(FORE) == place_of(SIDE) == "tower_base"
        and place_of("blade1_root_flapwise_moment") == "blade1_root"
    )
    assert governing(SIDE, {FORE: [-5.0, None], SIDE: [1.0], "blade1_root_edgewise_moment": [99.0]}) == 5.0
    assert relevant(0.3, None, 5.0) == relevant(0.3, 1.0, 0.0) == 0.3


def test_a_table_without_means_is_judged_by_its_dels():
    bare = {key: value for key, value in row(1.3e3, 0.1).items() if not key.startswith("mean_")}
    assert relevant_errors(bare, COLUMNS)[f"{SIDE}_m4"] == pytest.approx(0.1 * 1.3e3 / (FLOOR * 2e6))
