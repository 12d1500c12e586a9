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
import os
import threading
import zlib
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import IO, Any, NamedTuple

from fatigue_runner.campaign.cases import Case
from fatigue_runner.campaign.pieces import FOLDER, Pieces
from fatigue_runner.campaign.provenance import program_hash
from fatigue_runner.encoded import checksum
from fatigue_runner.errors import FatigueRunnerError, InputError
from fatigue_runner.inputs.checked_json import to_checked
from fatigue_runner.inputs.files import write_atomically
from fatigue_runner.naming import LONGEST_NAME
from fatigue_runner.results.records import Head, from_line, head_of, lines_of, to_line
from fatigue_runner.results.rows import Rows
from fatigue_runner.results.run_file import MADE, read_run_file, write_run_file

# What all cases of a folder have in common. Where it differs, no finished case could be kept.
_IDENTITY = ("name", "code", "turbine_hash", "duration", "output_rate", "initial", "pitch")
_RESULTS = ("results.csv", "columns.csv", "results.parquet", "lifetime.csv", "damage.csv", "report.html")
_OWN = {"campaign.yaml", "run.json", "cases.jsonl", FOLDER, "logs", *_RESULTS}
ANSWER = "answer"  # entry of run.json: what was asked for, and what the results say of it, where every case is finished


class Kept(NamedTuple):
    """The last record of a case without its row, which stays in cases.jsonl: `size` bytes from `place` on."""

    head: Head
    place: int
    size: int


class Store:
    """A run folder. Making one checks and reads, and writes nothing; `open` creates, locks and writes.

    identity: the values of `_IDENTITY`; columns: what a finished case's row must have. Raises InputError where the folder belongs to
    another campaign, or holds files and is no run folder.
    """

    def __init__(
        self, out: Path, identity: dict[str, Any], fresh: bool = False, columns: Collection[str] = ()
    ) -> None:
        self.out = out
        self._columns = list(columns)
        self.damaged = 0  # lines of cases.jsonl that are not as they were written
        self._checked: dict[str, tuple[int, int]] = {}  # size and time of logs whose content was checked
        self.identity = {key: identity[key] for key in _IDENTITY}
        self._fresh = fresh
        self._journal: IO[bytes] | None = None
        self.earlier: dict[str, Any] = {}  # run.json of the run that goes on
        self._check_folder()
        self._pieces, self._adding = Pieces(out), threading.Lock()
        self._about: dict[str, Any] = {}
        self._seen: tuple[int, int] | None = None  # size and time of the journal that was read

    @cached_property
    def _kept(self) -> dict[str, Kept]:
        """The last record of every case; read when it is first asked for, since a folder that is settled need not be."""
        return {} if self._fresh else self._read_journal()

    def log_path(self, case_id: str) -> Path:
        """Where the log of a case lies."""
        return self.out / "logs" / f"{case_id}.mcap"

    def finished(self, case: Case, logged: bool) -> bool:
        """Whether a case need not run again."""
        kept = self._kept.get(case.id)
        if kept is None or kept.head.record["hash"] != case.hash or kept.head.status == "failed":
            return False
        if kept.head.columns < len(self._columns):
            return False
        return not logged or self._log_complete(kept.head)

    def logged(self, case: Case) -> bool:
        """Whether a complete log holds exactly the trajectory of this case."""
        kept = self._kept.get(case.id)
        if kept is None or kept.head.record["simulation_hash"] != case.simulation_hash:
            return False
        return self._log_complete(kept.head)

    def rows(self, cases: Iterable[Case]) -> Rows:
        """The rows of finished cases, in their order, from cases.jsonl."""
        return Rows(self._columns, self._rows_of(cases))

    def record(self, case_id: str) -> dict[str, Any] | None:
        """The whole record of a case, from cases.jsonl; None where there is none."""
        kept = self._kept.get(case_id)
        if kept is None:
            return None
        with self._journal_path.open("rb") as journal:
            journal.seek(kept.place)
            return from_line(journal.read(kept.size).rstrip(b"\n"))

    def _rows_of(self, cases: Iterable[Case]) -> Iterator[dict[str, Any]]:
        with self._journal_path.open("rb") as journal:
            for case in cases:
                kept = self._kept[case.id]
                journal.seek(kept.place)
                row = (from_line(journal.read(kept.size).rstrip(b"\n")) or {}).get("row", {})
                if not row.keys() >= set(self._columns):
                    raise FatigueRunnerError(
                        f"{self._journal_path}: the record of {case.id} is damaged; delete its line, and the same command runs the case "
                        "again"
                    )
                yield row

    @property
    def settled(self) -> bool:
        """Whether the results in the folder are those of its records, made by this program: nobody need make them again."""
        return bool(self.earlier) and self.earlier.get(MADE) == self._made(self._about)

    @property
    def untouched(self) -> bool:
        """Whether records and results are to the last bit what this program left; looks at no record."""
        return bool(self.earlier) and self.earlier.get(MADE) == self._made(self.about_earlier)

    @property
    def about_earlier(self) -> dict[str, Any]:
        """What the run that goes on said of itself."""
        return {key: value for key, value in self.earlier.items() if key not in (MADE, ANSWER)}

    def answer_to(self, asked: str) -> dict[str, Any] | None:
        """What the results said when exactly this (`Plan.asked`) was finished; None where it is not, or the folder has changed since."""
        answer = self.earlier.get(ANSWER)
        known = isinstance(answer, dict) and answer.get("asked") == asked and self.untouched
        return answer if known else None

    def settle(self, answer: dict[str, Any] | None) -> None:
        """Remember what the results were made of and, where every case is finished, what they say."""
        said = {} if answer is None else {ANSWER: answer}
        write_run_file(self.out, self._about | {MADE: self._made(self._about)} | said)

    def unsettle(self) -> None:
        """The results are about to be others than run.json knows."""
        write_run_file(self.out, self._about)

    def _made(self, about: dict[str, Any]) -> dict[str, Any]:
        """Checksums of what decides the results, and of the results."""
        files = [
            path for name in ("campaign.yaml", "cases.jsonl", *_RESULTS) if (path := self.out / name).exists()
        ]
        return {
            "program": program_hash(),
            "run.json": zlib.crc32(to_checked(about)),
            **{path.name: checksum(path) for path in files},
        }

    @property
    def _journal_path(self) -> Path:
        return self.out / "cases.jsonl"

    def open(self, run: dict[str, Any], campaign_text: str) -> None:
        """Create the folder, lock it against a second run, say whose it is. Raises InputError if locked."""
        try:
            (self.out / "logs").mkdir(parents=True, exist_ok=True)
            self._journal = self._journal_path.open("ab")
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
        if not self._fresh and self._seen != self._state():
            self._kept = self._read_journal()
        if self._fresh:
            self._clear()
            self._pieces.clear()
        elif not self._ends_with_a_line():
            self._journal.write(b"\n")  # what a crash cut off must not spoil the next record
            self._journal.flush()
        self.take_in()  # what a run that was killed had finished of its blocks
        self._pieces.clear()
        write_atomically(self.out / "campaign.yaml", campaign_text.encode())
        self._about = self.identity | run
        made = {key: self.earlier[key] for key in (MADE, ANSWER) if key in self.earlier}
        write_run_file(self.out, self._about | made)

    def add(self, records: Iterable[dict[str, Any]]) -> int:
        """Append the records of finished cases; they survive whatever happens next. Returns how many were not there yet."""
        return self._add_new(lambda: list(map(to_line, records)))

    def take_in(self) -> int:
        """Take in what workers have left of blocks that still run; returns how many cases were not there yet."""
        return self._add_new(self._pieces.new)

    def _add_new(self, come: Callable[[], list[bytes]]) -> int:
        journal = self._journal
        assert journal is not None, "the store is not open"
        with self._adding:
            new = 0
            for line in come():
                head = head_of(line)
                assert head is not None
                kept = self._kept.get(head.case_id)
                if kept is None or kept.head.checksum != head.checksum:
                    self._kept[head.case_id] = Kept(head, journal.tell(), len(line))
                    journal.write(line)
                    new += 1
            if new:
                journal.flush()
                os.fsync(journal.fileno())
            return new

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
            theirs = read_run_file(self.out)
        except FileNotFoundError:
            # a run that was killed early leaves its own files without run.json; each record says itself what it is of
            names = {path.name.removesuffix(".part") for path in self.out.iterdir()}
            early = names <= {"logs"} and not any((self.out / "logs").glob("*"))
            if not early and not ("cases.jsonl" in names and names <= _OWN):
                raise InputError(
                    f"{self.out} holds files but no run; give --out a new or empty folder"
                ) from None
            return
        for key, mine in self.identity.items():
            if theirs.get(key) != mine and (key == "name" or not self._fresh):
                raise InputError(f"{self.out} {_difference(key, theirs.get(key), mine)}")
        self.earlier = {} if self._fresh else theirs

    def _read_journal(self) -> dict[str, Kept]:
        """The last record of every case; one that is damaged or was cut off is as if it were never written."""
        found, self.damaged, self._seen = {}, 0, self._state()
        try:
            with self._journal_path.open("rb") as journal:
                for place, line in lines_of(journal):
                    head = head_of(line)
                    if head is not None:
                        found[head.case_id] = Kept(head, place, len(line))
                    elif line.endswith(b"\n"):
                        self.damaged += 1
        except FileNotFoundError:
            return {}
        return found

    def _state(self) -> tuple[int, int] | None:
        """Size and time of the journal; None where there is none, or nothing in it."""
        try:
            found = self._journal_path.stat()
        except FileNotFoundError:
            return None
        return (found.st_size, found.st_mtime_ns) if found.st_size else None

    def _ends_with_a_line(self) -> bool:
        with self._journal_path.open("rb") as journal:
            if not journal.seek(0, os.SEEK_END):
                return True
            journal.seek(-1, os.SEEK_END)
            return journal.read() == b"\n"

    def _log_complete(self, head: Head) -> bool:
        """Whether the log is, to the last bit, what was written."""
        case_id, record = head.case_id, head.record
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
        for case_id in self._read_journal():
            self.log_path(case_id).unlink(missing_ok=True)
        self._journal.truncate(0)
        self._journal.seek(0)
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
