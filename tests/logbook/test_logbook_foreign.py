"""Logs that other programs wrote or rewrote, and MCAP files that are no logs at all."""

from __future__ import annotations

import re
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from google.protobuf import descriptor_pb2
from logbook_example import MORE, RUN, differing, example, same_bits, with_states
from mcap.reader import make_reader
from mcap.records import Attachment, Header, Schema
from mcap.writer import CompressionType, IndexType, Writer
from places import ROOT

from fatigue_runner import channels
from fatigue_runner.logbook import LogError, check, read_log, recover, write_log
from fatigue_runner.logbook.container import MAGIC, encode
from fatigue_runner.logbook.generic import message_class
from fatigue_runner.logbook.metadata import read_metadata
from fatigue_runner.logbook.schema import TOPICS, Field


def _rewrite(source: Path, out: Path, begin: int = 0, **changes: object) -> Path:
    """The same messages as another program writes them one by one: other chunks and channel ids.

    begin: messages before it [ns] are left out. changes: topic -> function that makes another message of
    ours; protobuf re-encodes the rest, zeros left out.
    """
    with open(source, "rb") as stream, open(out, "wb") as target:
        reader = make_reader(stream)
        writer = Writer(target, chunk_size=10_000, compression=CompressionType.LZ4)
        writer.start(library="another program")
        writer.register_channel("/camera", "json", 0)
        ids: dict[str, int] = {}
        classes: dict[str, object] = {}
        for schema, channel, message in reader.iter_messages(starting_at=begin):
            ours = classes.setdefault(channel.topic, message_class(schema)).FromString(message.data)
            made = changes.get(channel.topic, lambda same: same)(ours)
            if channel.topic not in ids:
                name, data = _declaration(made) if made is not ours else (schema.name, schema.data)
                schema_id = writer.register_schema(name, "protobuf", data)
                ids[channel.topic] = writer.register_channel(channel.topic, "protobuf", schema_id)
            data = made.SerializeToString()
            writer.add_message(ids[channel.topic], message.log_time, data, message.log_time, message.sequence)
        for metadata in reader.iter_metadata():
            writer.add_metadata(metadata.name, metadata.metadata)
        writer.finish()
    return out


def _declaration(message: object) -> tuple[str, bytes]:
    file = descriptor_pb2.FileDescriptorProto()
    message.DESCRIPTOR.file.CopyToProto(file)
    return message.DESCRIPTOR.full_name, descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString()


def test_a_log_that_another_program_rewrote_comes_back_to_the_bit(tmp_path):
    trajectory = example(300)
    trajectory.loads["rotor_thrust"][7] = 0.0  # which proto3 writers leave out
    path = write_log(tmp_path / "a.mcap", trajectory, RUN)
    log = read_log(_rewrite(path, tmp_path / "b.mcap"))
    assert differing(log, trajectory) == []
    assert log.complete and RUN.items() <= log.run.items()


def test_states_of_first_order_come_back_from_a_file_that_another_program_rewrote(tmp_path):
    trajectory = with_states(example(100))
    log = read_log(_rewrite(write_log(tmp_path / "a.mcap", trajectory, RUN), tmp_path / "b.mcap"))
    assert differing(log, trajectory) == []
    assert [c.name for c in log.states[-2:]] == [c.name for c in MORE]
    assert log.states[-1].unit == "N.m"


def test_a_window_that_a_tool_cut_out_of_a_log_is_read_but_not_complete(tmp_path):
    """As `mcap filter --start` writes it: the first status belongs to an interval that began outside."""
    trajectory = example(100)
    path = write_log(tmp_path / "a.mcap", trajectory)
    log = read_log(_rewrite(path, tmp_path / "b.mcap", begin=800_000_000))
    assert same_bits(log.time, trajectory.time[40:])
    assert same_bits(log.state, trajectory.state[40:])
    assert same_bits(log.discrepancy, trajectory.discrepancy[40:])
    assert not log.complete and log.lost == ""
    assert check(tmp_path / "b.mcap").ok


def _other_wind(ours: object) -> object:
    """Wind by another program's schema: other names around it, other numbers, float32, one signal missing."""
    file = descriptor_pb2.FileDescriptorProto(name="w.proto", package="elsewhere", syntax="proto3")
    message = file.message_type.add(name="Air")
    for number, (name, kind) in enumerate([("gust", 1), ("vertical_shear", 2), ("wind_speed", 2)], 7):
        message.field.add(name=name, number=number, type=kind, label=1)
    data = descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString()
    made = message_class(Schema(1, data, "protobuf", "elsewhere.Air"))()
    made.gust, made.vertical_shear, made.wind_speed = 3.0, ours.vertical_shear, ours.wind_speed
    return made


def test_a_foreign_schema_is_read_by_the_names_of_its_fields(tmp_path):
    trajectory = example(100)
    path = write_log(tmp_path / "a.mcap", trajectory, topics=["wind"])
    log = read_log(_rewrite(path, tmp_path / "b.mcap", **{"/wind": _other_wind}))
    assert np.array_equal(log.wind[:, :2], trajectory.wind[:, :2].astype(np.float32).astype(float))
    assert np.isnan(log.wind[:, 2]).all(), "a signal that the schema lacks is unknown, not 0"
    assert np.allclose(log.time, trajectory.time, rtol=0, atol=1e-9), "without a `time` field, from log_time"


def _write_foreign(path: Path, topic: str, encoding: str) -> Path:
    with open(path, "wb") as stream:
        writer = Writer(stream)
        writer.start()
        channel = writer.register_channel(topic, encoding, writer.register_schema("x", "jsonschema", b"{}"))
        writer.add_message(channel, 0, b"{}", 0)
        writer.finish()
    return path


def test_an_mcap_file_of_another_program_is_refused_with_its_topics(tmp_path):
    path = _write_foreign(tmp_path / "robot.mcap", "/imu", "json")
    with pytest.raises(LogError, match=r"not a turbine log: its topics are /imu; expected /solver/status"):
        read_log(path)


def test_a_topic_of_ours_in_another_encoding_is_refused(tmp_path):
    path = _write_foreign(tmp_path / "a.mcap", "/wind", "json")
    with pytest.raises(LogError, match="'/wind' is encoded as 'json'; it must be protobuf"):
        read_log(path)


def test_a_topic_of_ours_whose_schema_is_no_protobuf_is_refused(tmp_path):
    path = _write_foreign(tmp_path / "a.mcap", "/wind", "protobuf")
    with pytest.raises(LogError, match="schema 'x' is written in 'jsonschema'; it must be protobuf"):
        read_log(path)


def test_a_field_of_a_later_version_is_kept_or_ignored_but_never_mistaken(tmp_path, monkeypatch):
    """A load that only the writer knows: this program reads the rest to the bit."""
    later = replace(
        TOPICS["loads"], fields=(*TOPICS["loads"].fields, Field("yaw_moment", 900, "double", "N.m"))
    )
    trajectory = example(50)
    with monkeypatch.context() as future:
        future.setitem(TOPICS, "loads", later)
        future.setattr(channels, "LOAD_NAMES", (*channels.LOAD_NAMES, "yaw_moment"))
        trajectory.loads["yaw_moment"] = np.arange(50.0)
        path = write_log(tmp_path / "a.mcap", trajectory)
    log = read_log(path)
    assert differing(log, trajectory) == []


def test_the_ten_lines_of_python_in_the_manual_work(tmp_path, monkeypatch, capsys):
    manual = (ROOT / "docs" / "logs.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", manual, flags=re.DOTALL)
    monkeypatch.chdir(tmp_path)
    write_log("case.mcap", example(3), RUN)
    for block in blocks:
        exec(block.replace("runs/quickstart/logs/<case id>.mcap", "case.mcap"), {})
    assert len(blocks) == 2 and max(block.count("\n") for block in blocks) <= 10
    flap = example(3).loads["blade1_root_flapwise_moment"]
    assert str(flap[2]) in capsys.readouterr().out


# what the format leaves to the writer
WRITERS = {
    "no indexes": {"index_types": IndexType.NONE},
    "no message indexes": {"index_types": IndexType.CHUNK},
    "no statistics": {"use_statistics": False},
    "no chunks": {"use_chunking": False},
    "no checksums": {"enable_crcs": False},
    "nothing repeated": {"repeat_channels": False, "repeat_schemas": False, "use_summary_offsets": False},
    "no summary": {
        "index_types": IndexType.NONE, "use_statistics": False, "repeat_channels": False, "repeat_schemas": False
    },
}  # fmt: skip


def _copy(source: Path, out: Path, backwards: bool = False, **options: object) -> Path:
    """The same records by the library's writer."""
    with open(source, "rb") as stream, open(out, "wb") as target:
        reader = make_reader(stream)
        writer = Writer(target, chunk_size=5_000, **options)
        writer.start()
        ids: dict[str, int] = {}
        messages = list(reader.iter_messages())
        for schema, channel, message in reversed(messages) if backwards else messages:
            if channel.topic not in ids:
                schema_id = writer.register_schema(schema.name, schema.encoding, schema.data)
                ids[channel.topic] = writer.register_channel(channel.topic, "protobuf", schema_id)
            writer.add_message(
                ids[channel.topic], message.log_time, message.data, message.log_time, message.sequence
            )
        for metadata in reader.iter_metadata():
            writer.add_metadata(metadata.name, metadata.metadata)
        writer.finish()
    return out


@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize("options", WRITERS.values(), ids=WRITERS)
def test_what_the_format_leaves_to_the_writer_is_no_damage(tmp_path, options, backwards):
    trajectory = example(100)
    path = _copy(write_log(tmp_path / "a.mcap", trajectory, RUN), tmp_path / "b.mcap", backwards, **options)
    assert check(path).problems == []
    log = read_log(path)
    assert differing(log, trajectory) == [] and log.complete
    assert read_metadata(path)["run"].items() >= RUN.items()
    assert not recover(path).changed


def test_what_another_writer_says_is_still_checked(tmp_path):
    """Optional is not arbitrary: a count that is there must be right."""
    path = _copy(write_log(tmp_path / "a.mcap", example(100)), tmp_path / "b.mcap", enable_crcs=False)
    data = path.read_bytes()
    with open(path, "rb") as stream:
        statistics = make_reader(stream).get_summary().statistics
    place = data.rindex(struct.pack("<Q", statistics.message_count), 0, len(data) - 28)
    path.write_bytes(data[:place] + struct.pack("<Q", 7) + data[place + 8 :])
    assert check(path).problems == ["the summary's message counts are not what the file holds"]


def test_a_record_may_be_longer_than_this_version_of_the_format_knows(tmp_path):
    """Readers skip what stands behind the fields they know: here three bytes behind an attachment's checksum."""
    body = encode(Attachment(1, 2, "myFile", "text/plain", b"abc"))[9:]
    end = struct.pack("<BQI", 15, 4, 0) + struct.pack("<BQQQI", 2, 20, 0, 0, 0) + MAGIC
    path = tmp_path / "padded.mcap"
    for pad, wrong in ((b"", 0), (b"\x01\xff\xff", 0), (b"\x01\xff\xff", 1)):
        content = body.replace(b"abc", b"abd") if wrong else body
        record = struct.pack("<BQ", 9, len(content + pad)) + content + pad
        path.write_bytes(MAGIC + encode(Header("", "")) + record + end)
        assert len(check(path).problems) == wrong


def test_a_git_lfs_pointer_is_told_as_one(tmp_path):
    path = tmp_path / "a.mcap"
    path.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 12345\n")
    for look in (read_log, check, recover, read_metadata):
        with pytest.raises(LogError, match=r"Git LFS pointer.*git lfs pull"):
            look(path)
