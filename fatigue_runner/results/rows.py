"""The rows of a table, held by its columns: eight bytes a number, where a dict for each row would take a hundred.

A campaign of ten thousand cases has two and a half million cells.
"""

from __future__ import annotations

import itertools
import math
import sys
from array import array
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, overload

from fatigue_runner.results.columns import Kind, kind_of

_UNKNOWN = math.nan  # in a column of numbers; a row gives None
_CHUNK = 256  # rows made at a time

Cells = dict[str, "array[float] | list[Any]"]


class TableRow(Mapping[str, Any]):
    """One row: a mapping with every column, None where a cell is unknown."""

    __slots__ = ("_at", "_cells")

    def __init__(self, cells: Cells, at: int) -> None:
        self._cells, self._at = cells, at

    def __getitem__(self, column: str) -> Any:
        value = self._cells[column][self._at]
        return None if value != value else value

    def get(self, column: str, default: Any = None) -> Any:
        """The cell; `default` where there is no such column."""
        return self[column] if column in self._cells else default

    def __iter__(self) -> Iterator[str]:
        return iter(self._cells)

    def __len__(self) -> int:
        return len(self._cells)

    def __repr__(self) -> str:
        return repr(dict(self))


class Rows(Sequence[TableRow]):
    """Rows with the same columns, in their order; grows by `extend`."""

    def __init__(self, columns: Iterable[str], rows: Iterable[Mapping[str, Any]] = ()) -> None:
        self._cells: Cells = {name: array("d") if kind_of(name) == "number" else [] for name in columns}
        self._count = 0
        self.extend(rows)

    @property
    def columns(self) -> list[str]:
        """Their names."""
        return list(self._cells)

    def extend(self, rows: Iterable[Mapping[str, Any]]) -> None:
        """Add rows. Raises KeyError for one that lacks a column."""
        self._extend([row[name] for name in self._cells] for row in rows)

    def extend_text(self, rows: Iterable[Sequence[str]]) -> None:
        """Add rows whose cells are text, as many as there are columns: each is read as what its column holds, empty is unknown."""
        self._extend(rows, _values)

    def _extend(
        self,
        rows: Iterable[Sequence[Any]],
        read: Callable[[Kind, Sequence[Any]], Sequence[Any]] | None = None,
    ) -> None:
        left = iter(rows)
        while chunk := list(itertools.islice(left, _CHUNK)):
            for name, column in zip(list(self._cells), zip(*chunk, strict=True), strict=True):
                values = column if read is None else read(kind_of(name), column)
                cells = self._cells[name]
                if type(cells) is list:
                    cells.extend(sys.intern(value) if type(value) is str else value for value in values)
                elif (kinds := set(map(type, values))) == {float}:
                    cells.extend(values)
                elif kinds <= {float, type(None)}:
                    cells.extend([_UNKNOWN if value is None else value for value in values])
                else:  # a column of somebody's own: everything in it stays as it came
                    self._cells[name] = [*(None if old != old else old for old in cells), *values]
            self._count += len(chunk)

    def column(self, name: str) -> list[Any]:
        """The cells of a column, in the order of the rows."""
        return [None if value != value else value for value in self._cells[name]]

    def cells(self) -> Iterator[tuple[Any, ...]]:
        """The cells of every row, in the order of the columns: faster than the rows themselves."""
        for start in range(0, self._count, _CHUNK):
            parts = (cells[start : start + _CHUNK] for cells in self._cells.values())
            yield from zip(*([None if v != v else v for v in part] for part in parts), strict=True)

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, at: int) -> TableRow: ...
    @overload
    def __getitem__(self, at: slice) -> list[TableRow]: ...
    def __getitem__(self, at: int | slice) -> TableRow | list[TableRow]:
        found = range(self._count)[at]
        return TableRow(self._cells, found) if isinstance(found, int) else [self[i] for i in found]

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Sequence):
            return NotImplemented
        return len(self) == len(other) and all(a == b for a, b in zip(self, other, strict=True))

    __hash__ = None  # type: ignore[assignment]  # as of a list


_READ: dict[Kind, Callable[[str], Any]] = {
    "number": float,
    "whole": int,
    "truth": {"True": True, "False": False}.__getitem__,
    "text": str,
}


def _values(kind: Kind, cells: Sequence[str]) -> Sequence[Any]:
    """What is written in the cells; all stay as they are where one is none of the kind."""
    read = _READ[kind]
    try:
        return [read(cell) if cell else None for cell in cells] if "" in cells else list(map(read, cells))
    except (ValueError, KeyError):
        return [cell or None for cell in cells]
