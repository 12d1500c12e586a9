"""Quick looks at a log without opening its chunks: metadata, counts, whether it is complete."""

from __future__ import annotations

import os
import zlib
from contextlib import suppress
from typing import IO, Any

from mcap.opcode import Opcode

from fatigue_runner.logbook.container import MAGIC, Index
from fatigue_runner.logbook.contents import OUR_METADATA, read_contents, require_magic, take
from fatigue_runner.logbook.errors import LogError
from fatigue_runner.logbook.files import read_bytes
from fatigue_runner.logbook.records import READ_ERRORS, Damage, Record, parse, parse_metadata, walk

_FOOTER_SIZE = 9 + 20
_TAIL_SIZE = _FOOTER_SIZE + len(MAGIC)


def _summary_bytes(stream: IO[bytes], size: int) -> tuple[bytes, int]:
    """The file from the summary section to before the closing magic, verified, and where that begins."""
    stream.seek(max(0, size - _TAIL_SIZE))
    tail = stream.read(_TAIL_SIZE)
    if len(tail) < _TAIL_SIZE or not tail.endswith(MAGIC) or tail[0] != Opcode.FOOTER:
        raise Damage("the file does not end as an MCAP file does", size)
    footer = parse(next(walk(tail, 0)))
    start = footer.summary_start
    if start == 0:
        return b"", 0
    if not len(MAGIC) <= start <= size - _TAIL_SIZE:
        raise Damage("the footer points outside the file, or there is no summary", size - _TAIL_SIZE)
    stream.seek(start)
    data = stream.read(size - len(MAGIC) - start)
    if footer.summary_crc and footer.summary_crc != zlib.crc32(data[:-4]):
        raise Damage("the summary does not match its checksum", start)
    return data, start


def parse_summary(data: bytes, start: int) -> Index:
    """The index that a summary section declares; start: where it begins in the file."""
    index = Index(absent=not data)
    groups: dict[int, list[Any]] = {
        Opcode.SCHEMA: index.schemas,
        Opcode.CHANNEL: index.channels,
        Opcode.CHUNK_INDEX: index.chunks,
        Opcode.ATTACHMENT_INDEX: index.attachments,
        Opcode.METADATA_INDEX: index.metadata,
    }
    for record in walk(data, 0):
        if record.opcode == Opcode.STATISTICS:
            index.statistics, index.counted = parse(record), True
        elif record.opcode in groups:
            groups[record.opcode].append(parse(record))
    return index


def read_summary(path: str | os.PathLike[str]) -> tuple[Index, dict[str, dict[str, str]]]:
    """Index and metadata records of a whole log, reading only its end and those records.

    Raises Damage where they are not there or do not match their checksums, LogError where the file is no
    MCAP.
    """
    try:
        with open(path, "rb") as stream:
            require_magic(stream.read(64), path)
            size = os.fstat(stream.fileno()).st_size
            index = parse_summary(*_summary_bytes(stream, size))
            metadata = {}
            for entry in index.metadata:
                if entry.offset + entry.length > size:
                    raise Damage("an index points outside the file", entry.offset)
                stream.seek(entry.offset)
                record = next(walk(stream.read(entry.length), 0))
                if record.opcode != Opcode.METADATA:
                    raise Damage("a metadata index is wrong", entry.offset)
                record = Record(record.opcode, entry.offset, entry.offset + entry.length, record.body)
                found = parse_metadata(record, OUR_METADATA)
                metadata[found.name] = found.metadata
            return index, metadata
    except OSError:
        read_bytes(path)  # raises the LogError that says why
        raise LogError(f"cannot read {path}") from None
    except (StopIteration, *READ_ERRORS):
        raise Damage("the summary is damaged", 0) from None


def read_metadata(path: str | os.PathLike[str]) -> dict[str, dict[str, str]]:
    """Metadata records by name ('run', 'units', 'result') without reading the chunks.

    A file without a summary, such as the `.part` file of a run that has not ended, is walked through instead.
    Raises LogError for a file that is missing, no MCAP, or whose metadata are damaged.
    """
    with suppress(Damage):
        index, found = read_summary(path)
        if index.metadata or (index.counted and not index.statistics.metadata_count):
            return found
    contents = read_contents(read_bytes(path), path)
    try:
        for record in contents.records:
            if record.opcode == Opcode.METADATA:
                take(contents, record)
    except Damage as damage:
        raise LogError(f"{path}: {damage}") from None
    return contents.metadata
