"""The results table: the rows as Python values, and the files they are written to and read from."""

from __future__ import annotations

import csv
import io
import itertools
import math
import re
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from fatigue_runner.channels import channel_name
from fatigue_runner.encoded import decoded
from fatigue_runner.errors import FatigueRunnerWarning, InputError, did_you_mean
from fatigue_runner.inputs.files import write_atomically
from fatigue_runner.results.columns import NEEDED, Column, kind_of, units_csv
from fatigue_runner.results.frames import to_arrow, to_pandas
from fatigue_runner.results.operation import pitch_rate_sentences
from fatigue_runner.results.ranking import MethodSummary, as_data, from_data, rank
from fatigue_runner.results.records import from_line, head_of, lines_of
from fatigue_runner.results.rows import Rows
from fatigue_runner.results.run_file import as_left

if TYPE_CHECKING:
    from fatigue_runner.results.lifetime import Life

_LINE = re.compile(r"[^\r\n]*(?:\r\n|\r|\n)|[^\r\n]+")
_DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+([eE][-+]?\d+)?")


def known(value: Any) -> Any:
    """A cell's value as plain Python; None for what is unknown: NaN and infinity are no figures."""
    value = value.item() if hasattr(value, "item") else value
    return None if isinstance(value, float) and not math.isfinite(value) else value


class LaterRows(Sequence[Mapping[str, Any]]):
    """So many rows of a run folder's table, which is read when one of them is first looked at."""

    def __init__(self, folder: Path, count: int) -> None:
        self._folder, self._count = folder, count

    @cached_property
    def _rows(self) -> Rows:
        return read_rows(self._folder)

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, at: int) -> Mapping[str, Any]: ...
    @overload
    def __getitem__(self, at: slice) -> list[Mapping[str, Any]]: ...
    def __getitem__(self, at: int | slice) -> Mapping[str, Any] | list[Mapping[str, Any]]:
        return self._rows[at]  # type: ignore[return-value]

    def __eq__(self, other: object) -> bool:
        return self._rows == (other._rows if isinstance(other, LaterRows) else other)

    __hash__ = None  # type: ignore[assignment]  # as of a list


@dataclass
class Results:
    """The outcome of a campaign: one row per case, in the order of the campaign.

    rows: mappings with every column, None where a figure is unknown; out: the run folder; `simulated` and `kept`
    count the cases that ran now and those that an earlier run had finished; life: what they stand for, where the campaign asks for it.
    """

    out: Path
    columns: list[str]
    rows: Sequence[Mapping[str, Any]]
    simulated: int = 0
    kept: int = 0
    wall_time: float = 0.0
    report_error: str = ""
    life: Life | None = None
    notes: list[str] = field(default_factory=list)  # what limits the figures, in sentences
    meanings: Sequence[Column] = ()  # of the columns, where they are known
    said: Mapping[str, Any] | None = None  # `answer` of an earlier run, where nothing has changed since

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[Mapping[str, Any]]:
        return iter(self.rows)

    def column(self, name: str) -> list[Any]:
        """One column, in row order; channels by their own or by OpenFAST's names: `del_RootMyb1_m10`. Raises InputError."""
        if name not in self.columns:
            name = "_".join(channel_name(part) for part in name.split("_"))
        if name not in self.columns:
            raise InputError(f"the results have no column {name!r}{did_you_mean(name, self.columns)}")
        return [row[name] for row in self.rows]

    def where(self, **conditions: Any) -> list[Mapping[str, Any]]:
        """The rows whose columns have these values: `results.where(method="heun", step=0.01)`."""
        return [row for row in self.rows if all(row[key] == value for key, value in conditions.items())]

    @property
    def lost(self) -> list[Mapping[str, Any]]:
        """The rows of the cases that diverged or failed."""
        if self.said is not None and not self.said["lost"]:
            return []
        return [row for row in self.rows if row["status"] != "done"]

    @cached_property
    def summaries(self) -> list[MethodSummary]:
        """What each integrator costs and how good it is, cheapest first."""
        return rank(self.rows) if self.said is None else from_data(self.said["summaries"])

    @cached_property
    def operation(self) -> list[str]:
        """What a person should know of the controller, in sentences."""
        return pitch_rate_sentences(self.rows) if self.said is None else list(self.said["operation"])

    @property
    def answer(self) -> dict[str, Any]:
        """What the rows say, as JSON holds it: who has it need not read them for the answer in the terminal."""
        return {
            "notes": self.notes,
            "summaries": as_data(self.summaries),
            "operation": self.operation,
            "lost": len(self.lost),
        }

    @property
    def exit_code(self) -> int:
        """0 where every case is done, 1 where some diverged or failed, or the report did."""
        return 1 if self.lost or self.report_error else 0

    def write(self) -> None:
        """Write `results.csv` with `columns.csv`, which says what its columns are, and `results.parquet` where pyarrow is installed."""
        self.write_csv()
        self.write_parquet()

    def write_csv(self) -> None:
        """Write `results.csv` with `columns.csv`."""
        rows = self.rows if isinstance(self.rows, Rows) else Rows(self.columns, self.rows)
        write_atomically(self.out / "results.csv", _csv(rows))
        if self.meanings:
            write_atomically(self.out / "columns.csv", units_csv(self.meanings).encode())

    def to_pandas(self) -> Any:
        """The table as a pandas DataFrame, where pandas is installed."""
        return to_pandas(self.rows, self.columns)

    def to_arrow(self) -> Any:
        """The table as a pyarrow Table, where pyarrow is installed."""
        return to_arrow(self.rows, {name: kind_of(name) for name in self.columns})

    def write_parquet(self) -> None:
        """Write `results.parquet` where pyarrow is installed."""
        try:
            import pyarrow.parquet as pq
        except ImportError:
            return
        buffer = io.BytesIO()
        pq.write_table(self.to_arrow(), buffer, use_dictionary=False)  # of numbers that are all different
        write_atomically(self.out / "results.parquet", buffer.getvalue())


def _csv(rows: Rows) -> Iterator[bytes]:
    """The lines of a table as CSV; the unknown is an empty cell."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    for cells in itertools.chain([rows.columns], rows.cells()):
        writer.writerow(cells)
        yield text.getvalue().encode()
        text.seek(0)
        text.truncate()


def _text_rows(text: str) -> Iterator[list[str]]:
    """The heading and the rows of a table, as many cells in each, also of one that a spreadsheet has written again: with other
    separators, and then with decimal commas."""
    heading = text.partition("\n")[0]
    separator = max(",;\t", key=heading.count)
    # not StringIO, which would hold the text again at four bytes a character
    reader = csv.reader((line[0] for line in _LINE.finditer(text)), delimiter=separator)
    names = next(reader, [])
    yield names
    for cells in filter(None, reader):
        whole = [*cells[: len(names)], *[""] * (len(names) - len(cells))]
        yield whole if separator == "," else [_with_point(cell) for cell in whole]


def _with_point(cell: str) -> str:
    return cell.replace(",", ".") if _DECIMAL_COMMA.fullmatch(cell.strip()) else cell


def _finished_cases(journal: Path) -> list[dict[str, Any]]:
    """The last row of every case of a journal; a line that is damaged or was cut off is as if it were never written."""
    with journal.open("rb") as file:
        records = (from_line(line.rstrip(b"\n")) for _, line in lines_of(file))
        found = {record["row"]["case_id"]: record["row"] for record in records if record is not None}
    for sentence in changed_files(journal.parent):
        warnings.warn(sentence, FatigueRunnerWarning, stacklevel=2)
    if not found:
        raise InputError(
            f"{journal.parent}: the run has not finished a case yet; `fatigue-runner run` goes on with it"
        )
    return list(found.values())


def read_results(folder: Path) -> list[dict[str, Any]]:
    """The rows of a run folder's `results.csv`, every cell as text (`cells` has their values); of a run that has not ended those of
    the cases that it has finished.

    Raises InputError, one sentence, for a folder without results and an empty or foreign table.
    """
    if _unfinished(folder):
        return _finished_cases(folder / "cases.jsonl")
    names, rows = _read(folder)
    return [dict(zip(names, cells, strict=True)) for cells in rows]


def read_rows(folder: Path) -> Rows:
    """The same in little memory, numbers as numbers and None for what is unknown."""
    if _unfinished(folder):
        cases = _finished_cases(folder / "cases.jsonl")
        return Rows(cases[-1], ({name: row.get(name) for name in cases[-1]} for row in cases))
    names, rows = _read(folder)
    found = Rows(names)
    found.extend_text(rows)
    return found


def changed_files(folder: Path) -> list[str]:
    """What of the rows of a run folder is not what the run left, in sentences: people edit tables, and disks lose bits."""
    if not _unfinished(folder):
        table = folder / "results.csv"
        changed = not as_left(table)
        said = f"{table} is not what the run wrote: it was changed since, or is damaged; `fatigue-runner run` writes it anew"
        return [said] if changed else []
    journal = folder / "cases.jsonl"
    with journal.open("rb") as file:
        damaged = sum(line.endswith(b"\n") and head_of(line) is None for _, line in lines_of(file))
    said = f"{damaged} records in {journal} are damaged and left out; `fatigue-runner run` runs these cases again"
    return [said] if damaged else []


def _unfinished(folder: Path) -> bool:
    return not (folder / "results.csv").is_file() and (folder / "cases.jsonl").is_file()


def _read(folder: Path) -> tuple[list[str], Iterable[list[str]]]:
    """Names and cells of `results.csv`."""
    table = folder / "results.csv"
    if not table.is_file():
        if not folder.is_dir():
            what = "is a file" if folder.exists() else "does not exist"
            raise InputError(f"{folder} {what}; give the output folder of `fatigue-runner run`")
        raise InputError(f"{folder} holds no results.csv; give the output folder of `fatigue-runner run`")
    text = _text_of(table)
    for sentence in changed_files(folder):
        warnings.warn(sentence, FatigueRunnerWarning, stacklevel=2)
    rows = _told(_text_rows(text), table)
    names, first = next(rows, []), next(rows, None)
    if first is None:
        raise InputError(f"{table} has no cases; run the campaign again to fill it")
    missing = [column for column in NEEDED if column not in names]
    if missing:
        raise InputError(f"{table} lacks the column {missing[0]!r}; is it the results table of a campaign?")
    return names, itertools.chain([first], rows)


def _text_of(table: Path) -> str:
    try:
        return decoded(table.read_bytes(), table, "the results table")
    except OSError as error:
        raise _unreadable(table, error) from None


def _told(rows: Iterable[list[str]], table: Path) -> Iterator[list[str]]:
    """The same rows; what is no CSV is told in a sentence."""
    try:
        yield from rows
    except csv.Error as error:
        raise _unreadable(table, error) from None


def _unreadable(table: Path, error: Exception) -> InputError:
    return InputError(f"{table} cannot be read as CSV: {error}; run the campaign again to rewrite it")
