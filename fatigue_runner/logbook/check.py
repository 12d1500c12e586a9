"""Checking a log to the last byte: checksums, indexes, order of times, counts."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, ChunkIndex, MetadataIndex

from fatigue_runner.logbook.container import Index
from fatigue_runner.logbook.contents import Contents, read_contents
from fatigue_runner.logbook.errors import LogError
from fatigue_runner.logbook.files import read_bytes
from fatigue_runner.logbook.metadata import read_summary
from fatigue_runner.logbook.reader import row_layout
from fatigue_runner.logbook.records import (
    Damage,
    Record,
    message_entries,
    open_chunk,
    parse,
    parse_message_index,
    split_message,
)


@dataclass
class Check:
    """What a check found: `problems` in the order of the file, and how much the file holds.

    complete: it also has its result and all of its rows, which a repaired log may lack without any problem. ours: this
    program wrote the file, so that also missing rows are found.
    """

    path: Path
    problems: list[str] = field(default_factory=list)
    chunks: int = 0
    messages: int = 0
    rows: int = 0
    complete: bool = False
    ours: bool = True

    @property
    def ok(self) -> bool:
        """Whether nothing is wrong with the file."""
        return not self.problems


class MessageOrder:
    """Whether each channel goes on where it stopped: times never back, and in our logs no row missing."""

    def __init__(self, contents: Contents) -> None:
        self.in_order = contents.written_here  # other writers may put messages in any order
        # Only a window that was cut out by a tool begins later, and the checksum of such a file is right.
        self._from_row_0 = contents.ours and not contents.verified
        self._last: dict[int, tuple[int, int]] = {}

    def problem(self, entries: dict[int, np.ndarray]) -> str | None:
        """What is wrong with a chunk's (n, 3) entries after the chunks before it, None for nothing."""
        if self._from_row_0 and not self._last and min((e[0, 2] for e in entries.values()), default=0) > 0:
            return "rows are missing"
        for channel_id, found in entries.items():
            log_time, sequence = found[:, 0], found[:, 2].astype(np.int64)
            if channel_id in self._last:
                last_time, last_sequence = self._last[channel_id]
                log_time = np.concatenate([[np.uint64(last_time)], log_time])
                sequence = np.concatenate([[last_sequence], sequence])
            if self.in_order and (log_time[1:] < log_time[:-1]).any():
                return "times go backwards"
            if self.in_order and (np.diff(sequence) != 1).any():
                return "rows are missing"
        for channel_id, found in entries.items():
            before = self._last.get(channel_id, (0, 0))
            self._last[channel_id] = max(int(found[-1, 0]), before[0]), max(int(found[:, 2].max()), before[1])
        return None

    @property
    def rows(self) -> int:
        """Number of rows so far, by the sequence of our logs."""
        return max((sequence + 1 for _, sequence in self._last.values()), default=0)


def _blocks(records: Sequence[Record]) -> Iterator[tuple[Record, list[Record]]]:
    """Each record that is no message index, with the message indexes that follow it."""
    indexes: list[Record] = []
    for record in reversed(records):
        if record.opcode == Opcode.MESSAGE_INDEX:
            indexes.insert(0, record)
        else:
            yield record, indexes
            indexes = []


def _chunk_index(
    record: Record, indexes: list[Record], entries: dict[int, np.ndarray], problems: list[str], due: bool
) -> ChunkIndex:
    """What the summary must say about a chunk; compares its header and indexes with its messages. due: every topic has an index."""
    chunk = parse(record)
    times = np.concatenate([e[:, 0] for e in entries.values()]) if entries else np.zeros(1, np.uint64)
    if entries and (chunk.message_start_time, chunk.message_end_time) != (times.min(), times.max()):
        problems.append(f"a chunk's times are not those of its messages (at byte {record.start})")
    places: dict[int, int] = {}
    for index_record in indexes:
        channel_id, found = parse_message_index(index_record)
        places[channel_id] = index_record.start
        expected = entries.get(channel_id, np.empty((0, 3)))[:, :2]
        if not np.array_equal(found[found[:, 1].argsort()], expected):
            problems.append(f"a message index is wrong (at byte {index_record.start})")
    if due and set(entries) - set(places):
        problems.append(f"a chunk lacks message indexes (at byte {record.start})")
    return ChunkIndex(
        chunk_length=record.end - record.start,
        chunk_start_offset=record.start,
        compression=chunk.compression,
        compressed_size=len(chunk.data),
        message_end_time=chunk.message_end_time,
        message_index_length=sum(r.end - r.start for r in indexes),
        message_index_offsets=places,
        message_start_time=chunk.message_start_time,
        uncompressed_size=chunk.uncompressed_size,
    )


def _survey(contents: Contents, order: MessageOrder, problems: list[str]) -> Index:
    """The index that the data section deserves; collects what is wrong inside it."""
    index = Index()
    for record, indexes in reversed(list(_blocks(contents.records))):
        size = record.end - record.start
        try:
            if record.opcode == Opcode.METADATA:
                index.metadata.append(MetadataIndex(record.start, size, parse(record).name))
            elif record.opcode == Opcode.ATTACHMENT:
                a = parse(record)
                entry = (a.log_time, a.create_time, len(a.data), a.name, a.media_type)
                index.attachments.append(AttachmentIndex(record.start, size, *entry))
            elif record.opcode == Opcode.CHUNK:
                plain = open_chunk(record, contents.written_here)[1]
                entries = message_entries(plain, record.start)
                wrong = order.problem(entries)
                declared = set(contents.channels)
                if contents.written_here and declared and not set(entries) <= declared:
                    wrong = "messages of a topic that is not declared"
                if wrong:
                    problems.append(f"{wrong} (at byte {record.start})")
                found = _chunk_index(record, indexes, entries, problems, contents.written_here)
                index.chunks.append(found)
                counts = {c: len(e) for c, e in entries.items()}
                index.count_messages(counts, found.message_start_time, found.message_end_time)
                index.statistics.chunk_count += 1
            elif record.opcode == Opcode.MESSAGE:
                channel_id, _, log_time, _ = split_message(record.body)
                index.count_messages({channel_id: 1}, log_time, log_time)
        except Damage as damage:
            problems.append(str(damage))
    index.schemas, index.channels = list(contents.schemas.values()), list(contents.channels.values())
    return index


def _compare(expected: Index, found: Index, written_here: bool) -> Iterator[str]:
    """Where the summary disagrees with the file. Of another writer's every part is optional, and schemas and channels may stand in the
    chunks only."""
    for name in ("chunks", "metadata", "attachments") + (("schemas", "channels") if written_here else ()):
        said, held = getattr(found, name), getattr(expected, name)
        if not written_here and name == "chunks":
            held = [_as_said(index, said) for index in held]
        if (written_here or said) and sorted(held, key=repr) != sorted(said, key=repr):
            yield f"the summary's list of {name} is not what the file holds"
    if not (written_here or found.counted):
        return
    a, b = expected.statistics, found.statistics
    counted = {k: n for k, n in b.channel_message_counts.items() if n}
    if (a.message_count, a.channel_message_counts, a.chunk_count) != (
        b.message_count,
        counted,
        b.chunk_count,
    ):
        yield "the summary's message counts are not what the file holds"
    if (a.message_start_time, a.message_end_time) != (b.message_start_time, b.message_end_time):
        yield "the summary's times are not those of the messages"


def _as_said(held: ChunkIndex, said: Sequence[ChunkIndex]) -> ChunkIndex:
    """A chunk's index without the places of its message indexes where the summary does not give them."""
    same = next((index for index in said if index.chunk_start_offset == held.chunk_start_offset), None)
    if same is None or same.message_index_offsets:
        return held
    return replace(held, message_index_offsets={}, message_index_length=same.message_index_length)


def check(path: str | os.PathLike[str]) -> Check:
    """Check every checksum, index, count and the order of times of a log, or of any chunked MCAP file.

    Raises LogError only for a file that is missing or no MCAP at all; all else is a problem in the result.
    """
    contents = read_contents(read_bytes(path), path)
    found = Check(Path(path), [str(d) for d in contents.damages])
    order = MessageOrder(contents)
    inside: list[str] = []
    expected = _survey(contents, order, inside)
    found.problems += [p for p in inside if p not in found.problems]
    try:
        row_layout(contents)
    except LogError as error:
        found.problems.append(str(error))
    rows = {"": 0, **contents.metadata.get("result", {})}.get("rows")
    try:
        summary, _ = read_summary(path)
        if contents.written_here or not summary.absent:
            found.problems += _compare(expected, summary, contents.written_here)
    except (Damage, LogError) as damage:
        found.problems.append(str(damage))
    found.chunks = expected.statistics.chunk_count
    found.messages = expected.statistics.message_count
    found.rows = order.rows if contents.ours else 0
    found.ours = contents.ours
    found.complete = found.ok and rows == str(found.rows)
    return found
