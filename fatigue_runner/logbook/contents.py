"""What an MCAP file holds, before any chunk is opened: its records by kind, and every damage found."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field

from mcap.opcode import Opcode
from mcap.records import Channel, Header, Schema

from fatigue_runner.encoded import refuse_pointer
from fatigue_runner.logbook.container import LIBRARY, MAGIC
from fatigue_runner.logbook.errors import LogError
from fatigue_runner.logbook.records import Damage, Record, parse, parse_attachment, parse_metadata, walk
from fatigue_runner.logbook.schema import BY_TOPIC, PACKAGE, Topic, known_topic

# Metadata records of this program; each carries its own checksum.
OUR_METADATA = frozenset({"run", "units", "result", "recovery"})
_DATA_OPCODES = frozenset(
    {
        Opcode.HEADER,
        Opcode.SCHEMA,
        Opcode.CHANNEL,
        Opcode.CHUNK,
        Opcode.MESSAGE_INDEX,
        Opcode.ATTACHMENT,
        Opcode.METADATA,
    }
)


@dataclass
class Contents:
    """The data section of an MCAP file.

    ours: a log of this program, written by it or rewritten by an MCAP tool; written_here: by it, so that all of its checksums and
    indexes are due, which MCAP leaves to the writer. damages: what was found wrong, in the order of the file; ended: the data section is
    whole.
    """

    records: list[Record]
    ours: bool
    header: Header | None = None
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    chunks: list[Record] = field(default_factory=list)
    messages: list[Record] = field(default_factory=list)
    damages: list[Damage] = field(default_factory=list)
    ended: bool = False
    verified: bool = False

    @property
    def written_here(self) -> bool:
        """Whether the header names this program."""
        return self.header is not None and str(self.header.library).startswith(LIBRARY)

    @property
    def signed(self) -> frozenset[str]:
        """Names of the metadata records that must carry a checksum."""
        return OUR_METADATA if self.ours else frozenset()

    def topics(self) -> dict[int, Topic]:
        """Channel id -> topic with its fields, for the channels that this program declares.

        Raises LogError where a declaration was damaged.
        """
        found = {}
        units = self.metadata.get("units") if self.ours else None
        for channel in self.channels.values():
            schema = self.schemas.get(channel.schema_id)
            if schema and channel.message_encoding == schema.encoding == "protobuf":
                topic = known_topic(channel.topic, schema.name, schema.data)
            elif channel.topic in BY_TOPIC:
                raise LogError(f"the declaration of topic {channel.topic!r} is damaged")
            else:
                topic = None
            if topic is not None and units:
                # names that only the log knows: they stand in a record with a checksum, too
                for name in BY_TOPIC[topic.name].further(topic.field_names):
                    if name not in units:
                        raise LogError(f"the schema of topic {topic.name!r} is damaged at field {name!r}")
            if topic is not None:
                found[channel.id] = topic
        if len({t.key for t in found.values()}) < len(found):
            raise LogError("a topic is declared twice")
        return found


def require_magic(data: bytes, path: object) -> None:
    """Raises LogError where the data do not begin as an MCAP file does."""
    if not data:
        raise LogError(f"{path} is empty, not an MCAP log")
    refuse_pointer(data, path, "the log", LogError)
    if not data.startswith(MAGIC):
        raise LogError(f"{path} is not an MCAP log: it begins with {bytes(data[:8])!r}, not with {MAGIC!r}")


def _is_ours(records: list[Record]) -> bool:
    """Whether header or schema name this program; two signs, so that one flipped bit hides nothing."""
    for record in records:
        try:
            if record.opcode == Opcode.HEADER and parse(record).library.startswith(LIBRARY):
                return True
            if record.opcode == Opcode.SCHEMA and parse(record).name.startswith(f"{PACKAGE}."):
                return True
        except Damage:
            continue
    return False


def read_contents(data: bytes, path: object) -> Contents:
    """Sort the records of a file's data section. Raises LogError only where it is no MCAP file at all."""
    require_magic(data, path)
    records: list[Record] = []
    damages: list[Damage] = []
    try:
        for record in walk(data):
            records.append(record)
            if record.opcode == Opcode.DATA_END:
                break
    except Damage as damage:
        damages.append(damage)
    contents = Contents(records, _is_ours(records))
    for record in records:
        try:
            take(contents, record)
            if record.opcode == Opcode.DATA_END:
                _verify(contents, record, data)
        except Damage as damage:
            contents.damages.append(damage)
    if not contents.ended and not damages:
        damages.append(Damage("the file is cut off", len(data)))
    contents.damages.extend(damages)
    return contents


def _verify(contents: Contents, end: Record, data: bytes) -> None:
    crc = parse(end).data_section_crc
    if (crc or contents.written_here) and crc != zlib.crc32(memoryview(data)[: end.start]):
        raise Damage("the file does not match its checksum", end.start)
    contents.verified = True


def take(contents: Contents, record: Record) -> None:
    """Sort one record into the contents. Raises Damage where it does not match its own checksum."""
    opcode = record.opcode
    if opcode == Opcode.CHUNK:
        contents.chunks.append(record)
    elif opcode == Opcode.MESSAGE:
        contents.messages.append(record)
    elif opcode == Opcode.METADATA:
        found = parse_metadata(record, contents.signed)
        contents.metadata[found.name] = found.metadata
    elif opcode == Opcode.ATTACHMENT:
        attachment = parse_attachment(record)
        contents.attachments[attachment.name] = attachment.data
    elif opcode == Opcode.HEADER:
        contents.header = parse(record)
    elif opcode == Opcode.SCHEMA:
        schema: Schema = parse(record)
        contents.schemas[schema.id] = schema
    elif opcode == Opcode.CHANNEL:
        channel: Channel = parse(record)
        contents.channels[channel.id] = channel
    elif opcode == Opcode.DATA_END:
        contents.ended = True
    elif contents.written_here and opcode not in _DATA_OPCODES:
        raise Damage(f"a record of unknown kind {opcode}", record.start)
