"""The file format: every MCAP reader opens a log, and its schemas stay readable for ever."""

from __future__ import annotations

import io
import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from logbook_example import example
from mcap.opcode import Opcode
from mcap.reader import NonSeekingReader, make_reader
from mcap.records import Schema
from mcap.stream_reader import StreamReader
from mcap_protobuf.decoder import DecoderFactory

from fatigue_runner import channels
from fatigue_runner.logbook import LogError, check, read_log, write_log
from fatigue_runner.logbook.generic import message_class
from fatigue_runner.logbook.records import walk
from fatigue_runner.logbook.schema import TOPICS, descriptor_set, fields_in, known_topic


def test_the_librarys_seeking_reader_accepts_it_with_checksums(log_path):
    with open(log_path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        decoded = list(reader.iter_decoded_messages(topics="/turbine/loads"))
    assert summary.statistics.message_count == 4 * 3000 - 1
    assert len(summary.chunk_indexes) == summary.statistics.chunk_count > 1
    thrust = example(3000).loads["rotor_thrust"]
    assert [d.decoded_message.rotor_thrust for d in decoded] == thrust.tolist()
    assert [d.message.sequence for d in decoded] == list(range(3000))


def test_the_librarys_stream_reader_accepts_it_with_checksums(log_path):
    records = [type(r).__name__ for r in StreamReader(str(log_path), validate_crcs=True).records]
    assert records.count("Message") == 4 * 3000 - 1


def test_the_librarys_non_seeking_reader_accepts_it_with_checksums(log_path):
    reader = NonSeekingReader(
        io.BytesIO(log_path.read_bytes()), validate_crcs=True, decoder_factories=[DecoderFactory()]
    )
    status = list(reader.iter_decoded_messages(topics="/solver/status", log_time_order=False))
    assert [d.decoded_message.accepted for d in status] == example(3000).accepted.tolist()


def test_a_message_index_leads_to_each_message(log_path):
    """A seek by time uses the message indexes; viewers scrub with them."""
    with open(log_path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        found = list(reader.iter_messages(starting_at=20_000_000_000, ending_before=20_100_000_000))
    assert len(found) == 4 * 5
    assert {m.log_time for _, _, m in found} == {20_000_000_000 + k * 20_000_000 for k in range(5)}


def test_the_status_of_an_interval_has_the_time_and_number_of_its_end(log_path):
    with open(log_path, "rb") as stream:
        first = next(make_reader(stream).iter_messages(topics="/solver/status"))[2]
    assert (first.sequence, first.log_time) == (1, 20_000_000)


def test_run_units_and_attachments_come_before_the_first_chunk_and_the_result_last(log_path):
    records = [r for r in walk(log_path.read_bytes()) if r.opcode != Opcode.MESSAGE_INDEX]
    kinds = [Opcode(r.opcode).name for r in records]
    first_chunk = kinds.index("CHUNK")
    before = kinds[:first_chunk]
    assert before[:4] == ["HEADER", "METADATA", "ATTACHMENT", "ATTACHMENT"]
    assert before.count("CHANNEL") == before.count("SCHEMA") == 4 and before.count("METADATA") == 2
    assert kinds[kinds.index("DATA_END") - 1] == "METADATA"


def test_summary_has_all_that_viewers_need(log_path):
    kinds = [Opcode(r.opcode) for r in walk(log_path.read_bytes())]
    summary = kinds[kinds.index(Opcode.DATA_END) + 1 :]
    assert [summary.count(k) for k in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS)] == [4, 4, 1]
    assert summary.count(Opcode.CHUNK_INDEX) == kinds.count(Opcode.CHUNK)
    assert summary.count(Opcode.SUMMARY_OFFSET) == 6


def test_rerun_finds_nothing_wrong_with_it(log_path):
    rerun = shutil.which(
        "rerun", path=os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    )
    if rerun is None:
        pytest.skip("rerun is not installed: pip install 'fatigue-runner[view]'")
    done = subprocess.run(
        [rerun, "mcap", "check", "--full", log_path], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("ok ") == 4, done.stdout


_NODE_SCRIPT = """
const { McapIndexedReader, McapStreamReader } = require('@mcap/core');
const { loadDecompressHandlers } = require('@mcap/support');
const protobufjs = require('protobufjs');
const descriptor = require('protobufjs/ext/descriptor');
const fs = require('fs');
// as Foxglove does: the schema is a FileDescriptorSet, its name the type of the messages
const decoder = (schema) => {
  const root = protobufjs.Root.fromDescriptor(descriptor.FileDescriptorSet.decode(schema.data));
  root.resolveAll();
  return root.lookupType(schema.name);
};
(async () => {
  const data = fs.readFileSync(process.argv[2]);
  const decompressHandlers = await loadDecompressHandlers();
  const readable = { size: async () => BigInt(data.length),
    read: async (o, n) => new Uint8Array(data.subarray(Number(o), Number(o + n))) };
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  const types = new Map(), last = {};
  let indexed = 0;
  for await (const m of reader.readMessages()) {
    indexed++;
    const channel = reader.channelsById.get(m.channelId);
    if (channel.messageEncoding !== 'protobuf') throw new Error(channel.messageEncoding);
    if (!types.has(m.channelId)) types.set(m.channelId, decoder(reader.schemasById.get(channel.schemaId)));
    const type = types.get(m.channelId);
    last[channel.topic] = type.toObject(type.decode(m.data), { defaults: true });
  }
  const stream = new McapStreamReader({ decompressHandlers, validateCrcs: true });
  stream.append(new Uint8Array(data));
  let streamed = 0, r; while ((r = stream.nextRecord())) if (r.type === 'Message') streamed++;
  console.log(JSON.stringify({ indexed, streamed, done: stream.done(), last }));
})();
"""


@pytest.fixture(scope="module")
def javascript(tmp_path_factory):
    """node, and a folder with Foxglove's libraries; installed once, skipped where no registry answers."""
    npm, node = shutil.which("npm"), shutil.which("node")
    if not npm or not node:
        pytest.skip("npm and node are not installed")
    folder = tmp_path_factory.mktemp("javascript")
    packages = ["@mcap/core@2", "@mcap/support@1", "protobufjs@7"]
    impatient = ["--fetch-retries=0", "--fetch-timeout=20000", "--no-audit", "--no-fund"]
    try:
        command = [npm, "install", *impatient, "--prefix", str(folder), *packages]
        done = subprocess.run(command, capture_output=True, text=True, timeout=90)
    except subprocess.TimeoutExpired:
        pytest.skip("npm cannot install @mcap/core: no answer in 90 s")
    if done.returncode:
        pytest.skip(f"npm cannot install @mcap/core: {done.stderr.strip().splitlines()[-1:]}")
    return node, folder


@pytest.mark.slow(reason="installs Foxglove's libraries from npm")
def test_the_javascript_libraries_of_foxglove_read_and_decode_it(log_path, javascript):
    node, folder = javascript
    script = folder / "read.js"
    script.write_text(_NODE_SCRIPT)
    done = subprocess.run([node, str(script), str(log_path)], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    last = found.pop("last")
    assert found == {"indexed": 11999, "streamed": 11999, "done": True}
    log = read_log(log_path)
    state = last["/turbine/state"]
    assert list(state) == ["time", *channels.STATE_NAMES]
    assert list(state.values()) == [log.time[-1], *log.state[-1]], "to the bit"
    assert last["/turbine/loads"] == {"time": log.time[-1]} | {k: v[-1] for k, v in log.loads.items()}
    assert last["/wind"]["wind_speed"] == log.wind[-1, 0]
    assert last["/solver/status"]["accepted"] == bool(log.accepted[-1])


# --- schema
# -----------------------------------------------------------------------------------------------------


# The first release's channels. Field numbers are positions in these lists plus 2, for ever.
FIRST_STATES = [
    "tower_fore_aft",
    "tower_side_side",
    "blade1_flap",
    "blade2_flap",
    "blade3_flap",
    "edge",
    "rotor_azimuth",
    "generator_azimuth",
    "tower_fore_aft_velocity",
    "tower_side_side_velocity",
    "blade1_flap_velocity",
    "blade2_flap_velocity",
    "blade3_flap_velocity",
    "edge_velocity",
    "rotor_speed",
    "generator_speed",
]
FIRST_LOADS = [
    "tower_base_fore_aft_moment",
    "tower_base_side_side_moment",
    "blade1_root_flapwise_moment",
    "blade2_root_flapwise_moment",
    "blade3_root_flapwise_moment",
    "blade1_root_edgewise_moment",
    "blade2_root_edgewise_moment",
    "blade3_root_edgewise_moment",
    "low_speed_shaft_torque",
    "rotor_thrust",
    "generator_torque",
    "blade1_tip_out_of_plane",
    "blade2_tip_out_of_plane",
    "blade3_tip_out_of_plane",
    "blade1_tip_in_plane",
    "blade2_tip_in_plane",
    "blade3_tip_in_plane",
    "tower_top_fore_aft_acceleration",
    "tower_top_side_side_acceleration",
]
FIRST_WIND = ["wind_speed", "vertical_shear", "horizontal_shear"]
FIRST_STATUS = ["accepted", "discrepancy", "threshold", "local_error", "reference_error", "clamped_lookups"]


@pytest.mark.parametrize(
    ("key", "names"),
    [("state", FIRST_STATES), ("loads", FIRST_LOADS), ("wind", FIRST_WIND), ("status", FIRST_STATUS)],
)
def test_field_numbers_never_change(key, names):
    """Logs of years ago must stay readable: a name may be added with a new number, never moved."""
    numbers = {f.name: f.number for f in TOPICS[key].fields}
    assert {"time": 1, **{name: i + 2 for i, name in enumerate(names)}}.items() <= numbers.items()


def test_schemas_are_flat_proto3_that_protobuf_itself_accepts():
    for topic in TOPICS.values():
        data = descriptor_set(topic)
        assert fields_in(data, topic.schema_name) is not None
        message = message_class(Schema(1, data, "protobuf", topic.schema_name))
        assert [f.name for f in message.DESCRIPTOR.fields] == list(topic.field_names)
        assert all(f.message_type is None for f in message.DESCRIPTOR.fields)


def test_single_precision_is_a_proto_float_and_rounds_all_that_does_not_grow(tmp_path):
    run = example(500)
    run.state[:, channels.STATE_NAMES.index("generator_azimuth")] += 7e4  # ten minutes of it
    path = write_log(tmp_path / "single.mcap", run, precision="float32")
    whole = write_log(tmp_path / "double.mcap", run)
    assert path.stat().st_size < 0.75 * whole.stat().st_size
    with open(path, "rb") as stream:
        decoded = list(make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages())
    thrust = [d.decoded_message.rotor_thrust for d in decoded if d.channel.topic == "/turbine/loads"]
    assert thrust == run.loads["rotor_thrust"].astype(np.float32).tolist()
    log = read_log(path)
    assert log.state.dtype == log.wind.dtype == log.loads["rotor_thrust"].dtype == np.float64
    assert log.time.tobytes() == run.time.tobytes()
    for number, name in enumerate(channels.STATE_NAMES):
        own = run.state[:, number]
        expected = own if name.endswith("azimuth") else own.astype(np.float32)
        assert np.array_equal(log[name], expected, equal_nan=True), name
    assert np.array_equal(log.discrepancy, run.discrepancy.astype(np.float32), equal_nan=True)
    assert check(path).problems == []
    with pytest.raises(LogError, match="unknown log precision 'float16'; did you mean"):
        write_log(tmp_path / "half.mcap", run, precision="float16")


def test_a_schema_that_makes_an_azimuth_a_float_is_damaged(tmp_path):
    azimuth = replace(TOPICS["state"].only(["rotor_azimuth"]).fields[1], kind="float")
    topic = replace(TOPICS["state"], fields=(azimuth,))
    with pytest.raises(LogError, match="damaged at field 'rotor_azimuth'"):
        known_topic(topic.name, topic.schema_name, descriptor_set(topic))
