"""Tables for other libraries: pandas and pyarrow, where they are installed. Neither is needed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from fatigue_runner.errors import InputError
from fatigue_runner.results.rows import Rows as ByColumns

Rows = Sequence[Mapping[str, Any]]


def to_pandas(rows: Rows, columns: Sequence[str]) -> Any:
    """A pandas DataFrame with these columns; an unknown cell is None or NaN. Raises InputError without pandas."""
    try:
        import pandas
    except ImportError:
        raise InputError(
            "pandas is not installed; `pip install pandas`, or use `rows`, plain dicts"
        ) from None
    return pandas.DataFrame.from_records([dict(row) for row in rows], columns=list(columns))


def to_arrow(rows: Rows, kinds: Mapping[str, str]) -> Any:
    """A pyarrow Table; kinds {column: text, truth, whole or number}. Raises InputError without pyarrow."""
    try:
        import pyarrow as pa
    except ImportError:
        raise InputError(
            "pyarrow is not installed; `pip install pyarrow`, or use `rows`, plain dicts"
        ) from None
    types = {"text": pa.string(), "truth": pa.bool_(), "whole": pa.int64(), "number": pa.float64()}
    return pa.table({name: pa.array(_column(rows, name), types[kind]) for name, kind in kinds.items()})


def _column(rows: Rows, name: str) -> list[Any]:
    return rows.column(name) if isinstance(rows, ByColumns) else [row.get(name) for row in rows]


def rows_of(table: Any) -> Rows:
    """The rows of a pandas DataFrame, a pyarrow Table, or of anything that holds mappings."""
    if hasattr(table, "to_pylist"):
        return list(table.to_pylist())
    if hasattr(table, "to_dict"):
        return list(table.to_dict("records"))
    return list(table)
