"""Results leave for pandas and pyarrow and come back as the same life; without the libraries one sentence says what to do."""

from __future__ import annotations

import sys

import pytest

import fatigue_runner as fr
from fatigue_runner.errors import InputError
from fatigue_runner.results.table import Results

ROWS = [
    {
        "case_id": f"v{speed}_{seed}_{method}", "wind_speed": float(speed), "seed": seed, "method": method, "step": 0.01, "corrector": None,
        "mode": None, "is_reference": method == "rk7", "status": "done", "del_rotor_thrust_m4": 1e3 * speed * (1 + 0.1 * seed),
        "diverged_at": None,
    }
    for speed in (4, 8, 12) for seed in (1, 2) for method in ("rk7", "heun")
]  # fmt: skip


@pytest.fixture
def results(tmp_path):
    return Results(tmp_path, list(ROWS[0]), ROWS)


def lives(table):
    life = fr.lifetime(table, climate="II", bins={"width": 4})
    return [(f.integrator[0], f.value, f.low, f.high) for f in life.loads]


def test_a_life_is_that_of_the_rows_from_pandas(results):
    pandas = pytest.importorskip("pandas", reason="pandas is optional, and not installed")
    frame = results.to_pandas()
    assert (
        isinstance(frame, pandas.DataFrame)
        and list(frame.columns) == results.columns
        and len(frame) == len(ROWS)
    )
    assert frame["wind_speed"].tolist() == [row["wind_speed"] for row in ROWS]
    assert lives(frame) == lives(ROWS)
    life = fr.lifetime(ROWS, climate="II", bins={"width": 4})
    assert life.to_pandas()["lifetime_del"].tolist() == [f.value for f in life.loads]


def test_a_life_is_that_of_the_rows_from_pyarrow(results):
    pytest.importorskip("pyarrow", reason="pyarrow is optional, and not installed")
    table = results.to_arrow()
    assert table.column_names == results.columns and table["seed"].to_pylist() == [
        row["seed"] for row in ROWS
    ]
    assert lives(table) == lives(ROWS)


@pytest.mark.parametrize("library, leave", [("pandas", "to_pandas"), ("pyarrow", "to_arrow")])
def test_without_the_library_one_sentence_says_what_to_do(results, monkeypatch, library, leave):
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(
        InputError, match=f"{library} is not installed; `pip install {library}`, or use `rows`, plain dicts"
    ):
        getattr(results, leave)()
