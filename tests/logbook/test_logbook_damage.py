"""Damaged logs: a clear error or a correct partial read, never a traceback or a wrong number; their repair."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from logbook_example import ATTACHMENTS, RESULT, RUN, differing, example, same_bits, with_states
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap.writer import Writer

from fatigue_runner.logbook import (
    LogError,
    LogTail,
    LogWriter,
    check,
    read_log,
    read_metadata,
    recover,
    summarise,
    write_log,
)
from fatigue_runner.logbook.records import walk
from fatigue_runner.trajectory import Trajectory

ROWS = 80


def write_whole(folder: Path, compression: str, run: Trajectory | None = None) -> Path:
    """A whole log of ten chunks or so."""
    path = folder / f"{compression}.mcap"
    with LogWriter(path, run=RUN, attachments=ATTACHMENTS, compression=compression, chunk_size=6_000) as log:
        log.append(run or example(ROWS))
        log.result.update(RESULT)
    return path


@pytest.fixture(scope="module", params=["zstd", "lz4", "none"])
def whole(request, tmp_path_factory) -> Path:
    return write_whole(tmp_path_factory.mktemp("whole"), request.param)


@pytest.fixture(scope="module")
def zstd_log(tmp_path_factory) -> Path:
    return write_whole(tmp_path_factory.mktemp("whole"), "zstd")


def damaged_copy(data: bytes, rng: np.random.Generator) -> tuple[str, bytes]:
    """One way in which disks, cables and editors damage a file, and the damaged bytes."""
    kind = rng.choice(
        [
            "cut",
            "flips",
            "cut and flips",
            "garbage block",
            "zero block",
            "hole",
            "insertion",
            "repeat",
            "tail",
            "noise",
        ]
    )
    out = bytearray(data)
    size = len(out)
    at = int(rng.integers(size))
    length = int(min(rng.integers(1, 3000), size - at))
    if "cut" in kind:
        del out[at:]
    if "flips" in kind:
        for place in rng.integers(len(out) or 1, size=int(rng.integers(1, 9))) if out else ():
            out[place] ^= 1 << int(rng.integers(8))
    if kind == "garbage block":
        out[at : at + length] = rng.bytes(length)
    elif kind == "zero block":
        out[at : at + length] = bytes(length)
    elif kind == "hole":
        del out[at : at + length]
    elif kind == "insertion":
        out[at:at] = rng.bytes(length)
    elif kind == "repeat":
        out[at:at] = out[at : at + length]
    elif kind == "tail":
        out += rng.bytes(length)
    elif kind == "noise":
        out = bytearray(data[:8] + rng.bytes(length))
    return str(kind), bytes(out)


def assert_true_prefix(log, whole_trajectory) -> None:
    """All that a log of a damaged file says is true, as far as it goes."""
    assert differing(log, whole_trajectory, len(log.time)) == []
    assert not log.run or RUN.items() <= log.run.items()
    assert not log.result or RESULT.items() <= log.result.items()
    assert all(ATTACHMENTS[name] == data for name, data in log.attachments.items())


def assert_whole(log, whole_trajectory) -> None:
    assert len(log.time) == ROWS
    assert_true_prefix(log, whole_trajectory)
    assert log.run and log.result and log.attachments == ATTACHMENTS


def challenge(path: Path, original: bytes, trajectory) -> None:
    """Every way of reading a damaged file; a LogError is the only error there may be."""
    is_intact = path.read_bytes() == original
    try:
        assert_whole(read_log(path), trajectory)
    except LogError as error:
        assert not is_intact and "\n" not in str(error) and str(path) in str(error)
    rows = 0
    try:
        log = read_log(path, partial=True)
        assert_true_prefix(log, trajectory)
        assert log.complete == (log.lost == "") and (not log.complete or len(log.time) == ROWS)
        rows = len(log.time)
        assert summarise(path).rows == rows
    except LogError:
        assert not is_intact
    try:
        metadata = read_metadata(path)
        assert "run" not in metadata or RUN.items() <= metadata["run"].items()
    except LogError:
        assert not is_intact
    try:
        found = check(path)
        assert found.ok == is_intact
    except LogError:
        assert not is_intact
    assert_recovers(path, trajectory, rows)
    assert_follows(path, trajectory)


def assert_recovers(path: Path, trajectory, rows: int) -> None:
    copy = path.with_name("repaired.mcap")
    copy.unlink(missing_ok=True)
    try:
        done = recover(path, to=copy)
    except LogError:
        assert not copy.exists()
        return
    log = read_log(copy)
    assert check(copy).ok and done.rows == len(log.time) == rows
    assert_true_prefix(log, trajectory)
    assert rows == ROWS or any("row" in sentence for sentence in done.lost), "a loss that is not told"


def assert_follows(path: Path, trajectory) -> None:
    try:
        with LogTail(path) as tail:
            block = tail.poll()
    except LogError:
        return
    if block is not None:
        assert differing(block, trajectory, len(block.time)) == []


@pytest.mark.parametrize("batch", range(10))
def test_three_hundred_damaged_files_end_in_a_clear_error_or_a_correct_partial_read(whole, tmp_path, batch):
    original, trajectory = whole.read_bytes(), example(ROWS)
    rng = np.random.default_rng([batch, len(original)])
    for _ in range(10):
        path = tmp_path / "damaged.mcap"
        kind, data = damaged_copy(original, rng)
        path.write_bytes(data)
        try:
            challenge(path, original, trajectory)
        except Exception as error:
            error.add_note(f"damage: {kind}, {len(data)} of {len(original)} bytes")
            raise


def test_a_cut_at_every_record_boundary_is_a_correct_partial_read(zstd_log, tmp_path):
    original, trajectory = zstd_log.read_bytes(), example(ROWS)
    path = tmp_path / "damaged.mcap"
    for record in walk(original):
        path.write_bytes(original[: record.end])
        challenge(path, original, trajectory)


@pytest.mark.parametrize("more", [False, True], ids=["the turbine's states", "and two more"])
def test_a_flipped_bit_in_any_byte_before_the_chunks_is_never_believed(tmp_path, more):
    """Schemas, channels and metadata, also where the end of the file with its checksum is gone."""
    trajectory = with_states(example(ROWS)) if more else example(ROWS)
    original = write_whole(tmp_path, "zstd", trajectory).read_bytes()
    chunks = [r for r in walk(original) if r.opcode == Opcode.CHUNK]
    cut = original[: chunks[1].end]
    path = tmp_path / "damaged.mcap"
    rng = np.random.default_rng(1)
    for place in range(8, chunks[0].start + 80, 5):
        data = bytearray(cut)
        data[place] ^= 1 << int(rng.integers(8))
        path.write_bytes(data)
        try:
            log = read_log(path, partial=True)
            assert_true_prefix(log, trajectory)
            assert [c.name for c in log.states] == [c.name for c in trajectory.states]
        except LogError as error:
            assert "\n" not in str(error)


# --- what a refusal says
# ----------------------------------------------------------------------------------------


def test_a_cut_log_is_refused_with_what_is_good_and_the_way_out(whole, tmp_path):
    path = tmp_path / "cut.mcap"
    path.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    with pytest.raises(LogError) as error:
        read_log(path)
    assert "the file is cut off" in str(error.value)
    assert f"fatigue-runner logs recover {path}" in str(error.value)
    partial = read_log(path, partial=True)
    assert 0 < len(partial.time) < ROWS and not partial.complete and "cut off" in partial.lost


def test_a_missing_chunk_in_the_middle_ends_the_partial_read_before_it(whole, tmp_path):
    """A gap in a load history would be a cycle that never was."""
    original = whole.read_bytes()
    chunks = [r for r in walk(original) if r.opcode == Opcode.CHUNK]
    path = tmp_path / "gap.mcap"
    path.write_bytes(original[: chunks[2].start] + original[chunks[3].start :])
    log = read_log(path, partial=True)
    assert differing(log, example(ROWS), len(log.time)) == []
    assert 0 < len(log.time) < ROWS and "rows are missing" in log.lost


def test_a_damaged_index_or_summary_costs_no_row(whole, tmp_path):
    original = whole.read_bytes()
    path = tmp_path / "damaged.mcap"
    indexes = [r for r in walk(original) if r.opcode == Opcode.MESSAGE_INDEX]
    for place in (indexes[3].start + 40, len(original) - 60):
        data = bytearray(original)
        data[place] ^= 0x10
        path.write_bytes(data)
        assert not check(path).ok
        assert len(read_log(path, partial=True).time) == ROWS
        done = recover(path)
        assert done.rows == ROWS and done.lost == [] and done.changed
        assert check(path).ok and check(path).complete
        assert differing(read_log(path), example(ROWS)) == []


# --- check
# ------------------------------------------------------------------------------------------------------


def test_check_finds_nothing_wrong_with_a_whole_log(whole):
    found = check(whole)
    assert found.ok and found.complete and found.rows == ROWS and found.messages == 4 * ROWS - 1


@pytest.mark.parametrize(
    ("kind", "problem"),
    [
        (Opcode.CHUNK, "chunk"),
        (Opcode.MESSAGE_INDEX, "message index"),
        (Opcode.METADATA, "metadata"),
        (Opcode.ATTACHMENT, "attachment"),
        (Opcode.STATISTICS, "summary"),
        (Opcode.CHUNK_INDEX, "summary"),
    ],
)
def test_check_names_the_kind_of_record_that_is_damaged(whole, tmp_path, kind, problem):
    data = bytearray(whole.read_bytes())
    record = [r for r in walk(bytes(data)) if r.opcode == kind][-1]
    data[record.end - 6] ^= 0x04
    path = tmp_path / "damaged.mcap"
    path.write_bytes(data)
    assert any(problem in found for found in check(path).problems)


def test_check_finds_a_signed_chunk_without_a_message(tmp_path):
    """As a program may write it that filters messages out: the checksum is right, and nothing is inside."""
    path = write_log(tmp_path / "a.mcap", example(ROWS), compression="none")
    data = bytearray(path.read_bytes())
    chunk = next(r for r in walk(bytes(data)) if r.opcode == Opcode.CHUNK)
    begin = chunk.end - struct.unpack_from("<Q", data, chunk.start + 9 + 16)[0]
    at = begin
    while at < chunk.end:
        data[at] = 0x80  # an opcode of no meaning
        at += 9 + struct.unpack_from("<Q", data, at + 1)[0]
    struct.pack_into("<I", data, chunk.start + 9 + 24, zlib.crc32(data[begin : chunk.end]))
    path.write_bytes(data)
    assert not check(path).ok
    for partial in (False, True):
        with pytest.raises(LogError):
            read_log(path, partial=partial)


@pytest.mark.parametrize(
    ("library", "wrong"), [("fatigue-runner 1", ["times go backwards"]), ("another", [])]
)
def test_check_finds_times_that_go_backwards_in_our_logs(tmp_path, library, wrong):
    """Other writers may put messages in any order."""
    path = tmp_path / "backwards.mcap"
    with open(path, "wb") as stream:
        writer = Writer(stream, enable_data_crcs=True)
        writer.start(library=library)
        channel = writer.register_channel("/camera", "json", writer.register_schema("x", "jsonschema", b"{}"))
        for time in (0, 20, 10):
            writer.add_message(channel, time, b"{}", time)
        writer.finish()
    told = [p.split(" (")[0] for p in check(path).problems]
    assert [p for p in told if "backwards" in p] == wrong


def test_check_accepts_a_file_of_the_librarys_writer(tmp_path):
    path = tmp_path / "library.mcap"
    with open(path, "wb") as stream:
        writer = Writer(stream, chunk_size=200)
        writer.start()
        channel = writer.register_channel("/x", "json", writer.register_schema("x", "jsonschema", b"{}"))
        for time in range(100):
            writer.add_message(channel, time, b"{}", time)
        writer.add_metadata("note", {"a": "b"})
        writer.add_attachment(1, 2, "a.txt", "text/plain", b"abc")
        writer.finish()
    assert check(path).problems == []


# --- recovery
# ---------------------------------------------------------------------------------------------------


def test_recovery_of_a_part_file_gives_it_its_final_name_and_says_what_was_lost(whole, tmp_path):
    part = tmp_path / "case.mcap.part"
    part.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    done = recover(part)
    assert done.path == tmp_path / "case.mcap" and not part.exists()
    assert any(f"every row after {done.end_time:g} s: {done.rows} rows are kept" in s for s in done.lost)
    assert any("result" in s for s in done.lost)
    log = read_log(done.path)
    assert len(log.time) == done.rows and not log.complete and not check(done.path).complete
    assert read_metadata(done.path)["recovery"]["kept_rows"] == str(done.rows)


def test_recovery_never_overwrites_another_file(whole, tmp_path):
    cut, other = tmp_path / "case.mcap.part", tmp_path / "case.mcap"
    cut.write_bytes(whole.read_bytes()[:-100])
    other.write_bytes(b"precious")
    with pytest.raises(LogError, match="is there already"):
        recover(cut, to=other)
    done = recover(cut)
    assert done.path == cut and other.read_bytes() == b"precious"


def test_recovery_leaves_a_whole_log_as_it_is(whole, tmp_path):
    path = tmp_path / "a.mcap"
    path.write_bytes(whole.read_bytes())
    assert not recover(path).changed
    recover(path, to=tmp_path / "b.mcap")
    assert path.read_bytes() == (tmp_path / "b.mcap").read_bytes() == whole.read_bytes()


def test_recovery_of_a_file_without_a_whole_chunk_is_refused_and_leaves_it(whole, tmp_path):
    path = tmp_path / "a.mcap"
    data = whole.read_bytes()[:1500]
    path.write_bytes(data)
    with pytest.raises(LogError, match="no whole chunk"):
        recover(path)
    assert path.read_bytes() == data and list(tmp_path.iterdir()) == [path]


def test_a_recovered_log_opens_in_the_strict_reader_and_can_be_searched(whole, tmp_path):
    path = tmp_path / "a.mcap"
    path.write_bytes(whole.read_bytes()[: whole.stat().st_size * 2 // 3])
    done = recover(path)
    assert all(record is not None for record in StreamReader(str(path), validate_crcs=True).records)
    with open(path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert reader.get_summary().statistics.message_count == 4 * done.rows - 1
        found = list(reader.iter_messages(starting_at=int(done.end_time * 1e9) - 1))
    assert {c.topic for _, c, _ in found} == {"/turbine/state", "/turbine/loads", "/solver/status", "/wind"}


def test_a_log_that_is_still_being_written_is_not_recovered(tmp_path):
    with LogWriter(tmp_path / "a.mcap", chunk_size=6_000) as log:
        log.append(example(ROWS))
        with pytest.raises(LogError, match="still being written"):
            recover(log.part)
    assert same_bits(read_log(log.path).time, example(ROWS).time)


def test_a_written_log_loses_a_row_and_is_not_complete(tmp_path):
    path = write_log(tmp_path / "a.mcap", example(ROWS))
    assert read_log(path).complete and read_log(path).result["rows"] == str(ROWS)
