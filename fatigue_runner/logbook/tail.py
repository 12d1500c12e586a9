"""Following a log that is still being written: each whole chunk as soon as it is in the file."""

from __future__ import annotations

import os
from pathlib import Path
from types import TracebackType
from typing import Self

from mcap.opcode import Opcode

from fatigue_runner.logbook.container import MAGIC
from fatigue_runner.logbook.contents import Contents, require_magic, take
from fatigue_runner.logbook.errors import LogError
from fatigue_runner.logbook.files import part_of
from fatigue_runner.logbook.generic import Tables
from fatigue_runner.logbook.layout import RowLayout
from fatigue_runner.logbook.reader import Log, assemble, chunk_tables, join, row_layout
from fatigue_runner.logbook.records import Damage, Record, open_chunk, walk


class LogTail:
    """Reads the rows that were added to a log since the last look; a context manager.

        with LogTail("case.mcap") as tail:
            while not tail.ended:
                block = tail.poll()         # None where there is nothing new
                ...                         # wait in between: poll never does

    path: the log's final name; `<path>.part` is followed while that is what there is. Of the blocks' status
    arrays the first has n - 1 entries and each later one n, as in `LogWriter.append`. Raises LogError where
    the file is not there, is no log of this program, or is damaged.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self.rows = 0
        self.ended = False
        self._contents = Contents([], ours=True)
        self._layout: RowLayout | None = None
        self._pending = b""
        self._begun = False
        self._read = 0
        for name in (part_of(self.path), self.path):
            try:
                self._stream = open(name, "rb")  # noqa: SIM115  (open as long as this object)
                return
            except OSError:
                continue
        raise LogError(f"there is no log {self.path} to follow, and no {part_of(self.path)}")

    def poll(self) -> Log | None:
        """The rows of the chunks that were completed since the last call, None where there are none."""
        if os.fstat(self._stream.fileno()).st_size < self._read:
            raise LogError(f"{self.path} was begun anew while it was followed; follow it again")
        new = self._stream.read()
        self._read += len(new)
        self._pending += new
        first_row, pieces = self.rows, self._new_tables()
        if not pieces:
            return None
        tables = join(pieces)
        rows = self.rows - first_row
        return assemble(tables, rows, rows - (first_row == 0), self._contents)

    def _new_tables(self) -> list[Tables]:
        """Take the whole records off the pending bytes; a record that is not whole yet stays."""
        if not self._begun:
            if len(self._pending) < len(MAGIC):
                return []
            require_magic(self._pending, self.path)
            self._pending, self._begun = self._pending[len(MAGIC) :], True
        pieces: list[Tables] = []
        used = 0
        try:
            for record in walk(self._pending, 0):
                used = record.end
                self._take(record, pieces)
                if self.ended:
                    break
        except Damage as damage:
            if used > damage.offset:
                raise LogError(f"{self.path} is damaged: {damage.what}") from None
        self._pending = self._pending[used:]
        return pieces

    def _take(self, record: Record, pieces: list[Tables]) -> None:
        if record.opcode == Opcode.DATA_END:
            self.ended = True
        elif record.opcode != Opcode.CHUNK:
            take(self._contents, record)
        else:
            self._layout = self._layout or row_layout(self._contents)
            plain = open_chunk(record, must_be_signed=True)[1]
            rows = self._layout.rows_in(plain, self.rows) if self._layout else None
            if self._layout is None or rows is None:
                raise LogError(
                    f"{self.path} is no log of this program that can be followed; read it when it is whole"
                )
            pieces.append(chunk_tables(self._layout, rows, self.rows))
            self.rows += len(rows)

    def close(self) -> None:
        """Stop following."""
        self._stream.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
