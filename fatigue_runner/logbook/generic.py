"""Reading logs of another layout: any MCAP file with our topics as protobuf messages, one message at a time.

For files that other programs wrote or rewrote (`mcap filter`, `mcap merge`, the `mcap` library): other
chunks, other field numbers, float32, zeros left out. Slow, so only where the fixed layout does not fit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from google.protobuf.message import DecodeError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from mcap.well_known import MessageEncoding
from mcap_protobuf.decoder import DecoderFactory

from fatigue_runner.logbook.contents import Contents
from fatigue_runner.logbook.errors import LogError
from fatigue_runner.logbook.records import READ_ERRORS, Damage, Record, open_chunk, parse, split_message, walk
from fatigue_runner.logbook.schema import BY_TOPIC, Topic

# Topic key -> column name -> values; `_log_time` [ns] and `_sequence` beside the fields.
Tables = dict[str, dict[str, np.ndarray]]


def message_class(schema: Schema) -> Any:
    """The protobuf class of an MCAP schema record. Raises McapError where the record does not hold it."""
    decode = DecoderFactory().decoder_for(MessageEncoding.Protobuf, schema)
    if decode is None:
        raise LogError(f"schema {schema.name!r} is written in {schema.encoding!r}; it must be protobuf")
    return type(decode(b""))


class _Column:
    """The messages of one channel."""

    def __init__(self, topic: Topic, schema: Schema) -> None:
        self.topic = topic
        self.own_too = topic.open and schema.name == topic.schema_name
        self.parse: Callable[[bytes], Any] = message_class(schema).FromString
        self.log_time: list[int] = []
        self.sequence: list[int] = []
        self.messages: list[Any] = []

    def table(self) -> dict[str, np.ndarray]:
        """The channel's columns in the order of time: those of our fields that its schema has as numbers, and an open topic's own."""
        columns: dict[str, np.ndarray] = {
            "_log_time": np.array(self.log_time, np.uint64),
            "_sequence": np.array(self.sequence, np.uint32),
        }
        declarations: Any = self.messages[0].DESCRIPTOR.fields_by_name if self.messages else {}
        kinds = {f.name: {"bool": bool, "fixed32": np.uint32}.get(f.kind, float) for f in self.topic.fields}
        if self.own_too:
            own = sorted(declarations.values(), key=lambda declared: declared.number) if declarations else []
            kinds |= {f.name: float for f in own if f.name not in kinds and f.type == f.TYPE_DOUBLE}
        for name, kind in kinds.items():
            declared = declarations.get(name)
            if declared is None or declared.message_type is not None or declared.is_repeated:
                continue
            columns[name] = np.array([getattr(m, name) for m in self.messages], kind)
        if (columns["_log_time"][1:] < columns["_log_time"][:-1]).any():
            order = np.argsort(columns["_log_time"], kind="stable")
            columns = {name: values[order] for name, values in columns.items()}
        return columns


class _Decoder:
    """Takes schemas, channels and messages as they come, in chunks and outside."""

    def __init__(self, contents: Contents) -> None:
        # Those declared inside chunks join those outside.
        self.schemas = contents.schemas
        self.channels = contents.channels
        self.columns: dict[int, _Column | None] = {}

    def take(self, record: Record) -> None:
        if record.opcode == Opcode.SCHEMA:
            schema: Schema = parse(record)
            self.schemas[schema.id] = schema
        elif record.opcode == Opcode.CHANNEL:
            channel: Channel = parse(record)
            self.channels[channel.id] = channel
        elif record.opcode == Opcode.MESSAGE:
            channel_id, sequence, log_time, data = split_message(record.body)
            if channel_id not in self.columns:
                self.columns[channel_id] = self._open(channel_id)
            column = self.columns[channel_id]
            if column is not None:
                column.messages.append(column.parse(data))
                column.log_time.append(log_time)
                column.sequence.append(sequence)

    def _open(self, channel_id: int) -> _Column | None:
        channel = self.channels[channel_id]
        topic = BY_TOPIC.get(channel.topic)
        if topic is None:
            return None
        if channel.message_encoding != "protobuf":
            raise LogError(
                f"topic {channel.topic!r} is encoded as {channel.message_encoding!r}; it must be protobuf"
            )
        return _Column(topic, self.schemas[channel.schema_id])


def _records(contents: Contents, damages: list[Damage]) -> Iterator[tuple[Record, int]]:
    """Schema, channel and message records with their place in the file, up to the first damage."""
    for outer in contents.records:
        if outer.opcode == Opcode.MESSAGE:
            yield outer, outer.start
        elif outer.opcode == Opcode.CHUNK:
            try:
                plain = open_chunk(outer, contents.written_here)[1]
                for inner in walk(plain, 0):
                    yield inner, outer.start
            except Damage as damage:
                damages.append(damage)
                return


def decode(contents: Contents) -> tuple[Tables, list[Damage]]:
    """Columns of our topics in a file of any layout, up to the first damage, and that damage."""
    damages: list[Damage] = []
    decoder = _Decoder(contents)
    for record, place in _records(contents, damages):
        try:
            decoder.take(record)
        except (*READ_ERRORS, DecodeError, Damage):
            damages.append(Damage("a message does not match its schema", place))
            break
    tables: Tables = {}
    for column in decoder.columns.values():
        if column is None:
            continue
        if column.topic.key in tables:
            raise LogError(f"topic {column.topic.name!r} is there twice; keep one of them (`mcap filter`)")
        tables[column.topic.key] = column.table()
    return tables, damages
