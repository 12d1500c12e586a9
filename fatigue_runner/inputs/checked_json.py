"""JSON files of this program whose first entry is a checksum of the others: a figure with a flipped bit is a figure, and nothing else
would tell."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from typing import Any

_CHECKSUM = "crc32"


def to_checked(data: Mapping[str, Any], indent: int = 1) -> bytes:
    """A mapping as such a file."""
    return json.dumps({_CHECKSUM: _checksum(data), **data}, indent=indent).encode() + b"\n"


def from_checked(text: str | bytes) -> dict[str, Any]:
    """The mapping, without its checksum; one that has none is taken as it is. Raises ValueError for anything else."""
    try:
        data = json.loads(text)
    except RecursionError:
        raise ValueError("it nests too deeply") from None
    if not isinstance(data, dict):
        raise ValueError("it is no mapping")
    if data.pop(_CHECKSUM, None) not in (None, _checksum(data)):
        raise ValueError("its checksum is wrong: it is damaged, or was edited")
    return data


def _checksum(data: Mapping[str, Any]) -> str:
    return f"{zlib.crc32(json.dumps(data).encode()):08x}"
