"""The run folder: whose it is, which cases are finished, and where their logs lie.

    campaign.yaml   the campaign as it was given
    run.json        the resolved campaign, versions and the turbine's hash: whose folder this is
    cases.jsonl     one line per finished case, appended as they come in
    finished/       while cases run: what workers have finished of their blocks, see `pieces`
    logs/           <case id>.mcap
    results.csv, columns.csv, results.parquet, lifetime.csv, damage.csv, report.html

A finished case is kept when its hash is unchanged, its record is whole (each has a checksum) and its log is still what was written.
"""

from __future__ import annotations

import errno
import json
import os
import threading
from collections.abc import Callable, Collection, Iterable
from contextlib import suppress
from pathlib import Path
from typing import IO, Any

from fatigue_runner.campaign.cases import Case
from fatigue_runner.campaign.pieces import FOLDER, Pieces
from fatigue_runner.errors import InputError
from fatigue_runner.inputs.files import write_atomically
from fatigue_runner.naming import LONGEST_NAME
from fatigue_runner.results.records import to_line, whole_records

# What all cases of a folder have in common. Where it differs, no finished case could be kept.
_IDENTITY = ("name", "code", "turbine_hash", "duration", "output_rate", "initial", "pitch")
_RESULTS = ("results.csv", "columns.csv", "results.parquet", "lifetime.csv", "damage.csv", "report.html")
_OWN = {"campaign.yaml", "run.json", "cases.jsonl", FOLDER, "logs", *_RESULTS}


class Store:
    """A run folder. Making one checks and reads, and writes nothing; `open` creates, locks and writes.

    identity: the values of `_IDENTITY`; columns: what a finished case's row must have. Raises InputError where the folder belongs to
    another campaign, or holds files and is no run folder.
    """

    def __init__(
        self, out: Path, identity: dict[str, Any], fresh: bool = False, columns: Collection[str] = ()
    ) -> None:
        self.out = out
        self._columns = set(columns)
        self.damaged = 0  # lines of cases.jsonl that are not as they were written
        self._checked: dict[str, tuple[int, int]] = {}  # size and time of logs whose content was checked
        self.identity = {key: identity[key] for key in _IDENTITY}
        self._fresh = fresh
        self._journal: IO[bytes] | None = None
        self.earlier: dict[str, Any] = {}  # run.json of the run that goes on
        self._check_folder()
        self._pieces, self._adding = Pieces(out), threading.Lock()
        self.records = {} if fresh else self._read_records()

    def log_path(self, case_id: str) -> Path:
        """Where the log of a case lies."""
        return self.out / "logs" / f"{case_id}.mcap"

    def finished(self, case: Case, logged: bool) -> dict[str, Any] | None:
        """The record of a case that need not run again; None where it must."""
        record = self.records.get(case.id)
        if record is None or record["hash"] != case.hash or record["row"]["status"] == "failed":
            return None
        if not self._columns <= record["row"].keys():
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
        try:
            self._take_over(run, campaign_text)
        except BaseException:
            self._journal.close()
            self._journal = None
            raise

    def _take_over(self, run: dict[str, Any], campaign_text: str) -> None:
        assert self._journal is not None
        self._check_folder()  # a run that held the lock until now may have been another campaign's
        self.records = {} if self._fresh else self._read_records()
        if self._fresh:
            self._clear()
            self._pieces.clear()
        elif not self._ends_with_a_line():
            self._journal.write(b"\n")  # what a crash cut off must not spoil the next record
        self.take_in()  # what a run that was killed had finished of its blocks
        self._pieces.clear()
        write_atomically(self.out / "campaign.yaml", campaign_text.encode())
        write_atomically(self.out / "run.json", json.dumps(self.identity | run, indent=1).encode())

    def add(self, records: Iterable[dict[str, Any]]) -> int:
        """Append the records of finished cases; they survive whatever happens next. Returns how many were not there yet."""
        # as they are when they are read again, so that the same record is the same whichever way it came
        return self._add_new(lambda: [json.loads(json.dumps(record, allow_nan=False)) for record in records])

    def take_in(self) -> int:
        """Take in what workers have left of blocks that still run; returns how many cases were not there yet."""
        return self._add_new(self._pieces.new)

    def _add_new(self, come: Callable[[], list[dict[str, Any]]]) -> int:
        journal = self._journal
        assert journal is not None, "the store is not open"
        with self._adding:
            new = [r for r in come() if self.records.get(r["row"]["case_id"]) != r]
            for record in new:
                self.records[record["row"]["case_id"]] = record
                journal.write(to_line(record))
            if new:
                journal.flush()
                os.fsync(journal.fileno())
            return len(new)

    def strangers(self, cases: Iterable[Case]) -> list[Path]:
        """Logs in the folder that are of none of the cases: of winds and integrators that have left the campaign."""
        known = {self.log_path(case.id).name for case in cases}
        logs = (self.out / "logs").glob("*.mcap*")
        return [path for path in sorted(logs) if path.name.removesuffix(".part") not in known]

    def close(self) -> None:
        """Release the folder."""
        if self._journal is None:
            return
        try:
            self.take_in()
            self._pieces.clear()
        finally:
            with suppress(OSError):  # what cannot be written has been told already
                self._journal.close()
            self._journal = None

    def _check_folder(self) -> None:
        _refuse_place(self.out)
        if not self.out.exists():
            return
        if not self.out.is_dir():
            raise InputError(f"{self.out} is a file; give --out a folder")
        try:
            theirs = json.loads((self.out / "run.json").read_text())
            if not isinstance(theirs, dict):
                raise ValueError("no mapping")
        except FileNotFoundError:
            # a run that was killed early leaves its own files without run.json; each record says itself what it is of
            names = {path.name.removesuffix(".part") for path in self.out.iterdir()}
            early = names <= {"logs"} and not any((self.out / "logs").glob("*"))
            if not early and not ("cases.jsonl" in names and names <= _OWN):
                raise InputError(
                    f"{self.out} holds files but no run; give --out a new or empty folder"
                ) from None
            return
        except OSError as error:
            raise InputError(
                f"{self.out / 'run.json'} cannot be read ({error.strerror}); choose another --out"
            ) from None
        except ValueError:
            raise InputError(
                f"{self.out / 'run.json'} is damaged; delete it, and the same command goes on with the finished cases of the folder"
            ) from None
        for key, mine in self.identity.items():
            if theirs.get(key) != mine and (key == "name" or not self._fresh):
                raise InputError(f"{self.out} {_difference(key, theirs.get(key), mine)}")
        self.earlier = {} if self._fresh else theirs

    def _read_records(self) -> dict[str, dict[str, Any]]:
        """The last record of every case; one that is damaged or was cut off is as if it were never written."""
        try:
            found, self.damaged = whole_records((self.out / "cases.jsonl").read_bytes())
        except FileNotFoundError:
            return {}
        return {record["row"]["case_id"]: record for record in found}

    def _ends_with_a_line(self) -> bool:
        content = (self.out / "cases.jsonl").read_bytes()
        return not content or content.endswith(b"\n")

    def _log_complete(self, record: dict[str, Any]) -> bool:
        """Whether the log is, to the last bit, what was written."""
        from fatigue_runner.logbook import checksum

        case_id = record["row"]["case_id"]
        path = self.log_path(case_id)
        try:
            found = path.stat()
            if not record["log_bytes"] or found.st_size != record["log_bytes"]:
                return False
            seen = found.st_size, found.st_mtime_ns
            if self._checked.get(case_id) != seen and checksum(path) == record["log_checksum"]:
                self._checked[case_id] = seen
            return self._checked.get(case_id) == seen
        except OSError:
            return False

    def _clear(self) -> None:
        """Remove what earlier runs of this campaign left: `--fresh` asked for it."""
        assert self._journal is not None
        for case_id in self._read_records():
            self.log_path(case_id).unlink(missing_ok=True)
        self._journal.truncate(0)
        for name in _RESULTS:
            (self.out / name).unlink(missing_ok=True)


def _refuse_place(out: Path) -> None:
    """Raises InputError, before anything runs, where the folder cannot be made or written: below a file, a name that is too long, a
    circle of links, no permission."""
    above = out.absolute()
    try:
        while not above.exists():
            if above.is_symlink():
                raise InputError(
                    f"{out}: {above} is a link that leads nowhere, or in a circle; choose another --out"
                )
            above = above.parent
        if not os.access(above, os.W_OK):
            raise PermissionError(errno.EACCES, "no permission to write there")
        if out.absolute() != above and not above.is_dir():
            raise InputError(f"{out}: {above} is a file, not a folder; choose another --out")
        longest = os.pathconf(above, "PC_NAME_MAX") if hasattr(os, "pathconf") else LONGEST_NAME
    except OSError as error:
        raise InputError(f"{out}: cannot be written ({error.strerror}); choose another --out") from None
    long = [part for part in out.parts if len(os.fsencode(part)) > longest]
    if long:
        raise InputError(
            f"{str(out)[:60]}...: cannot be written, a name of it is too long; choose a shorter --out"
        )


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
