"""Reading and writing files without a traceback and without half a file under a final name."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from fatigue_runner.logbook.errors import LogError

_WRITE_HINTS = {
    errno.ENOSPC: "the disk is full; free space or choose another folder",
    errno.EDQUOT: "the disk quota is used up; free space or choose another folder",
    errno.EFBIG: "the file would be larger than the system allows; choose another folder",
    errno.EACCES: "no permission to write there; choose another folder",
    errno.EPERM: "no permission to write there; choose another folder",
    errno.EROFS: "the file system is read-only; choose another folder",
    errno.EISDIR: "there is a folder of that name; choose another name",
}


@contextmanager
def write_errors(path: Path) -> Iterator[None]:
    """Turn the system's errors in writing `path` into a LogError that says what to do."""
    try:
        yield
    except OSError as error:
        reason = _WRITE_HINTS.get(error.errno or 0, error.strerror or str(error))
        if error.errno in (errno.ENOENT, errno.ENOTDIR):
            reason = f"{path.parent} is not a folder; make it first or choose another one"
        raise LogError(f"cannot write {path}: {reason}") from error


def part_of(path: Path) -> Path:
    """The temporary name of `path` while it is being written."""
    return path.with_name(path.name + ".part")


def publish(stream: IO[bytes], part: Path, path: Path, sync: bool = True) -> None:
    """Flush, fsync and close `stream`, which is `part`, and rename it to `path`; sync: make both durable."""
    stream.flush()
    if sync:
        os.fsync(stream.fileno())
    stream.close()
    os.replace(part, path)
    if sync:
        # The rename lives in the folder; not every system lets a folder be opened and synced.
        with suppress(OSError):
            handle = os.open(path.parent, os.O_RDONLY)
            try:
                os.fsync(handle)
            finally:
                os.close(handle)


def open_exclusively(part: Path) -> IO[bytes]:
    """Open the file to write it from its beginning, locked against other writers until it is closed.

    Raises LogError where another process writes it. Where the system has no such locks, nothing is locked.
    """
    stream = open(part, "ab")  # noqa: SIM115  (returned open)
    if not _lock(stream, exclusive=True):
        stream.close()
        raise LogError(f"{part} is being written by another process; wait for it or choose another folder")
    if os.fstat(stream.fileno()).st_size:
        stream.truncate(0)
    return stream


def refuse_if_being_written(path: Path) -> None:
    """Raises LogError where a process holds the file open to write it."""
    with open(path, "rb") as stream:
        if not _lock(stream, exclusive=False):
            raise LogError(f"{path} is still being written; wait until its run has ended")


def _lock(stream: IO[bytes], exclusive: bool) -> bool:
    """False where another process holds a lock that excludes this one."""
    try:
        import fcntl
    except ImportError:  # Windows
        return True
    try:
        fcntl.flock(stream, (fcntl.LOCK_EX if exclusive else fcntl.LOCK_SH) | fcntl.LOCK_NB)
    except OSError as error:
        # Other errors mean that the file system has no locks.
        return error.errno not in (errno.EWOULDBLOCK, errno.EACCES)
    return True


@contextmanager
def replacing(path: Path, suffix: str = ".part") -> Iterator[IO[bytes]]:
    """A binary stream that becomes `path` when the block ends well, and leaves nothing behind else."""
    part = path.with_name(path.name + suffix)
    with write_errors(path):
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, "")
        stream = open(part, "wb")  # noqa: SIM115  (closed by publish, before the rename)
        try:
            yield stream
            publish(stream, part, path)
        except BaseException:
            with suppress(OSError):
                stream.close()
            with suppress(OSError):
                part.unlink()
            raise


def read_bytes(path: str | os.PathLike[str]) -> bytes:
    """The file's bytes. Raises LogError for a file that is not there or cannot be read."""
    try:
        return Path(path).read_bytes()
    except FileNotFoundError:
        part = part_of(Path(path))
        hint = f"; the run that writes it has not ended: {part} is there" if part.exists() else ""
        raise LogError(f"no log {path}{hint}") from None
    except IsADirectoryError:
        raise LogError(f"{path} is a folder, not a log; name one of the .mcap files in it") from None
    except (OSError, ValueError, MemoryError) as error:
        reason = getattr(error, "strerror", None) or str(error) or "it does not fit into memory"
        raise LogError(f"cannot read {path}: {reason}") from None
