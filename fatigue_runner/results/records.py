"""Records of finished cases as lines of `cases.jsonl`: each is JSON whose first entry is a checksum of the others."""

from __future__ import annotations

import json
import zlib
from collections.abc import Iterable
from typing import Any

_HEAD = b'{"crc32":"%08x",'
_SIZE = len(_HEAD % 0)


def to_line(record: dict[str, Any]) -> bytes:
    """A record as a line."""
    rest = json.dumps(record, allow_nan=False).encode()[1:]
    return _HEAD % zlib.crc32(rest) + rest + b"\n"


def from_line(line: bytes) -> dict[str, Any] | None:
    """The record in a line, without its end; None for one that is not as it was written: cut off, a flipped bit. Ends of lines that a
    program made Windows' are none of its bits."""
    line = line.removesuffix(b"\r")
    if line[:_SIZE] != _HEAD % zlib.crc32(line[_SIZE:]):
        return None
    record: dict[str, Any] = json.loads(b"{" + line[_SIZE:])
    return record


def whole_records(text: bytes) -> tuple[list[dict[str, Any]], int]:
    """The records in a text of such lines, and how many of its lines are no record any more; the last one may be half written."""
    *lines, last = text.split(b"\n")
    found = [from_line(line) for line in lines if line]
    end = from_line(last) if last else None
    whole: Iterable[dict[str, Any]] = [record for record in (*found, end) if record is not None]
    return list(whole), found.count(None)
