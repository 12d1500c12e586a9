"""Channels of a log as a table that spreadsheets (csv) and data frames (parquet) read."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Callable, Iterable, Mapping
from fnmatch import fnmatchcase
from pathlib import Path
from typing import IO

import numpy as np

from fatigue_runner import channels
from fatigue_runner.errors import did_you_mean
from fatigue_runner.logbook.errors import LogError
from fatigue_runner.logbook.files import replacing
from fatigue_runner.logbook.reader import Log, read_log
from fatigue_runner.logbook.schema import STATUS_FIELDS

Columns = dict[str, np.ndarray]


def table(log: Log) -> Columns:
    """Every channel of the log by name, as (n,) columns in the log's order, `time` first.

    Status columns are float, with NaN in row 0, before which there is no interval.
    """
    columns: Columns = {"time": log.time}
    if len(log.state):
        columns |= dict(zip((c.name for c in log.states), log.state.T, strict=True))
    columns |= log.loads
    if len(log.wind):
        columns |= dict(zip((c.name for c in log.winds), log.wind.T, strict=True))
    columns |= {c.name: log.control[c.name] for c in log.control_signals}
    for f in STATUS_FIELDS[1:]:
        values = getattr(log, "clamped_lookups_at" if f.name == "clamped_lookups" else f.name)
        if values.size:
            columns[f.name] = np.concatenate([[np.nan], values])
    return columns


def units_of(log: Log) -> dict[str, str]:
    """SI units of the columns of `table`."""
    status = {f.name: f.unit for f in STATUS_FIELDS}
    known = {
        c.name: c.unit for c in (*channels.BY_NAME.values(), *log.states, *log.winds, *log.control_signals)
    }
    known |= {name: channels.BY_NAME[name].unit for name in log.loads if name in channels.BY_NAME}
    return status | known


def choose(columns: Columns, patterns: Iterable[str] | None) -> Columns:
    """The columns that match a name or a pattern ('blade*_root_flapwise_moment'), `time` first; all for None.

    Raises LogError for a pattern that matches none.
    """
    patterns = list(columns) if patterns is None else list(patterns)
    chosen: Columns = {"time": columns["time"]}
    for pattern in patterns:
        matching = [name for name in columns if fnmatchcase(name, channels.channel_name(pattern, columns))]
        if not matching:
            raise LogError(f"no channel {pattern!r} in the log{did_you_mean(pattern, columns)}")
        chosen |= {name: columns[name] for name in matching}
    return chosen


def _write_csv(columns: Columns, _units: Mapping[str, str], stream: IO[bytes]) -> None:
    """Shortest form that reads back as the same number; empty for NaN."""
    text = io.TextIOWrapper(stream, encoding="utf-8", newline="")
    writer = csv.writer(text)
    writer.writerow(columns)
    cells = [["" if v != v else repr(v) for v in values.tolist()] for values in columns.values()]
    writer.writerows(zip(*cells, strict=True))
    text.detach()


def _write_parquet(columns: Columns, units: Mapping[str, str], stream: IO[bytes]) -> None:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise LogError(
            "parquet needs pyarrow: `pip install 'fatigue-runner[parquet]'`, or export to .csv"
        ) from None
    fields = [
        pyarrow.field(name, pyarrow.float64(), metadata={"unit": units.get(name, "")}) for name in columns
    ]
    arrays = [pyarrow.array(np.ascontiguousarray(values, float)) for values in columns.values()]
    pyarrow.parquet.write_table(pyarrow.table(arrays, schema=pyarrow.schema(fields)), stream)


FORMATS: dict[str, Callable[[Columns, Mapping[str, str], IO[bytes]], None]] = {
    ".csv": _write_csv,
    ".parquet": _write_parquet,
}


def export(
    path: str | os.PathLike[str], channels: Iterable[str] | None, out: str | os.PathLike[str]
) -> list[str]:
    """Write channels of a log to a .csv or .parquet file and return their names.

    channels: names or patterns, None for all; SI units, a row per time, `time` [s] first; the solver's
    status of an interval stands in the row of its end. Raises LogError for a damaged log, an unknown
    channel or file type.
    """
    out = Path(out)
    suffix = out.suffix.lower()
    if suffix not in FORMATS:
        raise LogError(f"cannot export to {out}: the name must end in {' or '.join(FORMATS)}")
    log = read_log(path)
    columns = choose(table(log), channels)
    with replacing(out) as stream:
        FORMATS[suffix](columns, units_of(log), stream)
    return list(columns)
