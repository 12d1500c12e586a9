"""The bytes of a file that somebody gave: the text that they are, in whatever encoding, a Git LFS pointer told as one, a checksum."""

from __future__ import annotations

import codecs
import os
import zlib
from typing import Any

from fatigue_runner.errors import InputError

_POINTER = b"version https://git-lfs"
# the longer mark first: that of UTF-32 begins as that of UTF-16 does
_MARKS = {
    codecs.BOM_UTF32_LE: "utf-32", codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF8: "utf-8-sig", codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16",
}  # fmt: skip


def refuse_pointer(
    data: bytes | memoryview, path: Any, what: str, error: type[InputError] = InputError
) -> None:
    """Raises `error` where the data are what Git LFS leaves in place of a file that was not fetched; what: the file should be."""
    if bytes(data[: len(_POINTER)]) == _POINTER:
        raise error(f"{path}: this is a Git LFS pointer, not {what} itself; fetch it with 'git lfs pull'")


def decoded(data: bytes, path: Any, what: str) -> str:
    """The text, in UTF-8 or, as some editors and shells write it, in UTF-16 or UTF-32; without the mark at its beginning.

    what: the file should be. Raises InputError for other encodings, with the line and what to do, and for a Git LFS pointer.
    """
    refuse_pointer(data, path, what)
    encoding = next((name for mark, name in _MARKS.items() if data.startswith(mark)), None)
    if encoding is None:
        encoding = _without_mark(data[:2])
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise InputError(
            f"{path}:{line}: this is no text in UTF-8 (byte 0x{data[error.start]:02x}); save it as UTF-8, or check that it is {what}"
        ) from None


def _without_mark(start: bytes) -> str:
    """A text begins with a sign of ASCII, so that the place of its zero tells UTF-16 (YAML 1.2.2, 5.2)."""
    for zero, name in ((0, "utf-16-be"), (1, "utf-16-le")):
        if len(start) == 2 and start[zero] == 0 and (start[1 - zero] >= 0x20 or start[1 - zero] in b"\t\r\n"):
            return name
    return "utf-8"


def checksum(path: str | os.PathLike[str]) -> int:
    """CRC-32 of a whole file; OSError where it cannot be read."""
    crc = 0
    with open(path, "rb") as stream:
        while data := stream.read(1 << 20):
            crc = zlib.crc32(data, crc)
    return crc
