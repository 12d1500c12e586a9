"""Reading MCAP bytes record by record, so that damage is found, located and never passed on as a number.

The library's StreamReader raises a dozen kinds of error on damaged files and does not tell where; here
everything is bounds-checked, and what is wrong becomes a `Damage` with its place.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from io import BytesIO
from typing import Any

import numpy as np
import zstandard
from mcap import records as mcap_records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Chunk, Metadata

from fatigue_runner.logbook.compression import decompress
from fatigue_runner.logbook.container import CHECKSUM_KEY, MAGIC, metadata_checksum

_HEAD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
MESSAGE_HEAD_SIZE = _MESSAGE_HEAD.size
# What the record classes, the decompressors and protobuf raise on damaged bytes.
READ_ERRORS = (
    McapError,
    ValueError,
    TypeError,
    KeyError,
    IndexError,
    OverflowError,
    MemoryError,
    RuntimeError,
    struct.error,
    zstandard.ZstdError,
)


class Damage(Exception):
    """Bytes that are not what they should be; becomes a LogError, a stated loss or a problem found."""

    def __init__(self, what: str, offset: int) -> None:
        super().__init__(f"{what} (at byte {offset})")
        self.what = what
        self.offset = offset


@dataclass(frozen=True)
class Record:
    """One record: opcode, where it begins and ends in the file, and its content."""

    opcode: int
    start: int
    end: int
    body: memoryview


def walk(data: bytes | memoryview, start: int = len(MAGIC)) -> Iterator[Record]:
    """The records from byte `start` to the footer or the end. Raises Damage for a record cut short."""
    view, offset = memoryview(data), start
    while offset < len(view):
        if len(view) - offset < _HEAD.size:
            raise Damage("the file is cut off", offset)
        opcode, length = _HEAD.unpack_from(view, offset)
        begin = offset + _HEAD.size
        if length > len(view) - begin:
            raise Damage("the file is cut off, or a record's length is damaged", offset)
        yield Record(opcode, offset, begin + length, view[begin : begin + length])
        if opcode == Opcode.FOOTER:
            return
        offset = begin + length


def parse(record: Record) -> Any:
    """The `mcap.records` object of any record but a message. Raises Damage where it does not parse."""
    classes: dict[int, Any] = {
        Opcode.HEADER: mcap_records.Header,
        Opcode.FOOTER: mcap_records.Footer,
        Opcode.SCHEMA: mcap_records.Schema,
        Opcode.CHANNEL: mcap_records.Channel,
        Opcode.CHUNK: mcap_records.Chunk,
        Opcode.MESSAGE_INDEX: mcap_records.MessageIndex,
        Opcode.CHUNK_INDEX: mcap_records.ChunkIndex,
        Opcode.ATTACHMENT: mcap_records.Attachment,
        Opcode.ATTACHMENT_INDEX: mcap_records.AttachmentIndex,
        Opcode.STATISTICS: mcap_records.Statistics,
        Opcode.METADATA: mcap_records.Metadata,
        Opcode.METADATA_INDEX: mcap_records.MetadataIndex,
        Opcode.SUMMARY_OFFSET: mcap_records.SummaryOffset,
        Opcode.DATA_END: mcap_records.DataEnd,
    }
    opcode = Opcode(record.opcode)
    try:
        return classes[opcode].read(ReadDataStream(BytesIO(record.body)))
    except READ_ERRORS:
        raise Damage(f"a {opcode.name.lower().replace('_', ' ')} record is damaged", record.start) from None


def parse_metadata(record: Record, signed: Collection[str]) -> Metadata:
    """A Metadata record without its checksum entry; signed: the names that must have one.

    Raises Damage where the checksum is wrong, or absent but due.
    """
    found: Metadata = parse(record)
    checksum = found.metadata.pop(CHECKSUM_KEY, None)
    wrong = checksum is not None and checksum != metadata_checksum(found.name, found.metadata)
    if wrong or (checksum is None and found.name in signed):
        raise Damage(f"metadata {found.name!r} is damaged", record.start)
    return found


def parse_attachment(record: Record) -> Attachment:
    """An Attachment record. Raises Damage where its checksum (0: none) or its length is wrong."""
    found: Attachment = parse(record)
    # its fields' length; later versions of the format may have more behind them
    size = 16 + 4 + len(found.name.encode()) + 4 + len(found.media_type.encode()) + 8 + len(found.data)
    checksum = int.from_bytes(record.body[size : size + 4], "little")
    if checksum and checksum != zlib.crc32(record.body[:size]):
        raise Damage(f"attachment {found.name!r} is damaged", record.start)
    return found


def open_chunk(record: Record, must_be_signed: bool) -> tuple[Chunk, bytes]:
    """A Chunk record and its uncompressed records. Raises Damage where they do not match the checksum."""
    chunk: Chunk = parse(record)
    try:
        plain = decompress(chunk.compression, chunk.data, chunk.uncompressed_size)
    except READ_ERRORS:
        raise Damage("a chunk does not decompress", record.start) from None
    if (chunk.uncompressed_crc or must_be_signed) and zlib.crc32(plain) != chunk.uncompressed_crc:
        raise Damage("a chunk does not match its checksum", record.start)
    return chunk, plain


def message_entries(plain: bytes, at: int) -> dict[int, np.ndarray]:
    """Channel id -> (n, 3) log time [ns], offset and sequence of the messages in an uncompressed chunk.

    at: where the chunk begins in the file, for the Damage that is raised when its inside cannot be walked.
    """
    found: dict[int, list[tuple[int, int, int]]] = {}
    offset, size = 0, len(plain)
    try:
        while offset < size:  # as `walk`, without an object per message: a check spends its time here
            opcode, length = _HEAD.unpack_from(plain, offset)
            body = offset + _HEAD.size
            if length > size - body:
                raise ValueError
            if opcode == Opcode.MESSAGE:
                channel_id, sequence, log_time, _ = _MESSAGE_HEAD.unpack_from(plain, body)
                found.setdefault(channel_id, []).append((log_time, offset, sequence))
            offset = body + length
    except (ValueError, struct.error):
        raise Damage("the records in a chunk are damaged", at) from None
    return {channel_id: np.array(entries, np.uint64) for channel_id, entries in found.items()}


def parse_message_index(record: Record) -> tuple[int, np.ndarray]:
    """Channel id and (n, 2) log time [ns] and offset of a MessageIndex record. Raises Damage."""
    try:
        channel_id, size = struct.unpack_from("<HI", record.body)
        return channel_id, np.frombuffer(record.body, "<u8", size // 8, 6).reshape(-1, 2)
    except READ_ERRORS:
        raise Damage("a message index record is damaged", record.start) from None


def split_message(body: memoryview) -> tuple[int, int, int, bytes]:
    """Channel id, sequence, log time [ns] and data of a Message record's content."""
    channel_id, sequence, log_time, _ = _MESSAGE_HEAD.unpack_from(body)
    return channel_id, sequence, log_time, bytes(body[MESSAGE_HEAD_SIZE:])
