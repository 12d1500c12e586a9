"""Reading logs back: the arrays that were written, bit for bit, or a clear refusal.

Our own layout is read a chunk at a time as one structured array; other layouts go through `generic`.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fatigue_runner import channels
from fatigue_runner.layout import FAMILIES, family_of
from fatigue_runner.logbook import generic
from fatigue_runner.logbook.columns import EXTRA_STATUS, STATUS_ARRAYS
from fatigue_runner.logbook.contents import Contents, read_contents
from fatigue_runner.logbook.errors import LogError
from fatigue_runner.logbook.files import read_bytes
from fatigue_runner.logbook.generic import Tables
from fatigue_runner.logbook.layout import RowLayout, layout_for
from fatigue_runner.logbook.records import Damage, open_chunk
from fatigue_runner.logbook.schema import BY_TOPIC, TOPICS
from fatigue_runner.trajectory import Trajectory


@dataclass
class Log(Trajectory):
    """A trajectory that was read from a log, with what the log says about it.

    Topics that the log does not hold are empty arrays; states of the turbine and wind signals that it does not
    hold are NaN. `states` and `winds` go on with the further ones that it holds, wind up to its highest azimuthal
    harmonic. pitch, control, reference_error (n-1,), clamped_lookups_at (n-1,) counts per interval: empty where the
    log does not hold them. run, result, units: metadata; complete: the whole run is there; lost: what was
    damaged, empty for a whole file.
    """

    reference_error: np.ndarray = field(default_factory=lambda: np.empty(0))
    clamped_lookups_at: np.ndarray = field(default_factory=lambda: np.empty(0, np.uint32))
    run: dict[str, str] = field(default_factory=dict)
    result: dict[str, str] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    attachments: dict[str, bytes] = field(default_factory=dict)
    complete: bool = True
    lost: str = ""

    @property
    def duration(self) -> float:
        """Simulated time covered by the arrays [s], 0 for an empty log."""
        return float(self.time[-1] - self.time[0]) if len(self.time) else 0.0


def row_layout(contents: Contents) -> RowLayout | None:
    """The layout of our log's rows, None for other files. Raises LogError for damaged declarations."""
    if not contents.ours or not contents.channels:
        return None
    try:
        topics = [replace(topic, channel_id=number) for number, topic in contents.topics().items()]
    except LogError:
        if contents.verified:  # not damaged, so another program's
            return None
        raise
    order = list(TOPICS)
    return layout_for(tuple(sorted(topics, key=lambda t: order.index(t.key))))


def chunk_tables(layout: RowLayout, rows: np.ndarray, first_row: int) -> Tables:
    """Contiguous columns of the rows of one chunk."""
    tables: Tables = {}
    for t in layout.topics:
        records = rows[t.key][1:] if t.key == "status" and first_row == 0 else rows[t.key]
        names = ("_log_time", "_sequence", *t.field_names)
        kinds = {f.name: np.float64 for f in t.fields if f.kind == "float"}
        tables[t.key] = {name: np.ascontiguousarray(records[name], kinds.get(name)) for name in names}
        if "accepted" in tables[t.key]:
            tables[t.key]["accepted"] = tables[t.key]["accepted"] != 0
    return tables


def join(pieces: Sequence[Tables]) -> Tables:
    """The columns of chunks that follow each other, as one."""
    return {
        key: {name: np.concatenate([p[key][name] for p in pieces]) for name in table}
        for key, table in pieces[0].items()
    }


def _decode_fixed(contents: Contents, layout: RowLayout) -> tuple[Tables, list[Damage]] | None:
    """Columns up to the first damaged chunk, and that damage; None where a chunk has another layout.

    The generic decoder is trusted with another layout only where a checksum vouches for the declarations.
    """
    pieces: list[Tables] = []
    damages: list[Damage] = []
    count = 0
    for record in contents.chunks:
        try:
            plain = open_chunk(record, contents.written_here)[1]
        except Damage as damage:
            damages.append(damage)
            break
        rows = layout.rows_in(plain, count)
        if rows is None and (contents.verified or not contents.written_here):
            return None
        if rows is None:
            damages.append(Damage("rows are missing, or their topics are", record.start))
            break
        pieces.append(chunk_tables(layout, rows, count))
        count += len(rows)
    if not pieces:
        pieces.append(chunk_tables(layout, np.empty(0, layout.dtype), 0))
    return join(pieces), damages


def _from_first_row(tables: Tables) -> None:
    """Drop the status of the interval before the first row, which a window cut out of a log begins with."""
    times = [t["_log_time"] for key, t in tables.items() if key != "status"]
    status = tables.get("status")
    if status and times and (status["_log_time"][:1] == times[0][:1]).any():
        tables["status"] = {name: values[1:] for name, values in status.items()}


def _common_rows(tables: Tables) -> int:
    """Number of rows, from the first, of which every topic has its message; -1 where none tells the time."""
    times = [t["_log_time"] for key, t in tables.items() if key != "status"]
    if not times:
        return -1
    rows = min(len(t) for t in times)
    for other in times[1:]:
        same = other[:rows] == times[0][:rows]
        rows = rows if same.all() else int(np.argmin(same))
    if "status" in tables and rows:
        status = tables["status"]["_log_time"][: rows - 1]
        same = status == times[0][1 : 1 + len(status)]
        rows = 1 + (len(status) if same.all() else int(np.argmin(same)))
    return rows


def _whole_rows(tables: Tables, ours: bool) -> tuple[int, str]:
    """Rows from the first that fit together, and what is wrong with the next one (empty when nothing is)."""
    rows = _common_rows(tables)
    lengths = [len(t["_log_time"]) + (key == "status") for key, t in tables.items() if len(t["_log_time"])]
    what = "" if rows == max(lengths, default=0) else "the topics do not have the same times"
    for key, table in tables.items() if ours else ():
        steps = np.diff(table["_sequence"].astype(np.int64)) != 1
        if steps.any():
            gap = int(np.argmax(steps)) + 1 + (key == "status")
            if gap < rows:
                rows, what = gap, "rows are missing"
    return rows, what


def assemble(tables: Tables, rows: int, intervals: int, contents: Contents) -> Log:
    """The log of the first `rows` rows and `intervals` status entries of the tables."""

    def matrix(key: str, names: Sequence[str]) -> np.ndarray:
        if key not in tables:
            return np.empty((0, len(names)))
        unknown = np.full(rows, np.nan)
        return np.stack([tables[key].get(name, unknown)[:rows] for name in names], axis=1)

    clock = next(table for key, table in tables.items() if key != "status")
    time = clock["time"] if "time" in clock else clock["_log_time"] / 1e9
    loads = tables.get("loads", {})
    status = tables.get("status", {})
    units = contents.metadata.get("units", {})
    states, winds = _states(tables, units), _winds(tables, units)
    log = Log(
        time[:rows],
        matrix("state", [c.name for c in states]),
        matrix("wind", [c.name for c in winds]),
        states=states,
        wind_signals=winds,
    )
    log.loads = {k: v[:rows] for k, v in loads.items() if k != "time" and not k.startswith("_")}
    log.pitch = log.loads.get("blade_pitch", log.pitch)
    log.control_signals = _own("control", tables, units)
    held = dict(zip((c.name for c in states), log.state.T, strict=True))
    log.control = {name: values for name, values in held.items() if name not in channels.BY_NAME}
    log.control |= {c.name: tables["control"][c.name][:rows] for c in log.control_signals}
    for name in STATUS_ARRAYS:
        if name in status:
            setattr(log, name, status[name][:intervals])
    reference_error, clamped = EXTRA_STATUS
    log.reference_error = status.get(reference_error, log.reference_error)[:intervals]
    log.clamped_lookups_at = status.get(clamped, log.clamped_lookups_at)[:intervals]
    _take_metadata(log, contents)
    return log


def _own(key: str, tables: Tables, units: Mapping[str, str]) -> tuple[channels.Channel, ...]:
    """The further signals that the log holds in an open topic, which are read in SI where nobody else knows them."""

    def channel(name: str) -> channels.Channel:
        unit = units.get(name, "-")
        return channels.BY_NAME.get(name) or channels.Channel(name, unit, name.replace("_", " "), unit)

    return tuple(channel(name) for name in TOPICS[key].further(tables.get(key, ())))


def _states(tables: Tables, units: Mapping[str, str]) -> tuple[channels.Channel, ...]:
    """Those of the turbine's family, then the log's own."""
    family = FAMILIES[family_of(tuple(tables.get("state", ()))) or "t2b1i1cg"].states
    names = {c.name for c in family}
    return (*family, *(c for c in _own("state", tables, units) if c.name not in names))


def _winds(tables: Tables, units: Mapping[str, str]) -> tuple[channels.Channel, ...]:
    """The signals up to the highest harmonic that the log holds."""
    held = tables.get("wind", {})
    pairs = [place // 2 + 1 for place, c in enumerate(channels.WIND_HARMONICS) if c.name in held]
    harmonics = channels.WIND_HARMONICS[: 2 * max(pairs, default=0)]
    return (*channels.WIND_SIGNALS, *_own("wind", tables, units), *harmonics)


def _take_metadata(log: Log, contents: Contents) -> None:
    log.run = contents.metadata.get("run", {})
    log.result = contents.metadata.get("result", {})
    log.units = contents.metadata.get("units", {})
    log.attachments = contents.attachments
    for name in ("steps", "evaluations", "clamped_lookups"):
        setattr(log, name, int(number(log.result, name) or 0))
    log.wall_time = number(log.result, "wall_time") or 0.0
    log.diverged_at = number(log.result, "diverged_at")


def number(entries: Mapping[str, str], name: str) -> float | None:
    """A metadata entry as a number, None where it is absent or none."""
    try:
        return float(entries[name])
    except (KeyError, ValueError):
        return None


def _no_turbine_log(path: object, contents: Contents, tables: Tables) -> LogError:
    if contents.damages:
        return LogError(f"{path} is damaged, and no row of it can be read: {contents.damages[0]}")
    if tables:
        return LogError(f"{path} holds only the solver status, and no topic that tells the times of its rows")
    there = ", ".join(sorted(c.topic for c in contents.channels.values())) or "none that hold messages"
    return LogError(f"{path} is not a turbine log: its topics are {there}; expected {', '.join(BY_TOPIC)}")


def _refusal(path: object, what: str, log: Log, is_damaged: bool) -> LogError:
    rows = len(log.time)
    there = f"{rows} rows up to {log.time[-1]:g} s" if rows else "no rows"
    repair = f"; `fatigue-runner logs recover {path}` repairs it" if is_damaged else ""
    return LogError(
        f"{path} cannot be read whole: {what}; {there} are good, and read_log(..., partial=True) "
        f"gives them{repair}"
    )


def read_log(path: str | os.PathLike[str], *, partial: bool = False) -> Log:
    """Read a log.

    partial: give the rows before the first damage of a file that was cut off or damaged, with `complete`
    False and `lost` saying what is wrong; else such a file is refused. Checksums are verified in either
    case. Raises LogError for a file that is missing, damaged, or no log of a turbine.
    """
    contents = read_contents(read_bytes(path), path)
    try:
        layout = row_layout(contents)
        fixed = layout and layout.topics and not contents.messages
        decoded = _decode_fixed(contents, layout) if layout and fixed else None
        tables, found = decoded or generic.decode(contents)
    except LogError as error:
        raise LogError(f"{path} cannot be read: {error}") from None
    contents.damages.extend(found)
    if all(key == "status" for key in tables):
        raise _no_turbine_log(path, contents, tables)
    _from_first_row(tables)
    rows, what = _whole_rows(tables, contents.ours)
    if contents.damages and not rows:
        raise _no_turbine_log(path, contents, tables)
    log = assemble(tables, rows, max(rows - 1, 0), contents)
    damages = [str(d) for d in contents.damages] + [f"{what} from row {rows} on"] * bool(what)
    if damages and not partial:
        raise _refusal(path, damages[0], log, bool(contents.damages))
    log.lost = "; ".join(damages)
    expected = log.result.get("rows", "" if contents.ours else str(rows))
    log.complete = not damages and expected == str(rows)
    return log
