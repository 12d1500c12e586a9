"""The results table: the rows as Python values, and the files they are written to and read from."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fatigue_runner.channels import channel_name
from fatigue_runner.encoded import decoded
from fatigue_runner.errors import InputError, did_you_mean
from fatigue_runner.inputs.files import write_atomically
from fatigue_runner.results.columns import NEEDED, Column, kind_of, units_csv
from fatigue_runner.results.frames import to_arrow, to_pandas
from fatigue_runner.results.records import whole_records

if TYPE_CHECKING:
    from fatigue_runner.results.lifetime import Life

_DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+([eE][-+]?\d+)?")


def known(value: Any) -> Any:
    """A cell's value as plain Python; None for what is unknown: NaN and infinity are no figures."""
    value = value.item() if hasattr(value, "item") else value
    return None if isinstance(value, float) and not math.isfinite(value) else value


@dataclass
class Results:
    """The outcome of a campaign: one row per case, in the order of the campaign.

    rows: dicts with every column, None where a figure is unknown; out: the run folder; `simulated` and `kept`
    count the cases that ran now and those that an earlier run had finished; life: what they stand for, where the campaign asks for it.
    """

    out: Path
    columns: list[str]
    rows: list[dict[str, Any]]
    simulated: int = 0
    kept: int = 0
    wall_time: float = 0.0
    report_error: str = ""
    life: Life | None = None
    notes: list[str] = field(default_factory=list)  # what limits the figures, in sentences
    meanings: Sequence[Column] = ()  # of the columns, where they are known

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        return iter(self.rows)

    def column(self, name: str) -> list[Any]:
        """One column, in row order; channels by their own or by OpenFAST's names: `del_RootMyb1_m10`. Raises InputError."""
        if name not in self.columns:
            name = "_".join(channel_name(part) for part in name.split("_"))
        if name not in self.columns:
            raise InputError(f"the results have no column {name!r}{did_you_mean(name, self.columns)}")
        return [row[name] for row in self.rows]

    def where(self, **conditions: Any) -> list[dict[str, Any]]:
        """The rows whose columns have these values: `results.where(method="heun", step=0.01)`."""
        return [row for row in self.rows if all(row[key] == value for key, value in conditions.items())]

    @property
    def lost(self) -> list[dict[str, Any]]:
        """The rows of the cases that diverged or failed."""
        return [row for row in self.rows if row["status"] != "done"]

    @property
    def exit_code(self) -> int:
        """0 where every case is done, 1 where some diverged or failed, or the report did."""
        return 1 if self.lost or self.report_error else 0

    def write(self) -> None:
        """Write `results.csv` with `columns.csv`, which says what its columns are, and `results.parquet` where pyarrow is installed."""
        text = io.StringIO()
        writer = csv.DictWriter(text, self.columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(self.rows)  # None becomes an empty cell
        write_atomically(self.out / "results.csv", text.getvalue().encode())
        if self.meanings:
            write_atomically(self.out / "columns.csv", units_csv(self.meanings).encode())
        self._write_parquet()

    def to_pandas(self) -> Any:
        """The table as a pandas DataFrame, where pandas is installed."""
        return to_pandas(self.rows, self.columns)

    def to_arrow(self) -> Any:
        """The table as a pyarrow Table, where pyarrow is installed."""
        return to_arrow(self.rows, {name: kind_of(name) for name in self.columns})

    def _write_parquet(self) -> None:
        try:
            import pyarrow.parquet as pq
        except ImportError:
            return
        buffer = io.BytesIO()
        pq.write_table(self.to_arrow(), buffer)
        write_atomically(self.out / "results.parquet", buffer.getvalue())


def _rows(text: str) -> list[dict[str, str]]:
    """The rows of a table, also of one that a spreadsheet has written again: with other separators, and then with decimal commas."""
    heading = text.partition("\n")[0]
    separator = max(",;\t", key=heading.count)
    rows = list(csv.DictReader(io.StringIO(text, newline=""), delimiter=separator))
    if separator == ",":
        return rows
    return [{key: _with_point(value) for key, value in row.items()} for row in rows]


def _with_point(cell: Any) -> Any:
    return (
        cell.replace(",", ".") if isinstance(cell, str) and _DECIMAL_COMMA.fullmatch(cell.strip()) else cell
    )


def _finished_cases(journal: Path) -> list[dict[str, Any]]:
    """The last row of every case of a journal; a line that a crash cut off is as if it were never written."""
    found, _ = whole_records(journal.read_bytes())
    return list({record["row"]["case_id"]: record["row"] for record in found}.values())


def read_results(folder: Path) -> list[dict[str, Any]]:
    """The rows of a run folder's `results.csv`, every cell as text (`cells` has their values); of a run that has not ended those of
    the cases that it has finished.

    Raises InputError, one sentence, for a folder without results and an empty or foreign table.
    """
    table = folder / "results.csv"
    if not table.is_file() and (folder / "cases.jsonl").is_file():
        found = _finished_cases(folder / "cases.jsonl")
        if not found:
            raise InputError(
                f"{folder}: the run has not finished a case yet; `fatigue-runner run` goes on with it"
            )
        return found
    if not table.is_file():
        if not folder.is_dir():
            what = "is a file" if folder.exists() else "does not exist"
            raise InputError(f"{folder} {what}; give the output folder of `fatigue-runner run`")
        raise InputError(f"{folder} holds no results.csv; give the output folder of `fatigue-runner run`")
    try:
        text = decoded(table.read_bytes(), table, "the results table")
        rows = _rows(text)
    except (OSError, csv.Error) as error:
        raise InputError(
            f"{table} cannot be read as CSV: {error}; run the campaign again to rewrite it"
        ) from None
    if not rows:
        raise InputError(f"{table} has no cases; run the campaign again to fill it")
    missing = [column for column in NEEDED if column not in rows[0]]
    if missing:
        raise InputError(f"{table} lacks the column {missing[0]!r}; is it the results table of a campaign?")
    return rows
