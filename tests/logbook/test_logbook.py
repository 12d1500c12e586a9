"""Logs: what is written comes back to the bit."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays as numpy_arrays
from logbook_example import ATTACHMENTS, COMPRESSIONS, RESULT, RUN, differing, example, same_bits
from mcap.opcode import Opcode
from mcap.reader import make_reader

from fatigue_runner import channels
from fatigue_runner.fatigue import damage_equivalent_load
from fatigue_runner.logbook import LogError, LogWriter, check, read_log, read_metadata, write_log
from fatigue_runner.logbook.records import walk


def test_every_array_comes_back_to_the_bit(log_path):
    log = read_log(log_path)
    assert differing(log, example(3000)) == []
    assert log.complete and log.lost == ""


def test_metadata_counters_and_attachments_come_back(log_path):
    log, written = read_log(log_path), example(3000)
    assert RUN.items() <= log.run.items()
    assert RESULT.items() <= log.result.items()
    assert log.attachments == ATTACHMENTS
    assert log.units["rotor_thrust"] == "N" and log.units["rotor_speed"] == "rad/s"
    assert (log.steps, log.evaluations, log.clamped_lookups, log.wall_time, log.diverged_at) == (
        written.steps,
        written.evaluations,
        written.clamped_lookups,
        written.wall_time,
        None,
    )


def test_damage_from_the_log_is_damage_in_memory_bit_for_bit(log_path):
    written, log = example(3000), read_log(log_path)
    for channel in channels.FATIGUE_CHANNELS:
        for exponent in (3, 10):
            from_memory = damage_equivalent_load(written.loads[channel], exponent, written.duration)
            from_log = damage_equivalent_load(log.loads[channel], exponent, log.duration)
            assert from_log == from_memory


def test_optional_status_comes_back_and_is_absent_where_unknown(tmp_path):
    error, clamped = np.linspace(0, 1e-3, 399), np.arange(399, dtype=np.uint32)
    path = write_log(tmp_path / "a.mcap", example(), reference_error=error, clamped_lookups=clamped)
    log = read_log(path)
    assert same_bits(log.reference_error, error) and same_bits(log.clamped_lookups_at, clamped)
    plain = read_log(write_log(tmp_path / "b.mcap", example()))
    assert plain.reference_error.size == 0 and plain.clamped_lookups_at.size == 0


def test_metadata_of_any_type_and_from_any_file_name_can_be_written(tmp_path):
    run = {"seed": 3, "step": np.float64(0.1), "corrector": None, "path": "runs/\udce4.yaml", "note": "Böe"}
    log = read_log(write_log(tmp_path / "a.mcap", example(5), run, {"\udce4.yaml": b"x"}))
    assert [log.run[k] for k in run] == ["3", "0.1", "", "runs/\\udce4.yaml", "Böe"]
    assert log.attachments == {"\\udce4.yaml": b"x"}


def test_a_diverged_case_says_when(tmp_path):
    trajectory = example(50)
    trajectory.diverged_at = 1 / 3
    log = read_log(write_log(tmp_path / "a.mcap", trajectory))
    assert log.diverged_at == 1 / 3 and log.result["status"] == "diverged"


@pytest.mark.parametrize("rows", [0, 1, 2])
def test_the_shortest_logs_come_back(tmp_path, rows):
    log = read_log(write_log(tmp_path / "a.mcap", example(rows)))
    assert len(log.time) == rows and log.complete
    assert not rows or differing(log, example(rows)) == []


def test_chosen_topics_and_channels_are_all_that_is_written(tmp_path):
    path = write_log(
        tmp_path / "a.mcap",
        example(),
        topics=["state", "loads"],
        channels=["rotor_speed", "rotor_thrust", "blade1_root_flapwise_moment"],
    )
    log, written = read_log(path), example()
    assert set(log.loads) == {"rotor_thrust", "blade1_root_flapwise_moment"}
    speed = channels.STATE_NAMES.index("rotor_speed")
    assert same_bits(log.state[:, speed], written.state[:, speed])
    assert np.isnan(np.delete(log.state, speed, axis=1)).all(), (
        "an unlogged state must never look like a number"
    )
    assert log.wind.shape == (0, 3) and log.accepted.size == 0
    with open(path, "rb") as stream:
        summary = make_reader(stream).get_summary()
    assert {c.topic for c in summary.channels.values()} == {"/turbine/state", "/turbine/loads"}


finite_or_not = st.floats(allow_nan=True, allow_infinity=True, width=64)


@settings(max_examples=25, deadline=None)
@given(
    state=numpy_arrays(float, st.tuples(st.integers(2, 40), st.just(16)), elements=finite_or_not),
    compression=st.sampled_from(COMPRESSIONS),
    chunk=st.integers(1, 5000),
)
def test_any_numbers_in_any_chunk_size_come_back_to_the_bit(tmp_path_factory, state, compression, chunk):
    rows = len(state)
    trajectory = example(rows)
    trajectory.state = state
    path = tmp_path_factory.mktemp("any") / "a.mcap"
    with LogWriter(path, compression=compression, chunk_size=chunk, sync=False) as log:
        log.append(trajectory)
    assert differing(read_log(path), trajectory) == []


def test_metadata_are_read_without_touching_the_chunks(log_path, tmp_path):
    data = bytearray(log_path.read_bytes())
    chunks = [r for r in walk(bytes(data)) if r.opcode == Opcode.CHUNK]
    data[chunks[0].start + 9 : chunks[-1].end] = bytes(chunks[-1].end - chunks[0].start - 9)
    path = tmp_path / "hollow.mcap"
    path.write_bytes(data)
    metadata = read_metadata(path)
    assert RUN.items() <= metadata["run"].items() and RESULT.items() <= metadata["result"].items()


def test_a_log_is_complete_only_with_its_end_its_result_and_all_of_its_rows(log_path, tmp_path):
    assert check(log_path).complete
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(log_path.read_bytes()[:-1])
    assert not check(cut).complete
    with LogWriter(tmp_path / "short.mcap") as log:
        log.append(example(5))
        log.rows = 6  # as if a row had been lost on its way into the file
    assert not check(tmp_path / "short.mcap").complete


def test_names_that_are_missing_or_no_log_are_refused_in_one_sentence(tmp_path):
    text, empty = tmp_path / "results.csv", tmp_path / "empty.mcap"
    text.write_text("case_id,wind_speed")
    empty.touch()
    for path, words in [
        (text, "is not an MCAP log"),
        (empty, "is empty"),
        (tmp_path, "is a folder"),
        (tmp_path / "no.mcap", "no log"),
    ]:
        for read in (read_log, read_metadata):
            with pytest.raises(LogError, match=words) as error:
                read(path)
            assert "\n" not in str(error.value) and error.value.exit_code == 2
