"""The compressions of MCAP chunks, by the names of the API and of the file."""

from __future__ import annotations

from collections.abc import Callable

import lz4.frame
import zstandard

from fatigue_runner.errors import did_you_mean
from fatigue_runner.logbook.errors import LogError

# Of a turbine in turbulence, level 1 is 3 % smaller, half as fast to write and a third as fast to read,
# since it also entropy-codes mantissas that are noise; level 3 gains nothing more (measured).
_ZSTD_LEVEL = -3
# A damaged size must not become an allocation that stops the machine; our chunks have 1 MiB, others' rarely
# more.
_LARGEST_CHUNK = 1 << 30

# API name -> name in the file
COMPRESSIONS = {"zstd": "zstd", "lz4": "lz4", "none": ""}


def _compress_zstd(data: memoryview) -> bytes:
    return zstandard.ZstdCompressor(level=_ZSTD_LEVEL).compress(data)


def compressor(name: str) -> tuple[str, Callable[[memoryview], bytes]]:
    """Name in the file and function of a compression of `COMPRESSIONS`. Raises LogError for others."""
    if name not in COMPRESSIONS:
        raise LogError(f"unknown log compression {name!r}{did_you_mean(name, COMPRESSIONS)}")
    functions: dict[str, Callable[[memoryview], bytes]] = {
        "zstd": _compress_zstd,
        "lz4": lz4.frame.compress,
        "none": bytes,
    }
    return COMPRESSIONS[name], functions[name]


def decompress(name: str, data: bytes, size: int) -> bytes:
    """The `size` bytes that `data` holds; name: the compression as the file names it.

    Raises ValueError for anything else than `size` bytes, before they are allocated where the data tell.
    """
    if size > _LARGEST_CHUNK:
        raise ValueError(f"claims to hold {size} bytes")
    if name == "zstd":
        if zstandard.frame_content_size(data) not in (size, -1):
            raise ValueError("holds another size than it claims")
        plain = zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
    elif name == "lz4":
        if lz4.frame.get_frame_info(data)["content_size"] not in (size, 0):
            raise ValueError("holds another size than it claims")
        plain = lz4.frame.decompress(data)
    elif name == "":
        plain = data
    else:
        raise ValueError(f"has the unknown compression {name!r}")
    if len(plain) != size:
        raise ValueError("holds another size than it claims")
    return plain
