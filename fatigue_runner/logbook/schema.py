"""What a log holds: topics, flat named fields with fixed numbers, and the protobuf schemas from them.

Numbers are for ever: `time` is 1, a channel is its position in `channels` plus 2, so channels are only ever
added at the end of their list; the wind's azimuthal harmonics, of which a log has as many as its wind, count
from 101 on, loads of sections, of which it has those of its campaign, from 201 on. States of first order, of a
controller say, follow those of the turbine: each log says by its schema which it has. A schema names the fields
that the log holds and no others, since a proto3 reader shows a declared but absent double as 0.0, which nobody
could tell from a measurement.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache

from google.protobuf import descriptor_pb2
from google.protobuf.message import DecodeError

from fatigue_runner import channels
from fatigue_runner.errors import did_you_mean
from fatigue_runner.logbook.errors import LogError

SCHEMA_VERSION = "1"
PACKAGE = "fatigue_runner"

_PROTO = descriptor_pb2.FieldDescriptorProto
# kind: (protobuf type, wire type, numpy type). Each takes the same number of bytes whatever its value,
# which is what lets a chunk be one structured array: doubles, floats and fixed32 by definition, a bool as a
# one-byte varint.
KINDS: dict[str, tuple[int, int, str]] = {
    "double": (_PROTO.TYPE_DOUBLE, 1, "<f8"),
    "float": (_PROTO.TYPE_FLOAT, 5, "<f4"),
    "bool": (_PROTO.TYPE_BOOL, 0, "u1"),
    "fixed32": (_PROTO.TYPE_FIXED32, 5, "<u4"),
}


# name in a campaign -> kind of the numbers
PRECISIONS = {"float64": "double", "float32": "float"}
GROWING = {"time", *(f"{name}_azimuth" for name in ("rotor", "generator"))}


@dataclass(frozen=True)
class Field:
    """One field of a message: its name, protobuf number, kind (a key of `KINDS`) and SI unit."""

    name: str
    number: int
    kind: str = "double"
    unit: str = "-"

    @property
    def tag(self) -> bytes:
        """The protobuf tag: number and wire type as a varint of one or two bytes."""
        value = self.number << 3 | KINDS[self.kind][1]
        return bytes([value]) if value < 0x80 else bytes([value & 0x7F | 0x80, value >> 7])


@dataclass(frozen=True)
class Topic:
    """One topic: key of the API, name in the file, message and the message's fields.

    open: a log's own fields may follow those of the table below.
    """

    key: str
    name: str
    message: str
    channel_id: int
    fields: tuple[Field, ...]
    open: bool = False

    @property
    def schema_name(self) -> str:
        """Full protobuf name of the message."""
        return f"{PACKAGE}.{self.message}"

    @property
    def field_names(self) -> tuple[str, ...]:
        """Names of the fields in the order of their numbers."""
        return tuple(f.name for f in self.fields)

    def only(self, names: Iterable[str]) -> Topic:
        """The same topic with `time` and those fields that are named."""
        wanted = {"time", *names}
        return replace(self, fields=tuple(f for f in self.fields if f.name in wanted))

    def at(self, precision: str) -> Topic:
        """The same topic with numbers of `precision`, a key of `PRECISIONS`. Time and azimuths, which grow for as long as the turbine
        turns, are doubles in any case: after ten minutes a float would have the generator's to 4e-3 rad."""
        kind = PRECISIONS[precision]
        return replace(
            self,
            fields=tuple(
                replace(f, kind=kind) if f.kind == "double" and f.name not in GROWING else f
                for f in self.fields
            ),
        )

    def of(self, signals: Sequence[channels.Channel]) -> Topic:
        """The same topic of these signals, which begin with its own and may end with the wind's harmonics."""
        return replace(self, fields=_fields(signals))

    def with_sections(self, sections: Sequence[channels.Channel]) -> Topic:
        """The same topic with the loads of sections behind its own."""
        further = (Field(c.name, FIRST_SECTION + i, "double", c.unit) for i, c in enumerate(sections))
        return replace(self, fields=(*self.fields, *further))

    def further(self, names: Iterable[str]) -> tuple[str, ...]:
        """Those of a log's columns of this topic that are the log's own, in their order."""
        return tuple(n for n in names if n not in self.field_names and not n.startswith("_"))


# log_time is rounded to ns; `time` keeps the bits, so that a duration, and with it a DEL, is the one in
# memory.
_TIME = Field("time", 1, "double", "s")


FIRST_SECTION = 201  # loads of sections, of which a log has those of its campaign
# c_1, s_1, c_2, ...: beyond the numbers that further signals of the whole rotor may get
FIRST_HARMONIC = 101


def _fields(signals: Sequence[channels.Channel]) -> tuple[Field, ...]:
    own = [c for c in signals if c not in channels.WIND_HARMONICS]
    numbers = {c.name: i + 2 for i, c in enumerate(own)}
    numbers |= {c.name: FIRST_HARMONIC + i for i, c in enumerate(channels.WIND_HARMONICS)}
    return (_TIME, *(Field(c.name, numbers[c.name], "double", c.unit) for c in signals))


STATUS_FIELDS = (
    _TIME,
    Field("accepted", 2, "bool"),
    Field("discrepancy", 3),
    Field("threshold", 4),
    Field("local_error", 5),
    Field("reference_error", 6),
    Field("clamped_lookups", 7, "fixed32"),
)

# In the order of a row: the status of the interval that ends at a time comes before the state at that time.
TOPICS: dict[str, Topic] = {
    "status": Topic("status", "/solver/status", "Status", 3, STATUS_FIELDS),
    "state": Topic("state", "/turbine/state", "State", 1, _fields(channels.STATES), open=True),
    "loads": Topic("loads", "/turbine/loads", "Loads", 2, _fields(channels.LOADS), open=True),
    "wind": Topic(
        "wind", "/wind", "Wind", 4, _fields((*channels.WIND_SIGNALS, *channels.WIND_HARMONICS)), open=True
    ),
    # of a turbine under a controller; each has signals of its own
    "control": Topic("control", "/turbine/control", "Control", 5, (_TIME,), open=True),
}
BY_TOPIC = {t.name: t for t in TOPICS.values()}
BY_SCHEMA = {t.schema_name: t for t in TOPICS.values()}


@cache
def descriptor_set(topic: Topic) -> bytes:
    """Serialised FileDescriptorSet of the topic's message (proto3), the `data` of its MCAP schema record."""
    file = descriptor_pb2.FileDescriptorProto(
        name=f"{PACKAGE}/{topic.key}.proto", package=PACKAGE, syntax="proto3"
    )
    message = file.message_type.add(name=topic.message)
    for f in topic.fields:
        message.field.add(name=f.name, number=f.number, type=KINDS[f.kind][0], label=_PROTO.LABEL_OPTIONAL)
    return descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString(deterministic=True)


def fields_in(data: bytes, name: str) -> tuple[Field, ...] | None:
    """Fields of message `name` in a FileDescriptorSet, by number; None when not all are of our `KINDS`."""
    try:
        files = descriptor_pb2.FileDescriptorSet.FromString(data)
    except DecodeError:
        return None
    kinds = {proto: kind for kind, (proto, _, _) in KINDS.items()}
    for file in files.file:
        for message in file.message_type:
            if f"{file.package}.{message.name}" != name:
                continue
            if any(f.type not in kinds or f.label == _PROTO.LABEL_REPEATED for f in message.field):
                return None
            if not all(isinstance(f.name, str) for f in message.field):  # bytes that are no text
                return None
            found = (Field(f.name, f.number, kinds[f.type]) for f in message.field)
            return tuple(sorted(found, key=lambda f: f.number))
    return None


def _allowed(field: Field) -> set[str]:
    """Kinds that a field may have in a log."""
    return {field.kind, "float"} if field.kind == "double" and field.name not in GROWING else {field.kind}


@lru_cache(maxsize=256)
def known_topic(topic_name: str, schema_name: str, data: bytes) -> Topic | None:
    """The topic that a log of ours declares, with its fields; None for one of a later version.

    Raises LogError where the declaration contradicts the table above. No checksum covers a schema in a file
    that was cut off, so a flipped bit there must not move a column to another name.
    """
    by_topic, by_schema = BY_TOPIC.get(topic_name), BY_SCHEMA.get(schema_name)
    if by_topic is None and by_schema is None:
        return None
    fields = fields_in(data, schema_name)
    if by_topic is None or by_topic is not by_schema or not fields:
        raise LogError(f"the schema of topic {topic_name!r} is damaged")
    names = {f.name: f for f in by_topic.fields}
    numbers = {f.number: f for f in by_topic.fields}
    for f in fields:
        known = names.get(f.name)
        if known is not numbers.get(f.number) or (known and f.kind not in _allowed(known)):
            raise LogError(f"the schema of topic {topic_name!r} is damaged at field {f.name!r}")
    units = {f.name: f.unit for f in by_topic.fields}
    found = replace(by_topic, fields=tuple(replace(f, unit=units.get(f.name, "-")) for f in fields))
    # A flipped bit can also hide a field; the rest then reads well, so only the same bytes are the same
    # schema.
    if descriptor_set(found) != data:
        raise LogError(f"the schema of topic {topic_name!r} is damaged")
    return found


def select_topics(keys: Iterable[str] | None) -> tuple[Topic, ...]:
    """Topics by key ('state', 'loads', ...) in row order; all for None. Raises LogError for others."""
    wanted = list(TOPICS) if keys is None else list(keys)
    for key in wanted:
        if key not in TOPICS:
            raise LogError(f"unknown log topic {key!r}{did_you_mean(key, TOPICS)}")
    return tuple(t for t in TOPICS.values() if t.key in wanted)
