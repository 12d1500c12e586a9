"""`fatigue-runner logs`: info, check, recover, export."""

from __future__ import annotations

import csv
import os

import numpy as np
import pytest
from logbook_example import ATTACHMENTS, RESULT, RUN, example, same_bits
from typer.testing import CliRunner

from fatigue_runner.channels import LOAD_NAMES
from fatigue_runner.errors import FatigueRunnerError
from fatigue_runner.logbook import LogError, check, export, summarise, write_log
from fatigue_runner.logbook.commands import app


@pytest.fixture
def log_path(tmp_path):
    return write_log(tmp_path / "case.mcap", example(), RUN, ATTACHMENTS, RESULT)


def logs(*arguments: object) -> tuple[int, str]:
    """Exit code and output of `fatigue-runner logs` with the arguments; errors as the program prints them."""
    result = CliRunner().invoke(app, [str(a) for a in arguments], env={"COLUMNS": "200"})
    if isinstance(result.exception, FatigueRunnerError):
        return result.exception.exit_code, f"error: {result.exception}"
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result.exit_code, result.output


# --- summary
# ----------------------------------------------------------------------------------------------------


def guarded(rejected: list[int]):
    """A run of 11 rows, an interval a second, in which these intervals were rejected; wind = time."""
    trajectory = example(11)
    trajectory.time = np.arange(11.0)
    trajectory.wind[:, 0] = np.arange(11.0)
    trajectory.accepted = ~np.isin(np.arange(10), rejected)
    return trajectory


def test_summary_counts_acceptance_and_finds_where_it_was_rejected(tmp_path):
    summary = summarise(write_log(tmp_path / "a.mcap", guarded([0, 4, 5, 6])))
    assert summary.acceptance_rate == 0.6 and summary.rejected == 4
    longest, other = summary.rejections
    assert (longest.begin, longest.end, longest.intervals, longest.wind_speed) == (4.0, 7.0, 3, 5.5)
    assert (other.begin, other.end, other.intervals, other.wind_speed) == (0.0, 1.0, 1, 0.5)
    assert summary.rejected_wind is not None and summary.rejected_wind[1] == 5.5


def test_summary_of_a_method_without_a_test_praises_no_acceptance(tmp_path):
    trajectory = guarded([])
    trajectory.threshold = np.full(10, np.nan)
    assert summarise(write_log(tmp_path / "a.mcap", trajectory)).acceptance_rate is None


def test_summary_gives_extremes_with_their_times_and_counts_what_is_not_finite(tmp_path):
    trajectory = guarded([])
    trajectory.loads = {"rotor_thrust": np.array([0, 5, -2, 9, 1, np.nan, 0, 0, 0, 0, 0], float)}
    thrust = summarise(write_log(tmp_path / "a.mcap", trajectory)).extremes[0]
    assert (thrust.name, thrust.unit, thrust.not_finite) == ("rotor_thrust", "N", 1)
    assert (thrust.minimum, thrust.time_of_minimum, thrust.maximum, thrust.time_of_maximum) == (-2, 2, 9, 3)
    assert thrust.mean == 13 / 10


def test_extremes_leave_out_the_start_that_the_campaign_discards(tmp_path):
    trajectory = guarded([])
    trajectory.loads = {"rotor_thrust": np.array([90, 5, -50, 9, 1, 2, 0, 0, 0, 0, 3], float)}
    path = write_log(tmp_path / "a.mcap", trajectory, RUN | {"discard": "3"})
    thrust = summarise(path).extremes[0]
    assert (thrust.minimum, thrust.maximum, thrust.time_of_maximum) == (0, 9, 3)
    assert "extremes after the first 3 s, which do not count" in logs("info", path)[1]
    # a case that ended before the counted time has nothing else to show
    ended = write_log(tmp_path / "b.mcap", trajectory, RUN | {"discard": "20"})
    assert summarise(ended).extremes[0].maximum == 90


# --- info
# -------------------------------------------------------------------------------------------------------


def test_info_says_what_ran_how_often_it_was_accepted_and_the_extremes(log_path):
    code, text = logs("info", log_path)
    assert code == 0
    for words in (RUN["case_id"], RUN["turbine_hash"], "400 rows", "50 rows per second", "complete"):
        assert words in text
    assert f"acceptance: {example().accepted.mean():.2%}" in text and "rejected" in text
    assert "rotor_thrust" in text and "kN" in text and "campaign.yaml" in text


def test_info_says_in_a_sentence_what_ran_and_how_close_the_guard_came(tmp_path):
    trajectory = guarded([4])
    trajectory.discrepancy = np.where(np.arange(10) == 4, 1.5, 0.25)
    trajectory.threshold = np.full(10, 0.5)
    run = {
        "case_id": "a", "turbine": "nrel5mw", "method": "rk4", "step": "0.1", "corrector": "rk4-100ms", "mode": "hybrid",
        "is_reference": "False", "wind_source": "turbulent", "wind_speed": "8.0", "turbulence_intensity": "0.14", "seed": "3",
    }  # fmt: skip
    error = np.linspace(1e-6, 1e-5, 10)
    path = write_log(tmp_path / "a.mcap", trajectory, run, None, {"status": "done"}, reference_error=error)
    text = logs("info", path)[1]
    assert (
        "rk4 at 100 ms, corrected by rk4-100ms (hybrid), on nrel5mw in turbulent wind of 8 m/s, intensity 0.14, seed 3: done"
    ) in text
    assert "discrepancy over threshold: median 0.5, largest 3 at 5 s" in text
    assert "rejected 4.000 to 5.000 s (1 intervals)" in text
    assert (
        "error against the reference, in ranges of the states: median 5.5e-06, largest 1.0e-05 at 10 s"
        in text
    )


def test_info_shows_equivalent_loads_with_their_errors_as_a_table_and_all_shows_them_as_they_are(tmp_path):
    load = "blade1_root_flapwise_moment_m10"
    result = {f"del_{load}": 4.928e6, f"del_error_{load}": -0.00123, "nrmse_edge": 0.5, "nrmse_max": 0.25}
    path = write_log(tmp_path / "a.mcap", example(), RUN, None, result)
    assert [(e.value, e.error) for e in summarise(path).equivalent_loads] == [(4.928e6, -0.00123)]
    text = logs("info", path)[1]
    assert "m = 10" in text and "4928" in text and "-1.2e-03" in text, "kN.m, as a person reads it"
    assert "nrmse_max" in text and "nrmse_edge" not in text
    text = logs("info", "--all", path)[1]
    assert "m = 10" not in text and f"del_{load}" in text and "4928000.0" in text and "nrmse_edge" in text


def test_info_of_a_cut_log_tells_what_is_there_and_that_it_is_damaged(log_path):
    os.truncate(log_path, log_path.stat().st_size // 2)
    code, text = logs("info", log_path)
    assert code == 2 and "no row of it can be read" in text, "its one chunk is cut"
    write_log(log_path, example(4000), RUN)
    os.truncate(log_path, log_path.stat().st_size - 500_000)
    code, text = logs("info", log_path)
    assert code == 0 and "not complete" in text and "cut off" in text


# --- check and recover
# ------------------------------------------------------------------------------------------


def test_check_of_a_folder_names_the_damaged_log_and_ends_with_1(log_path):
    other = log_path.with_name("other.mcap")
    data = bytearray(log_path.read_bytes())
    data[len(data) // 2] ^= 1
    other.write_bytes(data)
    code, text = logs("check", log_path)
    assert code == 0 and "good" in text and "400 rows" in text
    code, text = logs("check", log_path.parent)
    assert code == 1 and text.count("good") >= 1 and f"wrong {other}" in text and "checksum" in text


def test_check_of_a_file_that_is_no_log_ends_with_2(tmp_path):
    (tmp_path / "a.txt").write_text("hello")
    assert logs("check", tmp_path / "a.txt")[0] == 2
    code, text = logs("check", tmp_path)
    assert code == 2 and "there is no log (.mcap) in" in text


def test_recover_repairs_a_part_file_and_says_what_was_lost(tmp_path):
    whole = write_log(tmp_path / "whole.mcap", example(4000), RUN)
    part = tmp_path / "case.mcap.part"
    part.write_bytes(whole.read_bytes()[: whole.stat().st_size * 3 // 4])
    code, text = logs("recover", part)
    assert code == 0 and f"repaired: {tmp_path / 'case.mcap'}" in text and "lost: every row after" in text
    found = check(tmp_path / "case.mcap")
    assert found.ok and not found.complete
    code, text = logs("recover", whole)
    assert code == 0 and "nothing to repair" in text


# --- export
# -----------------------------------------------------------------------------------------------------


def test_csv_reads_back_as_the_same_numbers(log_path, tmp_path):
    out = tmp_path / "a.csv"
    code, text = logs("export", log_path, "-o", out, "-c", "blade*_root_flapwise_moment", "-c", "accepted")
    assert code == 0 and "blade3_root_flapwise_moment" in text
    with open(out, newline="") as stream:
        rows = list(csv.DictReader(stream))
    flap = [f"blade{i}_root_flapwise_moment" for i in (1, 2, 3)]
    assert list(rows[0]) == ["time", *flap, "accepted"]
    for name in flap:
        assert same_bits(np.array([float(row[name]) for row in rows]), example().loads[name])
    assert same_bits(np.array([float(row["time"]) for row in rows]), example().time)
    assert rows[0]["accepted"] == "", "no interval ends at the first row"
    assert [float(row["accepted"]) for row in rows[1:]] == example().accepted.tolist()


def test_parquet_holds_every_channel_to_the_bit_with_its_unit(log_path, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    names = export(log_path, None, tmp_path / "a.parquet")
    table = parquet.read_table(tmp_path / "a.parquet")
    assert table.column_names == names and len(names) == 1 + 16 + len(LOAD_NAMES) + 3 + 4
    assert same_bits(table["rotor_thrust"].to_numpy(), example().loads["rotor_thrust"])
    assert table.schema.field("rotor_thrust").metadata[b"unit"] == b"N"


@pytest.mark.parametrize(
    ("channels", "name", "message"),
    [
        (["rotor_trust"], "a.csv", "no channel 'rotor_trust' in the log; did you mean 'rotor_thrust'"),
        (None, "a.xlsx", r"the name must end in \.csv or \.parquet"),
        (None, "no/a.csv", "is not a folder"),
    ],
)
def test_an_export_that_cannot_be_is_refused_and_leaves_nothing(log_path, tmp_path, channels, name, message):
    with pytest.raises(LogError, match=message):
        export(log_path, channels, tmp_path / name)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["case.mcap"]


def test_a_damaged_log_is_not_exported_as_if_it_were_whole(log_path, tmp_path):
    os.truncate(log_path, log_path.stat().st_size // 2)
    code, text = logs("export", log_path, "-o", tmp_path / "a.csv")
    assert code == 2 and not (tmp_path / "a.csv").exists() and "cut off" in text


@pytest.mark.parametrize("command", ["info", "check", "recover", "export"])
def test_help_of_every_command_has_an_example(command):
    code, text = logs(command, "--help")
    assert code == 0 and f"fatigue-runner logs {command} " in text
