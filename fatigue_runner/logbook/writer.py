"""Writing logs: a whole trajectory at once, or block by block while a run is still going.

A log is written to `<path>.part`, a chunk at a time, then fsynced and renamed, so that a file under the
final name is always whole. A run that is killed leaves the `.part` file, readable up to its last chunk.
"""

from __future__ import annotations

import errno
import mimetypes
import os
import time
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from mcap.records import Attachment, Channel, Schema

from fatigue_runner.channels import WIND_NAMES
from fatigue_runner.errors import did_you_mean
from fatigue_runner.logbook.columns import columns, topics_of
from fatigue_runner.logbook.compression import compressor
from fatigue_runner.logbook.container import Container, as_entries, as_text, library_name
from fatigue_runner.logbook.errors import LogError
from fatigue_runner.logbook.files import open_exclusively, part_of, publish, write_errors
from fatigue_runner.logbook.layout import RowLayout, layout_for
from fatigue_runner.logbook.schema import PRECISIONS, SCHEMA_VERSION, descriptor_set, select_topics
from fatigue_runner.trajectory import Trajectory

CHUNK_SIZE = 1 << 20
CHUNK_SECONDS = 1.0


class LogWriter:
    """Writes one log block by block; a context manager.

        with LogWriter("case.mcap", run={"case_id": "case"}) as log:
            for block in blocks:
                log.append(block)
            log.result["status"] = "done"

    run, attachments: written first (name -> bytes for the latter). compression: "zstd", "lz4" or "none". precision: "float64", which
    reads back to the bit, or "float32", half of the bytes (times and azimuths stay doubles).
    topics: keys of `schema.TOPICS`; channels: names of states, wind signals and loads; None keeps all that
    the first block has. A chunk is closed when it holds `chunk_size` bytes, or at the first `append` after
    `chunk_seconds` of wall time, and is then visible to whoever tails `<path>.part`. `result` is written
    when the block ends well; when it raises, the `.part` file stays, readable up to the last row. sync:
    fsync before the rename. Raises LogError for wrong arguments and for a disk that is full or cannot be
    written.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        *,
        run: Mapping[str, Any] | None = None,
        attachments: Mapping[str, bytes] | None = None,
        compression: str = "zstd",
        precision: str = "float64",
        topics: Iterable[str] | None = None,
        channels: Iterable[str] | None = None,
        chunk_size: int = CHUNK_SIZE,
        chunk_seconds: float = CHUNK_SECONDS,
        sync: bool = True,
    ) -> None:
        self._compression, self._compress = compressor(compression)
        if precision not in PRECISIONS:
            raise LogError(f"unknown log precision {precision!r}{did_you_mean(precision, PRECISIONS)}")
        self._precision = precision
        self._topic_keys = None if topics is None else [t.key for t in select_topics(topics)]
        self._channels = None if channels is None else list(channels)
        self.path = Path(path)
        self.part = part_of(self.path)
        self.result: dict[str, Any] = {}
        self.size = self.checksum = 0  # of the finished file: bytes, CRC-32
        self.rows = 0
        self._totals = {"steps": 0, "evaluations": 0, "clamped_lookups": 0, "wall_time": 0.0}
        self._diverged_at: float | None = None
        self._chunk_size, self._chunk_seconds, self._sync = chunk_size, chunk_seconds, sync
        self._layout: RowLayout | None = None
        self._buffer: Any = np.empty(0)  # structured, with the layout's dtype
        self._filled = 0
        self._last_time = 0
        self._closed_at = time.monotonic()
        with write_errors(self.path):
            if self.path.is_dir():
                raise IsADirectoryError(errno.EISDIR, "")
            self._file = open_exclusively(self.part)
        try:
            self._write_preface(run or {}, attachments or {})
        except BaseException:
            with suppress(OSError):
                self.part.unlink()
            raise

    def _write_preface(self, run: Mapping[str, Any], attachments: Mapping[str, bytes]) -> None:
        with self._writing():
            self._container = Container(self._file, library_name())
            self._container.metadata("run", {"log_schema": SCHEMA_VERSION, **as_entries(run)})
            for name, data in attachments.items():
                media_type = mimetypes.guess_type(name)[0] or "application/octet-stream"
                self._container.attachment(Attachment(0, 0, as_text(name), media_type, bytes(data)))
            self._file.flush()

    @contextmanager
    def _writing(self) -> Iterator[None]:
        """Close the file at any failure: what follows half a record could not be read."""
        try:
            with write_errors(self.path):
                yield
        except BaseException:
            with suppress(OSError):
                self._file.close()
            raise

    def append(
        self,
        block: Trajectory,
        *,
        reference_error: np.ndarray | None = None,
        clamped_lookups: np.ndarray | None = None,
    ) -> None:
        """Add a block of n rows.

        The status arrays, and the two optional ones, have an entry per interval: n - 1 in the first block,
        n in each later one, whose first interval began at the last row of the block before. Times [s] never
        go backwards.
        """
        if not len(block.time):
            return
        log_time = self._log_time(block.time)
        extra = {"reference_error": reference_error, "clamped_lookups": clamped_lookups}
        values = columns(block, extra, self.rows)
        if self._layout is None:
            self._begin(
                layout_for(topics_of(values, self._topic_keys, self._channels, block, self._precision))
            )
        self._refuse_missing(values)
        with self._writing():
            self._write_rows(values, log_time)
            if time.monotonic() - self._closed_at >= self._chunk_seconds:
                self._close_chunk()
        self._last_time = int(log_time[-1])
        self._diverged_at = block.diverged_at
        for name in self._totals:
            self._totals[name] += getattr(block, name)

    def _log_time(self, seconds: np.ndarray) -> np.ndarray:
        scaled = np.rint(np.asarray(seconds, float) * 1e9)
        # The upper bound is that of signed 64-bit nanoseconds, which readers use; NaN fails both comparisons.
        if not (scaled >= 0).all() or not (scaled < 2**63).all():
            raise LogError(f"cannot write {self.path}: the times of a log are finite and count from 0 s")
        log_time = scaled.astype(np.uint64)
        if (log_time[1:] < log_time[:-1]).any() or int(log_time[0]) < self._last_time:
            raise LogError(f"cannot write {self.path}: the times of a log must not go backwards")
        return log_time

    def _begin(self, layout: RowLayout) -> None:
        """Register every channel before the first message, and prepare the chunk's buffer."""
        with self._writing():
            self._container.metadata("units", {f.name: f.unit for t in layout.topics for f in t.fields})
            for t in layout.topics:
                schema = Schema(t.channel_id, descriptor_set(t), "protobuf", t.schema_name)
                self._container.schema(schema)
            for t in layout.topics:
                self._container.channel(Channel(t.channel_id, t.name, "protobuf", {}, t.channel_id))
        if layout.topics:
            self._buffer = np.tile(layout.template, max(1, self._chunk_size // layout.stride))
        self._layout = layout

    def _refuse_missing(self, values: Mapping[str, Mapping[str, np.ndarray]]) -> None:
        topics = self._layout.topics if self._layout else ()
        if not topics:
            raise LogError(f"cannot write {self.path}: no topic is left to log")
        for t in topics:
            missing = [name for name in t.field_names if name not in values.get(t.key, {})]
            if missing:
                raise LogError(
                    f"cannot write {self.path}: the first block had {missing[-1]!r} of topic {t.key!r}, "
                    "this one has not; every block must have the same, or leave the topic out"
                )

    def _write_rows(self, values: Mapping[str, Mapping[str, np.ndarray]], log_time: np.ndarray) -> None:
        begin = 0
        while begin < len(log_time):
            count = min(len(log_time) - begin, len(self._buffer) - self._filled)
            self._fill(values, log_time, slice(begin, begin + count))
            begin += count
            if self._filled == len(self._buffer):
                self._close_chunk()

    def _fill(
        self, values: Mapping[str, Mapping[str, np.ndarray]], log_time: np.ndarray, part: slice
    ) -> None:
        """Copy rows `part` of a block into the chunk's buffer, where the constant bytes already are."""
        count = part.stop - part.start
        rows = self._buffer[self._filled : self._filled + count]
        sequence = np.arange(self.rows, self.rows + count, dtype=np.uint32)
        for t in self._layout.topics if self._layout else ():
            records = rows[t.key]
            records["_sequence"] = sequence
            records["_log_time"] = records["_publish_time"] = log_time[part]
            for name in t.field_names:
                records[name] = values[t.key][name][part]
        self._filled += count
        self.rows += count

    def flush(self) -> None:
        """Close the chunk now, so that whoever tails the file sees every row."""
        with self._writing():
            self._close_chunk()

    def _close_chunk(self) -> None:
        self._closed_at = time.monotonic()
        if self._layout is None or not self._filled:
            return
        layout, rows = self._layout, self._buffer[: self._filled]
        is_first = self.rows == self._filled
        data = memoryview(rows.view(np.uint8))[layout.lead if is_first else 0 :]
        if data.nbytes:
            packed = self._compress(data)
            entries = layout.message_indexes(rows, is_first)
            self._container.chunk(packed, self._compression, data.nbytes, zlib.crc32(data), entries)
            self._file.flush()
        self._filled = 0

    def _full_result(self) -> dict[str, str]:
        status = "done" if self._diverged_at is None else "diverged"
        counted = {"status": status, "diverged_at": self._diverged_at, **self._totals}
        return as_entries({**counted, **self.result, "rows": self.rows})

    def finish(self) -> None:
        """Write the last chunk, `result` and summary; fsync and rename. The end of a `with` block does it."""
        if self._file.closed:
            return
        if self._layout is None:
            # no row tells how many harmonics the wind has
            topics = [t for t in select_topics(self._topic_keys) if len(t.fields) > 1]
            self._begin(
                layout_for(
                    tuple((t.only(WIND_NAMES) if t.key == "wind" else t).at(self._precision) for t in topics)
                )
            )
        with self._writing():
            self._close_chunk()
            self._container.metadata("result", self._full_result())
            self._container.finish()
            self.size, self.checksum = self._container.offset, self._container.crc
            publish(self._file, self.part, self.path, self._sync)

    def abort(self) -> None:
        """Write the rows of the last chunk and close; the `.part` file stays, without result and summary."""
        if not self._file.closed:
            with suppress(LogError):
                self.flush()
            self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is None:
            self.finish()
        else:
            self.abort()


def write_log(path: str | os.PathLike[str], trajectory: Trajectory, *args: Any, **options: Any) -> Path:
    """Write a whole trajectory as one log and return its path; the arguments are those of `log_of`."""
    return log_of(path, trajectory, *args, **options).path


def log_of(
    path: str | os.PathLike[str],
    trajectory: Trajectory,
    run: Mapping[str, Any] | None = None,
    attachments: Mapping[str, bytes] | None = None,
    result: Mapping[str, Any] | None = None,
    *,
    reference_error: np.ndarray | None = None,
    clamped_lookups: np.ndarray | None = None,
    compression: str = "zstd",
    precision: str = "float64",
    topics: Iterable[str] | None = None,
    channels: Iterable[str] | None = None,
    sync: bool = True,
) -> LogWriter:
    """Write a whole trajectory as one log and return what wrote it, which knows the file's `path`, `size` and `checksum`.

    run, result: metadata at the beginning and the end, values as text (the trajectory's counters are added
    to `result`). reference_error: (n-1,) error against the reference where known; clamped_lookups: (n-1,)
    look-ups clamped in the interval. The rest as in LogWriter. Raises LogError, and then leaves nothing
    behind.
    """
    writer = LogWriter(
        path,
        run=run,
        attachments=attachments,
        compression=compression,
        precision=precision,
        topics=topics,
        channels=channels,
        chunk_seconds=float("inf"),
        sync=sync,
    )
    try:
        writer.append(trajectory, reference_error=reference_error, clamped_lookups=clamped_lookups)
        writer.result.update(result or {})
        writer.finish()
    except BaseException:
        writer.abort()
        with suppress(OSError):
            writer.part.unlink()
        raise
    return writer
