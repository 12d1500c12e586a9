"""How fast logs are written and read, as ratios to the `mcap` library in the same run.

Every writer gets the same rows of three topics (state, loads, status: what a run logs beside its wind) and
makes a file with zstd unless its name says otherwise. Rates are the best of a few repeats, since a shared
machine only ever adds time. The library writers get ready message bytes, so that only writing is compared.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from mcap.records import Schema
from mcap.writer import CompressionType, Writer

from fatigue_runner import channels
from fatigue_runner.logbook import read_log, write_log
from fatigue_runner.logbook.generic import message_class
from fatigue_runner.trajectory import Trajectory

TOPICS = ("state", "loads", "status")
# The one-by-one writers are tens of times slower; a tenth of the rows gives their rate as well.
_SLOW_SHARE = 10
# (channel id, topic, schema of the topic, log time [ns], message)
Message = tuple[int, str, Schema, int, bytes]
Writing = Callable[[Path], None]


def sample(rows: int, seed: int = 0) -> Trajectory:
    """A trajectory of noisy harmonics: its low bits hardly compress, as those of a turbine in turbulence."""
    rng = np.random.default_rng(seed)
    moment = np.arange(rows) * 0.02
    state = np.sin(moment[:, None] * np.linspace(0.5, 9.0, len(channels.STATES)))
    state += 1e-2 * rng.normal(size=state.shape)
    loads = {n: 1e6 + 1e5 * np.sin(moment) + 1e3 * rng.normal(size=rows) for n in channels.LOAD_NAMES}
    wind = np.stack([8 + rng.normal(size=rows), np.full(rows, 0.2), np.zeros(rows)], axis=1)
    discrepancy = rng.random(rows - 1)
    return Trajectory(
        moment,
        state,
        wind,
        loads,
        accepted=discrepancy < 0.9,
        discrepancy=discrepancy,
        threshold=np.full(rows - 1, 0.9),
        local_error=1e-6 * rng.random(rows - 1),
    )


def _best(repeats: int, work: Callable[[], Any]) -> float:
    """Shortest time of the repeats [s]."""
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return min(times)


def _messages(path: Path) -> list[Message]:
    with open(path, "rb") as stream:
        found = make_reader(stream).iter_messages(log_time_order=False)
        return [(c.id, c.topic, s, m.log_time, m.data) for s, c, m in found if s is not None]


def _library_writer(messages: list[Message]) -> Writing:
    """The `mcap` library's writer with ready bytes."""

    def write(out: Path) -> None:
        with open(out, "wb") as stream:
            writer = Writer(stream, compression=CompressionType.ZSTD)
            writer.start()
            ids: dict[int, int] = {}
            for number, (channel_id, topic, schema, log_time, data) in enumerate(messages):
                if channel_id not in ids:
                    schema_id = writer.register_schema(schema.name, schema.encoding, schema.data)
                    ids[channel_id] = writer.register_channel(topic, "protobuf", schema_id)
                writer.add_message(ids[channel_id], log_time, data, log_time, number)
            writer.finish()

    return write


def _protobuf_writer(messages: list[Message]) -> Writing:
    """mcap-protobuf-support's writer, fields set by name as a plain program does."""
    from mcap_protobuf.writer import Writer as ProtobufWriter

    classes = {channel_id: message_class(schema) for channel_id, _, schema, _, _ in messages[:4]}
    fields = []
    for channel_id, topic, _, log_time, data in messages:
        made = classes[channel_id]
        values = {f.name: v for f, v in made.FromString(data).ListFields()}
        fields.append((topic, made, values, log_time))

    def write(out: Path) -> None:
        with open(out, "wb") as stream, ProtobufWriter(stream) as writer:
            for number, (topic, made, values, log_time) in enumerate(fields):
                writer.write_message(topic, made(**values), log_time, log_time, number)

    return write


def _foxglove_writer(messages: list[Message]) -> Writing:
    """foxglove-sdk with ready bytes, on one thread as the others."""
    import foxglove
    from foxglove.mcap import MCAPWriteOptions

    def write(out: Path) -> None:
        context = foxglove.Context()
        made: dict[int, Any] = {}
        options = MCAPWriteOptions(compression_threads=0)
        with foxglove.open_mcap(out, context=context, writer_options=options):
            for channel_id, topic, schema, log_time, data in messages:
                if channel_id not in made:
                    declared = foxglove.Schema(name=schema.name, encoding=schema.encoding, data=schema.data)
                    made[channel_id] = foxglove.Channel(
                        topic, schema=declared, message_encoding="protobuf", context=context
                    )
                made[channel_id].log(data, log_time=log_time)

    return write


# name: maker of a function that writes the messages to a file; those that are not installed are left out
OTHER_WRITERS: dict[str, Callable[[list[Message]], Writing]] = {
    "mcap library, ready bytes": _library_writer,
    "mcap-protobuf, named fields": _protobuf_writer,
    "foxglove-sdk, ready bytes": _foxglove_writer,
}
BASE_WRITER = "mcap library, ready bytes"
BASE_READER = "mcap library, iter_messages"


def _write_rates(folder: Path, rows: int, repeats: int) -> Iterator[tuple[str, float]]:
    trajectory = sample(rows)
    names = (folder / f"{i}.mcap" for i in range(1000))
    for compression in ("zstd", "lz4", "none"):

        def write(compression: str = compression) -> None:
            write_log(
                next(names), trajectory, {"case_id": "benchmark"}, compression=compression, topics=TOPICS
            )

        write()  # the first one pays for imports and page tables
        yield f"fatigue-runner, {compression}", rows / _best(repeats, write)
    few = max(rows // _SLOW_SHARE, 2)
    messages = _messages(write_log(folder / "few.mcap", sample(few), topics=TOPICS))
    for name, maker in OTHER_WRITERS.items():
        try:
            write_messages = maker(messages)
        except ImportError:
            continue
        yield name, few / _best(repeats, lambda: write_messages(next(names)))  # noqa: B023  (called here)


def _read_rates(folder: Path, rows: int, repeats: int) -> Iterator[tuple[str, float]]:
    for compression in ("zstd", "lz4", "none"):
        path = write_log(folder / f"{compression}.mcap", sample(rows), compression=compression, topics=TOPICS)
        yield f"fatigue-runner, {compression}", rows / _best(repeats, partial(read_log, path))
    few = max(rows // _SLOW_SHARE, 2)
    path = write_log(folder / "few.mcap", sample(few), topics=TOPICS)

    def iterate() -> None:
        with open(path, "rb") as stream:
            for _ in make_reader(stream, validate_crcs=True).iter_messages():
                pass

    yield BASE_READER, few / _best(repeats, iterate)
    try:
        from mcap_protobuf.decoder import DecoderFactory
    except ImportError:
        return

    def decode() -> None:
        with open(path, "rb") as stream:
            reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
            for _ in reader.iter_decoded_messages():
                pass

    yield "mcap library, decoded", few / _best(repeats, decode)


def _relative(rates: dict[str, float], base: str) -> dict[str, dict[str, float]]:
    return {name: {"per_second": rate, "ratio": rate / rates[base]} for name, rate in rates.items()}


def measure(rows: int = 60_000, repeats: int = 3, folder: str | Path | None = None) -> dict[str, Any]:
    """Rows per second of every writer and reader on one core, and their ratio to the `mcap` library's.

    rows: of three topics (43 fields); folder: where the files go, and with it the disk (default: the
    temporary folder). Returns {"rows", "topics", "bytes_per_row", "writers" and "readers": {name: {"per_second", "ratio"}}}.
    """
    with tempfile.TemporaryDirectory(dir=folder) as made:
        where = Path(made)
        size = write_log(where / "size.mcap", sample(rows), topics=TOPICS).stat().st_size
        (where / "write").mkdir()
        (where / "read").mkdir()
        writers = dict(_write_rates(where / "write", rows, repeats))
        readers = dict(_read_rates(where / "read", rows, repeats))
    return {
        "rows": rows,
        "topics": list(TOPICS),
        "bytes_per_row": size / rows,
        "writers": _relative(writers, BASE_WRITER),
        "readers": _relative(readers, BASE_READER),
    }
