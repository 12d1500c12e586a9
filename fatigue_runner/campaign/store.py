"""The run folder: whose it is, which cases are finished, and where their logs lie.

    campaign.yaml   the campaign as it was given
    run.json        the resolved campaign, versions and the turbine's hash: whose folder this is
    cases.jsonl     one line per finished case, appended as blocks of cases come in
    logs/           <case id>.mcap
    results.csv, results.parquet, lifetime.csv, damage.csv, report.html

A finished case is kept when its hash is unchanged and its log is complete.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import IO, Any

from fatigue_runner.campaign.cases import Case
from fatigue_runner.errors import InputError
from fatigue_runner.inputs.files import write_atomically

# What all cases of a folder have in common. Where it differs, no finished case could be kept.
_IDENTITY = ("name", "code", "turbine_hash", "duration", "output_rate", "initial", "pitch")


class Store:
    """A run folder. Making one checks and reads, and writes nothing; `open` creates, locks and writes.

    identity: the values of `_IDENTITY`. Raises InputError where the folder belongs to another campaign, or
    holds files and is no run folder.
    """

    def __init__(self, out: Path, identity: dict[str, Any], fresh: bool = False) -> None:
        self.out = out
        self.identity = {key: identity[key] for key in _IDENTITY}
        self._fresh = fresh
        self._journal: IO[bytes] | None = None
        self.earlier: dict[str, Any] = {}  # run.json of the run that goes on
        self._check_folder()
        self.records = {} if fresh else self._read_records()

    def log_path(self, case_id: str) -> Path:
        """Where the log of a case lies."""
        return self.out / "logs" / f"{case_id}.mcap"

    def finished(self, case: Case, logged: bool) -> dict[str, Any] | None:
        """The record of a case that need not run again; None where it must."""
        record = self.records.get(case.id)
        if record is None or record["hash"] != case.hash or record["row"]["status"] == "failed":
            return None
        return record if not logged or self._log_complete(record) else None

    def logged(self, case: Case) -> bool:
        """Whether a complete log holds exactly the trajectory of this case."""
        record = self.records.get(case.id)
        if record is None or record["simulation_hash"] != case.simulation_hash:
            return False
        return self._log_complete(record)

    def open(self, run: dict[str, Any], campaign_text: str) -> None:
        """Create the folder, lock it against a second run, say whose it is. Raises InputError if locked."""
        try:
            (self.out / "logs").mkdir(parents=True, exist_ok=True)
            self._journal = (self.out / "cases.jsonl").open("ab")
        except OSError as error:
            raise InputError(
                f"{self.out}: cannot be written ({error.strerror}); choose another --out"
            ) from None
        _lock(self._journal, self.out)
        if self._fresh:
            self._clear()
        elif not self._ends_with_a_line():
            self._journal.write(b"\n")  # what a crash cut off must not spoil the next record
        write_atomically(self.out / "campaign.yaml", campaign_text.encode())
        write_atomically(self.out / "run.json", json.dumps(self.identity | run, indent=1).encode())

    def add(self, records: Iterable[dict[str, Any]]) -> None:
        """Append the records of finished cases; they survive whatever happens next."""
        assert self._journal is not None, "the store is not open"
        for record in records:
            self.records[record["row"]["case_id"]] = record
            self._journal.write(json.dumps(record, allow_nan=False).encode() + b"\n")
        self._journal.flush()
        os.fsync(self._journal.fileno())

    def close(self) -> None:
        """Release the folder."""
        if self._journal is not None:
            self._journal.close()
            self._journal = None

    def _check_folder(self) -> None:
        if not self.out.exists():
            return
        if not self.out.is_dir():
            raise InputError(f"{self.out} is a file; give --out a folder")
        try:
            theirs = json.loads((self.out / "run.json").read_text())
        except FileNotFoundError:
            if any(self.out.iterdir()):
                raise InputError(
                    f"{self.out} holds files but no run; give --out a new or empty folder"
                ) from None
            return
        except (OSError, ValueError):
            raise InputError(f"{self.out}/run.json cannot be read; give --out a new folder") from None
        for key, mine in self.identity.items():
            if theirs.get(key) != mine and (key == "name" or not self._fresh):
                raise InputError(f"{self.out} {_difference(key, theirs.get(key), mine)}")
        self.earlier = {} if self._fresh else theirs

    def _read_records(self) -> dict[str, dict[str, Any]]:
        """The last record of every case; a line that a crash cut off is as if it were never written."""
        records = {}
        try:
            lines = (self.out / "cases.jsonl").read_bytes().split(b"\n")
        except FileNotFoundError:
            return {}
        for line in lines:
            try:
                record = json.loads(line)
                records[record["row"]["case_id"]] = record
            except (ValueError, KeyError, TypeError):
                continue
        return records

    def _ends_with_a_line(self) -> bool:
        content = (self.out / "cases.jsonl").read_bytes()
        return not content or content.endswith(b"\n")

    def _log_complete(self, record: dict[str, Any]) -> bool:
        from fatigue_runner.logbook import is_complete

        path = self.log_path(record["row"]["case_id"])
        size = path.stat().st_size if path.is_file() else 0
        return size > 0 and size == record["log_bytes"] and is_complete(path)

    def _clear(self) -> None:
        """Remove what earlier runs of this campaign left: `--fresh` asked for it."""
        assert self._journal is not None
        for case_id in self._read_records():
            self.log_path(case_id).unlink(missing_ok=True)
        self._journal.truncate(0)
        for name in ("results.csv", "results.parquet", "lifetime.csv", "damage.csv", "report.html"):
            (self.out / name).unlink(missing_ok=True)


def _difference(key: str, theirs: Any, mine: Any) -> str:
    """What makes the folder another campaign's, and the way out."""
    fresh = "choose another --out, or overwrite it with --fresh"
    if key == "name":
        return f"belongs to another campaign ({theirs!s:.40}, this one is {mine}); choose another --out"
    if key == "code":
        return f"was written by another version of the program; {fresh}"
    if key == "turbine_hash":
        return f"was run with another turbine, or other data of it; {fresh}"
    return f"was run with another {key.replace('_', ' ')} ({theirs!s:.20}, now {mine!s:.20}); {fresh}"


def _lock(file: IO[bytes], out: Path) -> None:
    """Hold the folder until `file` is closed or the process ends."""
    try:
        import fcntl
    except ImportError:  # Windows: two runs into one folder are not prevented there
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        file.close()
        raise InputError(f"{out}: another run is writing here; wait for it or choose another --out") from None
