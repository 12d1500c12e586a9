"""Repairing a log that was cut off or damaged: every whole row before it, in a file for every reader."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from fatigue_runner.logbook.check import Check, MessageOrder, check
from fatigue_runner.logbook.container import Container, library_name
from fatigue_runner.logbook.contents import Contents, read_contents
from fatigue_runner.logbook.errors import LogError
from fatigue_runner.logbook.files import read_bytes, refuse_if_being_written, replacing
from fatigue_runner.logbook.reader import row_layout
from fatigue_runner.logbook.records import (
    Damage,
    Record,
    message_entries,
    open_chunk,
    parse,
    parse_attachment,
    parse_metadata,
    walk,
)

__all__ = ["Check", "Recovery", "check", "recover"]


@dataclass
class Recovery:
    """What `recover` did: the repaired file, its rows, their last time [s], what was lost (sentences).

    changed: False where the file was whole already.
    """

    path: Path
    rows: int = 0
    end_time: float = 0.0
    lost: list[str] = field(default_factory=list)
    changed: bool = True


class _Rebuild:
    """Copies what is good of a damaged file into a new one."""

    def __init__(self, contents: Contents, stream: IO[bytes]) -> None:
        self.contents = contents
        header = contents.header
        self.container = Container(
            stream, header.library if header else library_name(), header.profile if header else ""
        )
        self.order = MessageOrder(contents)
        self.lost: list[str] = []
        self.stopped: Damage | None = None
        self.dropped_chunks = 0
        self.end_time = 0.0

    def take(self, record: Record) -> None:
        """Copy one record, or note it as lost."""
        try:
            if record.opcode == Opcode.CHUNK:
                if self.stopped:
                    self.dropped_chunks += 1
                else:
                    self._chunk(record)
            elif record.opcode == Opcode.METADATA:
                self._metadata(record)
            elif record.opcode == Opcode.ATTACHMENT:
                self.container.attachment(parse_attachment(record))
            elif record.opcode == Opcode.SCHEMA:
                self.container.schema(parse(record))
            elif record.opcode == Opcode.CHANNEL:
                self.container.channel(parse(record))
        except Damage as damage:
            if record.opcode == Opcode.CHUNK:
                self.stopped = damage
                self.dropped_chunks += 1
            else:
                self.lost.append(damage.what)

    def _metadata(self, record: Record) -> None:
        found = parse_metadata(record, self.contents.signed)
        # What a run said of its end does not hold for a log that ends earlier.
        if (
            found.name == "result"
            and self.contents.ours
            and found.metadata.get("rows") != str(self.order.rows)
        ):
            return
        self.container.raw_metadata(parse(record))

    def _chunk(self, record: Record) -> None:
        chunk, plain = open_chunk(record, self.contents.written_here)
        entries = message_entries(plain, record.start)
        wrong = self.order.problem(entries)
        if wrong:
            raise Damage(wrong, record.start)
        self._declare(plain)
        if not set(entries) <= {c.id for c in self.container.index.channels}:
            raise Damage("the declaration of a topic is lost", record.start)
        places = {channel_id: found[:, :2] for channel_id, found in entries.items()}
        if places:
            size, crc = chunk.uncompressed_size, chunk.uncompressed_crc
            self.container.chunk(chunk.data, chunk.compression, size, crc, places)
            self.end_time = self.container.index.statistics.message_end_time / 1e9

    def _declare(self, plain: bytes) -> None:
        """Repeat in the summary what other writers declare inside chunks."""
        index = self.container.index
        for record in () if self.contents.channels else walk(plain, 0):
            if record.opcode == Opcode.SCHEMA:
                schema: Schema = parse(record)
                if schema not in index.schemas:
                    index.schemas.append(schema)
                    index.statistics.schema_count += 1
            elif record.opcode == Opcode.CHANNEL:
                channel: Channel = parse(record)
                if channel not in index.channels:
                    index.channels.append(channel)
                    index.statistics.channel_count += 1

    def losses(self, size: int) -> list[str]:
        """What the new file lacks, a sentence each; size: of the damaged file [bytes]."""
        contents, lost = self.contents, list(self.lost)
        damage = self.stopped or next((d for d in contents.damages if not contents.ended), None)
        total = contents.metadata.get("result", {}).get("rows", "")
        rows = self.order.rows
        if damage and not (total and total == str(rows)):
            known = f" of {total}" if total else ""
            lost.append(
                f"every row after {self.end_time:g} s: {rows}{known} rows are kept; {damage.what} at byte "
                f"{damage.offset} of {size}"
            )
        elif total and total != str(rows):
            lost.append(f"rows at the end: {rows} of {total} are kept, up to {self.end_time:g} s")
        if self.dropped_chunks > 1:
            lost.append(
                f"{self.dropped_chunks - 1} chunks after the damage, since rows before them are missing"
            )
        if "result" not in {m.name for m in self.container.index.metadata} and contents.ours:
            lost.append("the result of the run: it had not ended, or its end is lost")
        return lost

    def finish(self, size: int) -> list[str]:
        """Write what was lost, the indexes and the summary; returns what was lost."""
        lost = self.losses(size)
        if lost:
            entries = {
                "kept_rows": str(self.order.rows),
                "kept_until": str(self.end_time),
                "lost": "; ".join(lost),
            }
            self.container.metadata("recovery", entries)
        self.container.finish()
        return lost


def _target(path: Path, to: str | os.PathLike[str] | None) -> Path:
    """Where the repaired file goes: `to`, the final name of a `.part` file, or the file's own place."""
    if to is not None:
        target = Path(to)
        if target.exists() and not target.samefile(path):
            raise LogError(f"{target} is there already; choose another name for the copy")
        return target
    final = path.with_suffix("")
    return final if path.suffix == ".part" and not final.exists() else path


def _refuse(path: Path, contents: Contents) -> None:
    try:
        row_layout(contents)
    except LogError as error:
        raise LogError(f"{path} cannot be recovered: {error}") from None
    if contents.messages:
        raise LogError(
            f"{path} holds messages outside chunks, as no log of this program does; use `mcap recover`"
        )


def _keep(source: Path, target: Path, data: bytes, found: Check) -> Recovery:
    """Nothing is wrong with the file: copy it if a copy is asked for."""
    if target != source:
        with replacing(target, ".recovering") as stream:
            stream.write(data)
    return Recovery(target, found.rows, changed=False)


def recover(path: str | os.PathLike[str], to: str | os.PathLike[str] | None = None) -> Recovery:
    """Repair a log: keep the rows before the first damage, rebuild the indexes, say what was lost.

    to: write a copy there; None repairs in place, and a `.part` file gets its final name. The file is
    replaced only when the new one is whole, so the folder needs room for both. A whole file is left as it
    is (or copied). Raises LogError for a file that is missing, no MCAP, still being written, or without any
    whole chunk.
    """
    source = Path(path)
    data = read_bytes(source)
    contents = read_contents(data, source)
    refuse_if_being_written(source)
    target = _target(source, to)
    found = check(source)
    if found.ok:
        return _keep(source, target, data, found)
    _refuse(source, contents)
    with replacing(target, ".recovering") as stream:
        rebuild = _Rebuild(contents, stream)
        for record in contents.records:
            rebuild.take(record)
        if not rebuild.container.index.chunks:
            what = f": {contents.damages[0]}" if contents.damages else ""
            raise LogError(f"{source} holds no whole chunk, so nothing can be recovered{what}")
        lost = rebuild.finish(len(data))
    if target != source and source.suffix == ".part" and to is None:
        source.unlink()
    return Recovery(target, rebuild.order.rows, rebuild.end_time, lost)
