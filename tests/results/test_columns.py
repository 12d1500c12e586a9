"""The results table's columns are data: each has a meaning and a unit, and the lists made of them agree."""

from __future__ import annotations

import csv
import io

import pytest

from fatigue_runner.channels import FATIGUE_CHANNELS, LOAD_NAMES, STATE_NAMES, STATES, Channel
from fatigue_runner.errors import InputError
from fatigue_runner.results import Results, read_results
from fatigue_runner.results.columns import DESCRIPTION, WIND, columns, fatigue_keys, table

TABLE = table(FATIGUE_CHANNELS, [3.0, 10.0])


def test_every_column_has_a_name_of_its_own_a_meaning_and_a_unit_where_it_is_a_number():
    assert len({column.name for column in TABLE}) == len(TABLE)
    assert all(column.meaning for column in TABLE)
    assert all(column.unit for column in TABLE if column.kind in ("number", "whole"))
    assert {column.name: column.unit for column in TABLE}["del_blade1_root_flapwise_moment_m3"] == "N.m"
    assert {column.name: column.unit for column in TABLE}["max_rotor_thrust"] == "N"


def test_the_identities_are_parts_of_the_table():
    assert (
        *("wind_source", "wind_speed", "vertical_shear", "horizontal_shear", "shear_exponent"),
        *("roughness_length", "turbulence_intensity", "harmonics", "yaw_misalignment_deg", "upflow_deg"),
        *("tower_influence", "seed", "gust", "wind_file"),
    ) == WIND
    integrator = ("method", "step", "corrector", "mode", "is_reference")
    assert (*WIND, "operation", "pitch_deg", *integrator) == DESCRIPTION


def test_states_loads_and_exponents_have_their_columns():
    names = columns(FATIGUE_CHANNELS, [3.0, 10.0])
    assert [f"nrmse_{state}" for state in STATE_NAMES] == [
        n for n in names if n.startswith("nrmse_") and n not in ("nrmse_max", "nrmse_mean")
    ]
    for _, _, suffix in fatigue_keys(FATIGUE_CHANNELS, [3.0, 10.0]):
        assert {f"del_{suffix}", f"del_error_{suffix}", f"damage_ratio_{suffix}"} <= set(names)
    figures = ("mean", "min", "max", "std", "min_time", "max_time")
    ours = [f"{f}_{name}" for name in (*LOAD_NAMES, "rotor_speed") for f in figures]
    assert names[-len(ours) :] == ours


def test_a_controller_s_states_have_errors_of_their_own():
    own = Channel("filtered_generator_speed", "rad/s", "filtered generator speed", "rpm")
    names = columns(FATIGUE_CHANNELS, [3.0], (*STATES, own))
    assert "nrmse_filtered_generator_speed" in names and len(set(names)) == len(names)


def written(folder, rows):
    names = ["case_id", "method", "step", "is_reference", "status", "seed"]
    Results(folder, names, [dict.fromkeys(names) | row for row in rows]).write()
    return read_results(folder)


def test_what_is_written_is_read_and_the_unknown_is_empty(tmp_path):
    (row,) = written(tmp_path, [{"case_id": "a", "method": "rk4", "step": 0.1, "is_reference": False}])
    assert row["step"] == "0.1" and row["is_reference"] == "False" and row["seed"] == ""


def test_parquet_has_the_types_of_the_columns(tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed")
    written(tmp_path, [{"case_id": "a", "step": 0.1, "is_reference": False, "seed": 3}])
    schema = parquet.read_schema(tmp_path / "results.parquet")
    kinds = {name: str(schema.field(name).type) for name in schema.names}
    assert (kinds["case_id"], kinds["step"], kinds["is_reference"], kinds["seed"]) == (
        "string", "double", "bool", "int64",
    )  # fmt: skip


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "holds no results.csv"),
        ("case_id,method\n", "has no cases"),
        ("speed,power\n1,2\n", "lacks the column 'case_id'"),
    ],
)
def test_another_table_is_refused_in_a_sentence(tmp_path, text, message):
    if text is not None:
        assert list(csv.reader(io.StringIO(text)))
        (tmp_path / "results.csv").write_text(text)
    with pytest.raises(InputError, match=message):
        read_results(tmp_path)
