"""The byte layout of a log's rows: one MCAP Message record per topic, side by side, as a numpy record.

A row is everything known at one output time: the solver status of the interval that ended there, then
state, loads and wind. Row 0 has no interval before it, so the first chunk of a file starts after the status
record's place. Since every field takes the same number of bytes whatever its value, a chunk is an array of
rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from mcap.opcode import Opcode

from fatigue_runner.logbook.schema import KINDS, Field, Topic

# MCAP specification, "Message (op=0x05)": opcode, record length, then the content up to the message's data.
_HEADER = [
    ("_opcode", "u1"),
    ("_length", "<u8"),
    ("_channel", "<u2"),
    ("_sequence", "<u4"),
    ("_log_time", "<u8"),
    ("_publish_time", "<u8"),
]
_RECORD_HEADER_SIZE = 9  # opcode and length are not counted in the length


def _tag_name(field: Field) -> str:
    return f"_tag{field.number}"


def message_dtype(topic: Topic) -> np.dtype:
    """Packed dtype of one Message record of the topic, tags included."""
    parts: list[tuple[str, str]] = list(_HEADER)
    for f in topic.fields:
        parts.append((_tag_name(f), f"V{len(f.tag)}"))
        parts.append((f.name, KINDS[f.kind][2]))
    return np.dtype(parts)


class RowLayout:
    """The dtype of a row with these topics, and the bytes that are the same in every row."""

    def __init__(self, topics: Sequence[Topic]) -> None:
        self.topics = tuple(topics)
        self.dtype = np.dtype([(t.key, message_dtype(t)) for t in self.topics])
        self.stride = self.dtype.itemsize
        # Bytes that row 0 lacks: the status record, which comes first where there is one.
        self.lead = self.dtype["status"].itemsize if self.topics and self.topics[0].key == "status" else 0
        self.template = np.zeros(1, self.dtype)
        constant = np.zeros(1, self.dtype)
        for t in self.topics:
            self._fill_constants(t, self.template[t.key], constant[t.key])
        self._template_bytes = self.template.view(np.uint8)
        self._constant_bytes = constant.view(np.uint8)

    @staticmethod
    def _fill_constants(topic: Topic, template: np.ndarray, constant: np.ndarray) -> None:
        values = {
            "_opcode": int(Opcode.MESSAGE),
            "_length": template.dtype.itemsize - _RECORD_HEADER_SIZE,
            "_channel": topic.channel_id,
        }
        for name, value in values.items():
            template[name] = value
            constant[name] = np.iinfo(template.dtype[name]).max
        for f in topic.fields:
            template[_tag_name(f)] = np.void(f.tag)
            constant[_tag_name(f)] = np.void(b"\xff" * len(f.tag))

    def _offset(self, topic: Topic) -> int:
        """Where the topic's Message record begins in a row [bytes]."""
        return 0 if self.dtype.fields is None else self.dtype.fields[topic.key][1]

    def message_indexes(self, rows: np.ndarray, is_first: bool) -> dict[int, np.ndarray]:
        """Channel id -> (n, 2) log time [ns] and offset in the uncompressed chunk of these rows.

        is_first: the rows begin with row 0, whose status record is not written.
        """
        starts = np.arange(len(rows), dtype=np.uint64) * np.uint64(self.stride)
        if is_first:
            starts -= np.uint64(self.lead)  # wraps for the status of row 0, which is skipped
        found = {}
        for t in self.topics:
            skip = 1 if is_first and t.key == "status" else 0
            places = starts[skip:] + np.uint64(self._offset(t))
            if len(places):
                found[t.channel_id] = np.stack([rows[t.key]["_log_time"][skip:], places], 1)
        return found

    def rows_in(self, data: bytes, first_row: int) -> np.ndarray | None:
        """The rows of an uncompressed chunk as a structured array, None where it is laid out otherwise.

        first_row: number of the row that the chunk must begin with; row 0 gets an empty status record.
        """
        if first_row == 0 and self.lead:
            data = self.template.tobytes()[: self.lead] + data
        if not data or len(data) % self.stride:
            return None
        raw = np.frombuffer(data, np.uint8).reshape(-1, self.stride)
        if ((raw ^ self._template_bytes) & self._constant_bytes).any():
            return None
        rows = raw.reshape(-1).view(self.dtype)
        count = len(rows)
        for t in self.topics:
            skip = 1 if first_row == 0 and t.key == "status" else 0
            expected = np.arange(first_row + skip, first_row + count, dtype=np.uint32)
            if not np.array_equal(rows[t.key]["_sequence"][skip:], expected):
                return None
        return rows


@lru_cache(maxsize=64)
def layout_for(topics: tuple[Topic, ...]) -> RowLayout:
    """The layout of rows with these topics; the logs of a campaign share one."""
    return RowLayout(topics)
