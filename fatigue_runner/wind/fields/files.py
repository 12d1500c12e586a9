"""Reading the bytes of a wind file, and telling what is no wind file at all."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

from fatigue_runner.encoded import refuse_pointer
from fatigue_runner.errors import InputError


def read_bytes(path: Path) -> bytes:
    """The file's bytes; raises InputError for a missing or empty file, a folder and a Git LFS pointer."""
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: no such wind file; check the path") from None
    except OSError as error:
        raise InputError(f"{path}: the wind file cannot be read ({error.strerror}); check the path") from None
    if not data:
        raise InputError(f"{path}: the wind file is empty; make it anew")
    refuse_pointer(data, path, "the wind field")
    return data


def read_text(path: Path) -> list[str]:
    """The lines of a text file; raises InputError as `read_bytes`, and for bytes that are no text."""
    data = read_bytes(path)
    if b"\0" in data:
        raise InputError(f"{path}: a text file was expected, but this is binary; check the format")
    return data.decode("utf-8-sig", errors="replace").splitlines()


class Header:
    """Reads the little-endian numbers at the head of a binary file, in order."""

    def __init__(self, path: Path, data: bytes) -> None:
        self.path, self.data, self.position = path, data, 0

    def take(self, form: str) -> tuple[Any, ...]:
        """The next numbers, `form` as in `struct` (h: 2-byte integer, i: 4-byte integer, f: 4-byte float)."""
        form = f"<{form}"
        try:
            values = struct.unpack_from(form, self.data, self.position)
        except struct.error:
            raise InputError(
                f"{self.path}: the file ends within its header, after {len(self.data)} bytes; make it anew"
            ) from None
        self.position += struct.calcsize(form)
        return values

    def skip(self, count: int) -> None:
        """Passes over `count` bytes."""
        self.take(f"{count}x")


def refuse_swapped(path: Path, data: bytes, known: tuple[int, ...], what: str) -> None:
    """Raises InputError where the first 2-byte integer is one of `known` in the other byte order."""
    if len(data) < 2 or struct.unpack_from("<h", data)[0] in known:
        return
    if struct.unpack_from(">h", data)[0] in known:
        raise InputError(
            f"{path}: the bytes of this {what} file stand in big-endian order; write it in little-endian order, "
            "as OpenFAST reads it"
        )


def single(value: float) -> float:
    """The decimal number that a single-precision one was written for: 0.05, not 0.0500000007."""
    return float(f"{value:.7g}")
