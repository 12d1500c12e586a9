"""What is written: one MCAP file per case, and everything that reads, checks, repairs and tells of it.

Bottom-up: `schema` (topics and fields), `layout` (rows as bytes), `container` (the file around chunks),
`writer`; `records` and `contents` (bytes to records), `reader` with `generic` for files of another layout,
`tail` for a log that still grows; `metadata` for quick looks, `check`, `recovery`, `summary` and `export`;
`commands` is `fatigue-runner logs`. Nothing of the simulation is imported but its plain result arrays and
the names of channels.
"""

from fatigue_runner.logbook.check import Check, check
from fatigue_runner.logbook.errors import LogError
from fatigue_runner.logbook.export import export
from fatigue_runner.logbook.metadata import read_metadata
from fatigue_runner.logbook.reader import Log, read_log
from fatigue_runner.logbook.recovery import Recovery, recover
from fatigue_runner.logbook.summary import LogSummary, summarise
from fatigue_runner.logbook.tail import LogTail
from fatigue_runner.logbook.writer import LogWriter, log_of, write_log

__all__ = [
    "Check",
    "Log",
    "LogError",
    "LogSummary",
    "LogTail",
    "LogWriter",
    "Recovery",
    "check",
    "export",
    "log_of",
    "read_log",
    "read_metadata",
    "recover",
    "summarise",
    "write_log",
]
