"""An MCAP file around ready chunks: the `mcap` library's record classes, its indexes, checksums and summary.

The library's own writer takes one message at a time; here a chunk arrives as bytes with its indexes as
arrays. Format: https://mcap.dev/spec (version 0).
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import IO, Any

import numpy as np
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from fatigue_runner._version import __version__

MAGIC = b"\x89MCAP0\r\n"
CHECKSUM_KEY = "crc32"
LIBRARY = "fatigue-runner"


def library_name() -> str:
    """What the file header names as its writer: this program and its version."""
    return f"{LIBRARY} {__version__}"


def as_text(value: Any) -> str:
    """A value as the text of a record: floats in their shortest exact form, None as an empty string.

    Bytes of a file name that are no UTF-8 are written as escapes, since a record must be UTF-8.
    """
    text = "" if value is None else str(value)
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def as_entries(entries: Mapping[str, Any]) -> dict[str, str]:
    """Entries of a metadata record as text."""
    return {as_text(key): as_text(value) for key, value in entries.items()}


def encode(*records: McapRecord) -> bytes:
    """The records' bytes, one after the other."""
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return builder.end()


def metadata_checksum(name: str, entries: Mapping[str, str]) -> str:
    """CRC-32 (hex) of a metadata record's name and entries.

    MCAP protects metadata only by the checksum of the whole data section, which a cut-off file lacks and a
    quick look does not compute; with its own, a wind speed with a flipped bit is never taken for the truth.
    """
    text = "\0".join([name, *(part for pair in entries.items() for part in pair)])
    return f"{zlib.crc32(text.encode()):08x}"


def _no_statistics() -> Statistics:
    return Statistics(0, 0, {}, 0, 0, 0, 0, 0, 0)


@dataclass
class Index:
    """What the summary section says about the file: everything in the data section, and where it is."""

    schemas: list[Schema] = field(default_factory=list)
    channels: list[Channel] = field(default_factory=list)
    statistics: Statistics = field(default_factory=_no_statistics)
    chunks: list[ChunkIndex] = field(default_factory=list)
    attachments: list[AttachmentIndex] = field(default_factory=list)
    metadata: list[MetadataIndex] = field(default_factory=list)
    counted: bool = False  # whether the summary has statistics
    absent: bool = False  # whether the file has no summary

    def count_messages(self, counts: Mapping[int, int], start_time: int, end_time: int) -> None:
        """Add messages, by channel id, and their span [ns] to the statistics."""
        s = self.statistics
        if not counts:
            return
        s.message_start_time = min(s.message_start_time, start_time) if s.message_count else start_time
        s.message_end_time = max(s.message_end_time, end_time)
        for channel_id, count in counts.items():
            s.channel_message_counts[channel_id] = s.channel_message_counts.get(channel_id, 0) + count
            s.message_count += count

    def encode(self, start: int) -> tuple[bytes, int]:
        """The summary section for a file where it begins at byte `start`, and where its offsets begin."""
        groups: list[tuple[Opcode, list[Any]]] = [
            (Opcode.SCHEMA, self.schemas),
            (Opcode.CHANNEL, self.channels),
            (Opcode.STATISTICS, [self.statistics]),
            (Opcode.CHUNK_INDEX, self.chunks),
            (Opcode.ATTACHMENT_INDEX, self.attachments),
            (Opcode.METADATA_INDEX, self.metadata),
        ]
        data, offsets = b"", []
        for opcode, records in groups:
            if records:
                group = encode(*records)
                offsets.append(SummaryOffset(opcode, start + len(data), len(group)))
                data += group
        return data + encode(*offsets), start + len(data)


def message_index(channel_id: int, entries: np.ndarray) -> bytes:
    """A MessageIndex record; entries: (n, 2) log time [ns] and offset in the uncompressed chunk."""
    body = np.ascontiguousarray(entries, "<u8").tobytes()
    return struct.pack("<BQHI", Opcode.MESSAGE_INDEX, 6 + len(body), channel_id, len(body)) + body


class Container:
    """Writes MCAP records to a stream and keeps the books (offsets, indexes, checksums) for `finish`."""

    def __init__(self, stream: IO[bytes], library: str, profile: str = "") -> None:
        self.stream = stream
        self.offset = 0
        self.crc = 0
        self.index = Index()
        self._put(MAGIC + encode(Header(profile, library)))

    def _put(self, data: bytes | memoryview) -> None:
        self.stream.write(data)
        self.crc = zlib.crc32(data, self.crc)
        self.offset += len(data)

    def metadata(self, name: str, entries: Mapping[str, str]) -> None:
        """Write a Metadata record with its own checksum as the last entry."""
        plain = {k: v for k, v in entries.items() if k != CHECKSUM_KEY}
        self.raw_metadata(Metadata(name, {**plain, CHECKSUM_KEY: metadata_checksum(name, plain)}))

    def raw_metadata(self, record: Metadata) -> None:
        """Write a Metadata record as it is."""
        data = encode(record)
        self.index.metadata.append(MetadataIndex(self.offset, len(data), record.name))
        self.index.statistics.metadata_count += 1
        self._put(data)

    def attachment(self, record: Attachment) -> None:
        """Write an Attachment record."""
        data = encode(record)
        r = record
        self.index.attachments.append(
            AttachmentIndex(
                self.offset, len(data), r.log_time, r.create_time, len(r.data), r.name, r.media_type
            )
        )
        self.index.statistics.attachment_count += 1
        self._put(data)

    def schema(self, record: Schema) -> None:
        """Write a Schema record."""
        self.index.schemas.append(record)
        self.index.statistics.schema_count += 1
        self._put(encode(record))

    def channel(self, record: Channel) -> None:
        """Write a Channel record; its schema must be there already."""
        self.index.channels.append(record)
        self.index.statistics.channel_count += 1
        self.index.statistics.channel_message_counts.setdefault(record.id, 0)
        self._put(encode(record))

    def chunk(
        self, data: bytes, compression: str, size: int, crc: int, entries: Mapping[int, np.ndarray]
    ) -> None:
        """Write a chunk and its message indexes.

        data: the compressed records; size, crc: of the uncompressed ones; entries: channel id -> (n, 2) log
        time [ns] and offset in the uncompressed records, one per message.
        """
        start_time = min(int(e[:, 0].min()) for e in entries.values())
        end_time = max(int(e[:, 0].max()) for e in entries.values())
        name = compression.encode()
        head = struct.pack("<QQQII", start_time, end_time, size, crc, len(name)) + name
        head += struct.pack("<Q", len(data))
        begin = self.offset
        self._put(struct.pack("<BQ", Opcode.CHUNK, len(head) + len(data)) + head)
        self._put(data)
        index_begin, places = self.offset, {}
        for channel_id, channel_entries in entries.items():
            places[channel_id] = self.offset
            self._put(message_index(channel_id, channel_entries))
        self.index.chunks.append(
            ChunkIndex(
                chunk_length=index_begin - begin,
                chunk_start_offset=begin,
                compression=compression,
                compressed_size=len(data),
                message_end_time=end_time,
                message_index_length=self.offset - index_begin,
                message_index_offsets=places,
                message_start_time=start_time,
                uncompressed_size=size,
            )
        )
        self.index.count_messages({c: len(e) for c, e in entries.items()}, start_time, end_time)
        self.index.statistics.chunk_count += 1

    def finish(self) -> None:
        """Write DataEnd, summary, footer and closing magic; the stream stays open."""
        self._put(encode(DataEnd(self.crc)))
        start = self.offset
        summary, offsets_start = self.index.encode(start)
        # The footer's checksum covers the summary and the footer up to the checksum itself.
        crc = zlib.crc32(summary + encode(Footer(start, offsets_start, 0))[:-4])
        self._put(summary + encode(Footer(start, offsets_start, crc)) + MAGIC)
