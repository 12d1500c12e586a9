"""Writing while a run goes on: blocks, tails, interruptions, and disks that do not take it."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from logbook_example import RUN, differing, example, same_bits
from places import ROOT, TESTS

from fatigue_runner.logbook import (
    LogError,
    LogTail,
    LogWriter,
    check,
    read_log,
    read_metadata,
    recover,
    write_log,
)
from fatigue_runner.logbook import writer as writer_module
from fatigue_runner.trajectory import Trajectory

STATUS = ("accepted", "discrepancy", "threshold", "local_error")


def blocks(trajectory: Trajectory, *sizes: int) -> list[Trajectory]:
    """The trajectory in blocks of these sizes and the rest, counters divided among them."""
    edges = np.cumsum([0, *sizes, len(trajectory.time) - sum(sizes)])
    found = []
    for begin, end in pairwise(edges):
        rows = slice(begin, end)
        intervals = slice(max(begin - 1, 0), end - 1)
        found.append(
            Trajectory(
                trajectory.time[rows],
                trajectory.state[rows],
                trajectory.wind[rows],
                {name: values[rows] for name, values in trajectory.loads.items()},
                **{name: getattr(trajectory, name)[intervals] for name in STATUS},
                steps=int(end - begin),
            )
        )
    return found


@pytest.mark.parametrize("sizes", [(1, 1, 1), (100, 50), (7, 0, 200), (400,)])
def test_a_log_written_in_blocks_is_the_log_written_at_once(tmp_path, sizes):
    with LogWriter(tmp_path / "a.mcap", run=RUN, chunk_size=20_000) as log:
        for block in blocks(example(), *sizes):
            log.append(block)
    read = read_log(tmp_path / "a.mcap")
    assert differing(read, example()) == []
    assert read.complete and read.steps == 400 and check(tmp_path / "a.mcap").ok


def test_the_final_name_appears_only_when_the_log_is_whole(tmp_path):
    path = tmp_path / "a.mcap"
    with LogWriter(path) as log:
        log.append(example())
        assert not path.exists() and log.part.exists()
    assert check(path).complete and not log.part.exists()


def test_a_chunk_is_closed_after_a_second_of_wall_time(tmp_path, monkeypatch):
    clock = [0.0]
    monkeypatch.setattr(writer_module.time, "monotonic", lambda: clock[0])
    with LogWriter(tmp_path / "a.mcap") as log:
        first, second, third = blocks(example(), 100, 100)
        log.append(first)
        assert log.part.stat().st_size < 2000, "before a second has passed only the metadata are there"
        clock[0] = 1.1
        log.append(second)
        assert len(read_log(log.part, partial=True).time) == 200
        log.append(third)
        assert len(read_log(log.part, partial=True).time) == 200
        log.flush()
        assert len(read_log(log.part, partial=True).time) == 400


def test_a_tail_gets_every_row_once_and_sees_the_end(tmp_path):
    path = tmp_path / "a.mcap"
    got: list = []
    with LogWriter(path, run=RUN, chunk_seconds=0) as log, LogTail(path) as tail:
        for block in blocks(example(), 1, 150, 3):
            assert tail.poll() is None and not tail.ended
            log.append(block)
            got.append(tail.poll())
            assert len(got[-1].time) == len(block.time) and got[-1].run["case_id"] == RUN["case_id"]
        log.finish()
        assert tail.poll() is None and tail.ended, "the tail keeps the file through its renaming"
    for name in ("time", "state", "wind", *STATUS):
        joined = np.concatenate([getattr(block, name) for block in got])
        assert same_bits(joined, getattr(example(), name)), name


def test_a_tail_takes_a_record_only_when_it_is_whole(tmp_path):
    whole = write_log(tmp_path / "whole.mcap", example()).read_bytes()
    path = tmp_path / "a.mcap"
    part = tmp_path / "a.mcap.part"
    part.touch()
    rows = 0
    with LogTail(path) as tail, open(part, "ab") as stream:
        for begin in range(0, len(whole), 10_007):
            stream.write(whole[begin : begin + 10_007])
            stream.flush()
            block = tail.poll()
            rows += 0 if block is None else len(block.time)
        assert tail.ended and rows == 400


def test_a_tail_of_nothing_and_of_a_restarted_run_is_refused(tmp_path):
    with pytest.raises(LogError, match="no log"):
        LogTail(tmp_path / "a.mcap")
    with LogWriter(tmp_path / "a.mcap") as log:
        log.append(example())
        log.flush()
        with LogTail(log.path) as tail:
            tail.poll()
            os.truncate(log.part, 0)
            with pytest.raises(LogError, match="begun anew"):
                tail.poll()


def test_an_interrupted_run_leaves_a_part_file_with_every_row(tmp_path):
    path = tmp_path / "a.mcap"
    with pytest.raises(KeyboardInterrupt), LogWriter(path, run=RUN) as log:
        log.append(blocks(example(), 250)[0])
        raise KeyboardInterrupt
    assert not path.exists()
    assert read_metadata(log.part)["run"]["case_id"] == RUN["case_id"]
    assert differing(read_log(log.part, partial=True), example(), 250) == []


_ENDLESS = """
import sys
from itertools import pairwise
sys.path[:0] = {folders!r}
from logbook_example import example
from test_logbook_live import blocks
from fatigue_runner.logbook import LogWriter
log = LogWriter({path!r}, chunk_seconds=0)
for block in blocks(example(), *[10] * 39):
    log.append(block)
    print(log.rows, flush=True)
"""


def test_a_killed_run_can_be_read_and_repaired(tmp_path):
    path = tmp_path / "a.mcap"
    code = _ENDLESS.format(folders=[str(Path(__file__).parent), str(TESTS)], path=str(path))
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, cwd=ROOT, env=os.environ
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if int(line) >= 200:
                process.send_signal(signal.SIGKILL)
                break
    done = recover(tmp_path / "a.mcap.part")
    assert done.path == path and done.rows >= 200 and done.rows % 10 == 0
    assert differing(read_log(path), example(), done.rows) == []


def test_two_writers_of_one_log_are_refused(tmp_path):
    with LogWriter(tmp_path / "a.mcap") as log:
        log.append(example())
        with pytest.raises(LogError, match="being written by another process"):
            LogWriter(tmp_path / "a.mcap")
    assert check(tmp_path / "a.mcap").complete


# --- disks and folders that do not take it
# ----------------------------------------------------------------------


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full on this system")
def test_a_full_disk_is_a_clear_error_and_leaves_nothing(tmp_path):
    os.symlink("/dev/full", tmp_path / "a.mcap.part")
    with pytest.raises(LogError, match=r"cannot write .*a\.mcap: the disk is full"):
        write_log(tmp_path / "a.mcap", example())
    assert list(tmp_path.iterdir()) == []


def test_a_failing_fsync_leaves_nothing_under_the_final_name(tmp_path, monkeypatch):
    def fail(handle: int) -> None:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(os, "fsync", fail)
    with pytest.raises(LogError, match="Input/output error"):
        write_log(tmp_path / "a.mcap", example())
    assert list(tmp_path.iterdir()) == []


def test_an_older_log_survives_a_failed_rewrite(tmp_path, monkeypatch):
    path = write_log(tmp_path / "a.mcap", example())
    before = path.read_bytes()
    with monkeypatch.context() as failing:
        failing.setattr(os, "replace", lambda *_: (_ for _ in ()).throw(OSError(28, "No space left")))
        with pytest.raises(LogError, match="disk is full"):
            write_log(path, example(10))
    assert path.read_bytes() == before


def test_a_folder_that_is_not_there_or_not_writable_is_a_clear_error(tmp_path):
    (tmp_path / "file").touch()
    (tmp_path / "taken.mcap").mkdir()
    for path, words in [
        (tmp_path / "no" / "a.mcap", "is not a folder; make it first"),
        (tmp_path / "file" / "a.mcap", "is not a folder"),
        (tmp_path / "taken.mcap", "a folder of that name"),
    ]:
        with pytest.raises(LogError, match=words):
            write_log(path, example())


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_without_permission_is_a_clear_error(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(LogError, match="no permission"):
        write_log(tmp_path / "a.mcap", example())


# --- wrong arguments
# --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"compression": "zst"}, "unknown log compression 'zst'; did you mean 'zstd'"),
        ({"topics": ["states"]}, "unknown log topic 'states'; did you mean 'state'"),
        ({"topics": ["status"]}, "cannot log the status alone"),
        ({"channels": ["rotor_trust"]}, "'rotor_trust', .* did you mean 'rotor_thrust'"),
        ({"reference_error": np.zeros(5)}, r"reference_error to log has shape \(5,\); it must be \(399,\)"),
    ],
)
def test_wrong_arguments_are_refused_and_leave_nothing(tmp_path, arguments, message):
    with pytest.raises(LogError, match=message):
        write_log(tmp_path / "a.mcap", example(), **arguments)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        ("state", np.zeros((400, 17)), "the state to log has shape"),
        ("wind", np.zeros((399, 3)), "the wind to log has shape"),
        ("loads", {"rotor_thrust": np.zeros(3)}, "load rotor_thrust to log has shape"),
        ("loads", {"rotor_trust": np.zeros(400)}, "unknown load channel 'rotor_trust'; did you mean"),
        ("discrepancy", np.zeros(400), "discrepancy to log has shape"),
        ("time", np.linspace(-1, 7, 400), "count from 0 s"),
        ("time", np.full(400, np.nan), "count from 0 s"),
        ("time", np.linspace(8, 0, 400), "must not go backwards"),
    ],
)
def test_arrays_that_do_not_fit_are_refused_by_name(tmp_path, name, values, message):
    trajectory = example()
    setattr(trajectory, name, values)
    with pytest.raises(LogError, match=message):
        write_log(tmp_path / "a.mcap", trajectory)
    assert list(tmp_path.iterdir()) == []


def test_a_block_that_lacks_what_the_first_had_or_goes_back_is_refused_and_the_log_goes_on(tmp_path):
    first, second = blocks(example(), 200)
    with LogWriter(tmp_path / "a.mcap") as log:
        log.append(first)
        with pytest.raises(LogError, match="must not go backwards"):
            log.append(first)
        without = Trajectory(second.time, second.state, second.wind, {})
        with pytest.raises(LogError, match="the first block had"):
            log.append(without)
        log.append(second)
    assert differing(read_log(tmp_path / "a.mcap"), example()) == []
