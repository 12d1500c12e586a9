"""A log holds states beyond the turbine's under their names, and a run without them has the log that it always had."""

from __future__ import annotations

import csv
from dataclasses import replace

import numpy as np
import pytest
from logbook_example import MORE, RUN, differing, example, same_bits, with_states

from fatigue_runner import channels
from fatigue_runner.errors import InputError
from fatigue_runner.logbook import LogError, LogTail, LogWriter, check, export, read_log, summarise, write_log
from fatigue_runner.results.accuracy import compare

NAMES = [c.name for c in MORE]


def test_they_come_back_to_the_bit_with_name_and_unit(tmp_path):
    run = with_states(example())
    path = write_log(tmp_path / "a.mcap", run, RUN)
    log = read_log(path)
    assert check(path).complete and differing(log, run) == []
    assert [(c.name, c.unit) for c in log.states] == [(c.name, c.unit) for c in run.states]


def test_they_change_nothing_of_a_log_without_them(tmp_path):
    log = read_log(write_log(tmp_path / "a.mcap", example(), RUN))
    assert log.states == channels.STATES and log.state.shape[1] == len(channels.STATES)


def test_a_log_keeps_those_that_are_asked_for(tmp_path):
    run = with_states(example())
    log = read_log(write_log(tmp_path / "a.mcap", run, channels=["rotor_speed", NAMES[1]]))
    assert [c.name for c in log.states[len(channels.STATES) :]] == NAMES[1:]
    assert same_bits(log.state[:, -1], np.ascontiguousarray(run.state[:, -1]))
    with pytest.raises(LogError, match=f"the run does not have it; did you mean '{NAMES[0]}'"):
        write_log(tmp_path / "b.mcap", run, channels=["filtered_sped"])


def test_a_log_that_is_followed_has_them_in_every_block(tmp_path):
    run = with_states(example(60))
    with LogWriter(tmp_path / "a.mcap", run=RUN) as log:
        for rows, status in ((slice(0, 30), slice(0, 29)), (slice(30, 60), slice(29, 59))):
            names = ("accepted", "discrepancy", "threshold", "local_error")
            log.append(
                replace(
                    run, time=run.time[rows], state=run.state[rows], wind=run.wind[rows],
                    loads={name: values[rows] for name, values in run.loads.items()},
                    **{name: getattr(run, name)[status] for name in names},
                )
            )  # fmt: skip
        log.flush()
        with LogTail(tmp_path / "a.mcap") as tail:
            found = tail.poll()
    assert same_bits(found.state, run.state) and found.states == read_log(tmp_path / "a.mcap").states


def test_export_and_info_name_them(tmp_path):
    run = with_states(example())
    path = write_log(tmp_path / "a.mcap", run, RUN)
    assert export(path, NAMES, tmp_path / "a.csv") == ["time", *NAMES]
    with open(tmp_path / "a.csv", newline="") as file:
        assert [float(row[NAMES[0]]) for row in csv.DictReader(file)] == run.state[:, -2].tolist()
    (extreme,) = (e for e in summarise(path).extremes if e.name == NAMES[1])
    assert extreme.maximum == run.state[:, -1].max() and extreme.unit == "N.m"


def test_a_state_that_has_no_column_of_its_own_is_refused(tmp_path):
    with pytest.raises(
        LogError, match=r"the state to log has shape \(400, 18\); it must be \(400, 16 or fewer\)"
    ):
        write_log(tmp_path / "a.mcap", replace(with_states(example()), states=channels.STATES))


def test_the_errors_of_a_run_go_by_its_states(tmp_path):
    clean = replace(example(), state=np.nan_to_num(example().state, posinf=0.0))
    run = with_states(clean)
    off = replace(run, state=run.state + 1e-3)
    assert list(compare(off, run).nrmse) == [c.name for c in run.states]
    with pytest.raises(InputError, match="do not have the same states, filtered_speed, torque_demand differ"):
        compare(run, clean)
